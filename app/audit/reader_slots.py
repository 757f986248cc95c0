"""Limits the number of concurrent readers of the operator's log."""

from collections.abc import Iterator
from contextlib import contextmanager

from app.errors import TooMany
from app.i18n import TextLike


class ReaderSlots:
    """A semaphore that rejects instead of waiting. Used on the event loop only."""

    def __init__(self, most: int, retry_after_s: int, message: TextLike) -> None:
        """`message` and `retry_after_s` are for a client that is rejected."""
        self._free = most
        self._retry_after_s = retry_after_s
        self._message = message

    @contextmanager
    def slot(self) -> Iterator[None]:
        """Takes a slot within the block; TooMany if none is free."""
        if not self._free:
            raise TooMany(self._message, self._retry_after_s)
        self._free -= 1
        try:
            yield
        finally:
            self._free += 1
