"""The file of saved places while its server runs: read at the start, written by a thread, whole or not
at all. A change counts when it is on the disk."""

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from app.cell.commands.acts import Finish
from app.cell.places.saved import MAX_FILE_BYTES, SavedPlaces, places_text, read_places
from app.cell.recipes.book import disk_error, read_file, write_file
from app.panel.places import Place
from app.system.texts import Text, say

log = logging.getLogger("kiosk.places")

NAME: Final = "places.toml"  # in the data folder
WRITTEN_WITHIN_S: Final = 5.0  # then the receipt says that the disk does not answer


def read_saved(data: Path) -> SavedPlaces:
    """The places of a data folder. Waits for the disk."""
    file = data / NAME
    if not file.is_symlink() and not file.exists():
        return SavedPlaces()
    content = read_file(file, MAX_FILE_BYTES)
    return SavedPlaces(fault=content) if isinstance(content, Text) else read_places(content)


class SavedPlaceFile:
    """Opened by `start`, closed by `stop`. Used on the event loop only."""

    def __init__(self, written_within_s: float = WRITTEN_WITHIN_S) -> None:
        self.saved = SavedPlaces()
        self.is_writing = False
        self._within_s = written_within_s
        self._listeners: list[Callable[[], None]] = []
        self._thread: ThreadPoolExecutor | None = None
        self._file = Path()
        self._open: set[asyncio.Task[Text | None]] = set()

    def add_listener(self, changed: Callable[[], None]) -> None:
        """`changed` is called after each change."""
        self._listeners.append(changed)

    async def start(self, data: Path) -> None:
        """Reads what is on the disk. `data` is the data folder, which must be this server's."""
        self._file = data / NAME
        self._thread = ThreadPoolExecutor(1, "places")
        read = asyncio.get_running_loop().run_in_executor
        self._take(await read(self._thread, read_saved, data))
        if self.saved.fault:
            log.error("%s: %s", self._file, self.saved.fault)

    async def stop(self) -> None:
        """Waits for what is being written."""
        if self._open:
            await asyncio.wait(self._open, timeout=self._within_s)
        if self._thread is not None:
            self._thread.shutdown(wait=False)

    def write(self, places: tuple[Place, ...]) -> Finish:
        """Begins to write all places; the function returned waits for its end, and returns why it
        failed."""
        self.is_writing = True
        task = asyncio.ensure_future(self._written(places))
        self._open.add(task)
        task.add_done_callback(self._open.discard)

        async def finish() -> Text | None:
            done, _ = await asyncio.wait({task}, timeout=self._within_s)
            return task.result() if done else say("recipe_disk_slow")

        return finish

    async def _written(self, places: tuple[Place, ...]) -> Text | None:
        write = asyncio.get_running_loop().run_in_executor
        try:
            await write(self._thread, write_file, self._file, places_text(places).encode())
        except OSError as error:
            log.error("%s: %s", self._file, error)
            return disk_error(error).reason
        except Exception as error:
            log.exception("%s", self._file)
            return say("recipe_disk_failed", why=str(error))
        finally:
            self.is_writing = False
        self._take(SavedPlaces(places))
        return None

    def _take(self, saved: SavedPlaces) -> None:
        self.saved = saved
        for changed in self._listeners:
            changed()
