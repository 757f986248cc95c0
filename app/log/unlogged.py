"""What stands in the log's place where the panel file switches it off: it keeps nothing."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from app.log.entry import Entry
from app.log.store import Head


class Unlogged:
    """Takes every entry and writes none."""

    folder = None
    enabled = False
    fault = ""
    lock = ""
    head: Head | None = None

    async def start(self) -> None:
        """Nothing has to be opened."""

    async def stop(self) -> None:
        """Nothing has to be closed."""

    @contextmanager
    def followed(self, changed: Callable[[], None]) -> Iterator[None]:
        """There is never anything to be told."""
        yield

    async def pressed(self, entry: Entry) -> Entry | None:
        return None

    async def closed(self, entry: Entry) -> str:
        return ""

    def add(self, entry: Entry) -> None:
        """It is not kept."""
