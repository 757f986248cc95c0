"""The transport of a client's connection: it holds the client's place, and closes so that the client
gets the last answer.

The kernel resets a connection that is closed while bytes of the client wait unread, and a reset takes
the answer away that was just sent. So the rest of a request is read and dropped for a moment.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

DRAIN_WITHIN_S: Final = 5.0
DRAIN_MOST: Final = 16 << 20  # bytes of the rest of a request


class ClientTransport:
    """Delegates to a transport."""

    def __init__(self, transport: asyncio.Transport, has_rest: Callable[[], bool]) -> None:
        """`has_rest`: whether a part of a request has still to come."""
        self._transport = transport
        self._has_rest = has_rest
        self._release: Callable[[], None] | None = None
        self._draining: asyncio.TimerHandle | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    @property
    def draining(self) -> bool:
        """Whether all was sent, and what still comes is dropped."""
        return self._draining is not None

    def is_closing(self) -> bool:
        return self.draining or self._transport.is_closing()

    def write(self, data: bytes) -> None:
        if not self.draining:
            self._transport.write(data)

    def close(self) -> None:
        """Closes; while a request has not come wholly, at the latest after `DRAIN_WITHIN_S`."""
        if self.is_closing():
            return
        if not self._has_rest():
            self._transport.close()
            return
        self._draining = asyncio.get_running_loop().call_later(DRAIN_WITHIN_S, self.close_now)
        with suppress(OSError, RuntimeError):  # the client was faster
            if self._transport.can_write_eof():
                self._transport.write_eof()
            self._transport.resume_reading()

    def close_now(self) -> None:
        """Closes, whatever the client still sends."""
        if self._draining is not None:
            self._draining.cancel()
        self._transport.close()

    def occupy(self, release: Callable[[], None]) -> None:
        """Holds a place of the client, which `release` gives back."""
        self._release = release

    def release(self) -> None:
        """Gives the client's place back, if it holds one."""
        release, self._release = self._release, None
        if release is not None:
            release()
