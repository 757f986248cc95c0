"""How many may read the operator's log at a time: who finds no place is told when to come again."""

from collections.abc import Iterator
from contextlib import contextmanager

from app.errors import TooMany
from app.i18n import TextLike


class ReaderSlots:
    """On the event loop; no one waits."""

    def __init__(self, most: int, again_s: int, message: TextLike) -> None:
        """`again_s`: when it makes sense to come again; `message` says that all places are taken."""
        self._free = most
        self._again_s = again_s
        self._message = message

    @contextmanager
    def slot(self) -> Iterator[None]:
        """One place, while it lasts; TooMany where there is none."""
        if not self._free:
            raise TooMany(self._message, self._again_s)
        self._free -= 1
        try:
            yield
        finally:
            self._free += 1
