"""The recipes of a panel while its server runs: read at the start, written by a thread.

The command line changes them too: its changes are looked for every second, and logged as acts.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from app.cell.commands.acts import Finish
from app.cell.recipes.book import (
    FOLDER,
    Author,
    BookChange,
    Entry,
    RecipeBook,
    RecipeDiskError,
    RecipeFolder,
    Writing,
    number_of,
)
from app.cell.recipes.command_line import LineChange, LineChanges, Stamp, line_entry
from app.panel.model import Panel
from app.panel.widgets.recipe_load import RecipeLoad
from app.records.press_record import Log
from app.system.concurrency import end_tasks, keep_running
from app.system.texts import Text, TextLike, say

log = logging.getLogger("kiosk.recipes")

WRITTEN_WITHIN_S: Final = 5.0  # then the receipt says that the disk does not answer
STOPPED_WITHIN_S: Final = 5.0
WATCHED_EVERY_S: Final = 1.0


class Recipes:
    """The books of all sets, opened by `start`. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        wall: Callable[[], float] = time.time,
        written_within_s: float = WRITTEN_WITHIN_S,
    ) -> None:
        self.wall = wall
        self._panel = panel
        self._within_s = written_within_s
        self._books: dict[str, RecipeBook] = {}
        self._listeners: list[Callable[[], None]] = []
        self._thread: ThreadPoolExecutor | None = None
        self._open: set[asyncio.Task[Text | None]] = set()
        self._watching: asyncio.Task[None] | None = None
        self._stamp: Stamp | None = None
        self._unread = ""  # why the last look failed: it is logged once, not every second
        self._fault: TextLike = ""  # why changes are not in the operator's log yet

    def add_listener(self, changed: Callable[[], None]) -> None:
        """`changed` is called after each change."""
        self._listeners.append(changed)

    async def start(self, data: Path, oplog: Log) -> None:
        """Reads what is on the disk. `data` is the data folder, which must be this server's; `oplog`
        gets the changes by the command line."""
        if not self._panel.recipes:
            return
        self._thread = ThreadPoolExecutor(1, "recipes")
        loop = asyncio.get_running_loop()
        for load in self._panel.recipe_loads:
            folder = RecipeFolder(data / FOLDER / load.id)
            book = self._books[load.id] = RecipeBook(load, folder)
            try:
                book.fill(await loop.run_in_executor(self._thread, folder.every))
            except OSError as error:
                log.error("recipes of %s: %s", load.id, error)
            for broken in book.broken:
                log.error("recipe %s of %s: %s", broken.id, load.id, broken.reason)
        changes = LineChanges(data / FOLDER)
        watch = partial(self._watch, changes, oplog)
        self._watching = keep_running(watch, log, "watching recipes failed")

    async def stop(self) -> None:
        """Waits for what is being written."""
        await end_tasks((self._watching,))
        if self._open:
            await asyncio.wait(self._open, timeout=STOPPED_WITHIN_S)
        if self._thread is not None:
            self._thread.shutdown(wait=False)

    def book(self, set_id: str) -> RecipeBook | None:
        return self._books.get(set_id)

    def revisions(self) -> Mapping[str, int]:
        """The revision of each set: a page that shows another one is out of date."""
        return {name: book.revision for name, book in self._books.items()}

    def write(self, book: RecipeBook, author: Author, change: BookChange) -> Finish:
        """Begins to write a change; the function returned waits for its end, and returns why it
        failed."""
        task = asyncio.ensure_future(self._written(book, book.begin(author, change)))
        self._open.add(task)
        task.add_done_callback(self._open.discard)

        async def finish() -> Text | None:
            done, _ = await asyncio.wait({task}, timeout=self._within_s)
            return task.result() if done else say("recipe_disk_slow")

        return finish

    async def _written(self, book: RecipeBook, writing: Writing) -> Text | None:
        failure: Text | None = None
        try:
            await asyncio.get_running_loop().run_in_executor(self._thread, writing.run)
        except RecipeDiskError as error:
            failure = error.reason
            log.error("recipes of %s: %s", book.load.id, error)
        except Exception as error:
            failure = say("recipe_disk_failed", why=str(error))
            log.exception("recipes of %s", book.load.id)
        book.end(writing)
        for changed in self._listeners:
            changed()
        return failure

    async def _watch(self, changes: LineChanges, oplog: Log) -> None:
        """Takes changes by the command line, until it is cancelled."""
        loop = asyncio.get_running_loop()
        while True:
            look = await loop.run_in_executor(self._thread, self._look, changes)
            if look is not None:
                await self._take(look, changes, oplog)
            await asyncio.sleep(WATCHED_EVERY_S)

    def _look(self, changes: LineChanges) -> "_Look | None":
        """What the command line has changed since the last look, on the thread."""
        stamp = changes.stamp()
        if stamp == self._stamp:
            return None
        books = list(self._books.values())
        try:
            with books[0].folder.locked():
                entries = {book.load.id: book.folder.every() for book in books}
                logged = changes.logged()
                new = [change for change in changes.read() if change.number > logged]
                self._unread = ""
                return _Look(changes.stamp(), entries, new, logged)
        except (RecipeDiskError, OSError) as error:
            if f"{error}" != self._unread:
                log.error("recipes: %s", error)
            self._unread = f"{error}"
            return None

    async def _take(self, look: "_Look", changes: LineChanges, oplog: Log) -> None:
        for set_id, entries in look.entries.items():
            self._books[set_id].fill(entries)
        for changed in self._listeners:
            changed()
        logged = look.logged
        if look.new and logged and look.new[0].number > logged + 1:
            log.warning("%d changes of recipes are not in the operator's log", look.new[0].number - 1)
        for change in look.new:
            if self._happened(change):
                fault = await oplog.closed(line_entry(change, self._load_of(change.set)))
                if fault and fault != self._fault:
                    log.warning("changes of recipes are not in the operator's log: %s", fault)
                self._fault = fault
                if fault:
                    break  # again at the next look
            logged = change.number
        if logged != look.logged:
            keep = asyncio.get_running_loop().run_in_executor
            await keep(self._thread, changes.set_logged, logged)
        if not self._fault:
            self._stamp = look.stamp

    def _load_of(self, set_id: str) -> RecipeLoad | None:
        return self._books[set_id].load if set_id in self._books else None

    def _happened(self, change: LineChange) -> bool:
        """Whether a change is on the disk: its process may have ended before."""
        book = self._books.get(change.set)
        return book is None or number_of(book.recipe(change.recipe)) >= change.version


class _Look(NamedTuple):
    """All recipes by their sets, and the changes that are not `logged` yet."""

    stamp: Stamp | None
    entries: Mapping[str, list[Entry]]
    new: list[LineChange]
    logged: int
