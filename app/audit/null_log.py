"""The operator's log if the panel file switches it off: keeps nothing, and refuses presses while
another server has the folder."""

import logging
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

from app.audit.data_dir import DataDir
from app.audit.database import Head
from app.audit.entry import Entry, Origin
from app.audit.queries import OpenPress
from app.errors import FolderInUse, LogError
from app.i18n import TextLike, say

log = logging.getLogger("kiosk.log")


class NullLog:
    """Accepts every entry and writes none. Still locks the folder against a second server."""

    folder = None
    enabled = False
    fault: TextLike = ""
    lock: TextLike = ""
    head: Head | None = None
    key = ""
    uncopied: Mapping[str, int] = MappingProxyType({})
    left_out = 0

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = DataDir(folder) if folder else None

    async def start(self) -> None:
        """FolderInUse if another server has the folder: a repeated press could be sent by both."""
        try:
            if self._folder is not None:
                await self._folder.hold_soon()
        except OSError as error:
            log.warning("a second server would not be noticed: %s", error)

    async def stop(self) -> None:
        if self._folder is not None:
            self._folder.release()

    @contextmanager
    def notifying(self, changed: Callable[[], None]) -> Iterator[None]:
        """`changed` is never called."""
        yield

    def allowed(self, origin: Origin) -> bool:
        return True

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        """Does nothing."""

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        return []

    async def pressed(self, entry: Entry) -> Entry | None:
        """LogError if another server has taken the folder in the meantime."""
        if self._folder is not None:
            try:
                self._folder.claim()
            except FolderInUse as error:
                raise LogError(say("disk_data_in_use", why=error.text)) from error
            except OSError as error:
                log.warning("a second server would not be noticed: %s", error)
        return None

    async def closed(self, entry: Entry) -> TextLike:
        return ""

    def close(self) -> None:
        """Does nothing."""

    def add(self, entry: Entry) -> None:
        """Does nothing."""
