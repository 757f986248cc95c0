"""The recipes of a panel while its server runs: read at the start, written by a thread."""

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from app.commands.acts import Finish
from app.i18n import Text, say
from app.panel.model import Panel
from app.recipes.book import Author, Change, RecipeBook, Writing
from app.recipes.folder import FOLDER, RecipeDiskError, RecipeFolder

log = logging.getLogger("kiosk.recipes")

WRITTEN_WITHIN_S: Final = 5.0  # then the receipt says that the disk does not answer
STOPPED_WITHIN_S: Final = 5.0


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

    def add_listener(self, changed: Callable[[], None]) -> None:
        """`changed` is called after each change."""
        self._listeners.append(changed)

    async def start(self, data: Path) -> None:
        """Reads what is on the disk. `data` is the data folder, which must be this server's."""
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

    async def stop(self) -> None:
        """Waits for what is being written."""
        if self._open:
            await asyncio.wait(self._open, timeout=STOPPED_WITHIN_S)
        if self._thread is not None:
            self._thread.shutdown(wait=False)

    def book(self, set_id: str) -> RecipeBook | None:
        return self._books.get(set_id)

    def revisions(self) -> Mapping[str, int]:
        """The revision of each set: a page that shows another one is out of date."""
        return {name: book.revision for name, book in self._books.items()}

    def write(self, book: RecipeBook, author: Author, change: Change) -> Finish:
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
