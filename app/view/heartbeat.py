"""The heartbeat of all streams of a publisher: one timer, one event for all streams of a language."""

import asyncio
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from app import clock
from app.clock import format_day, format_time, iso_time
from app.i18n import ENGLISH, render

BEAT_S: Final = 0.5  # a page locks itself after 1.75 s without any event
# A beat that is so nearly due goes with what is sent anyway: more than the pause of what is sent ten
# times a second, where it would come to all streams just before that, and keep it waiting.
EARLY_S: Final = 0.15


class Heartbeat:
    """Beats while at least one stream is open; on the event loop only."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """`wake` is called when a beat is due: the streams then send it."""
        self.count = 0
        self._events: dict[str, bytes] = {}
        self._wake = wake
        self._open_streams = 0
        self._timer: asyncio.TimerHandle | None = None

    @contextmanager
    def heard(self) -> Iterator[None]:
        """A context for as long as a stream is open."""
        self._open_streams += 1
        if self._timer is None:
            self._plan()
        try:
            yield
        finally:
            self._open_streams -= 1
            if not self._open_streams and self._timer is not None:
                self._timer.cancel()
                self._timer = None

    def beat_early(self) -> None:
        """Beats now if a beat is nearly due: it is sent with the event that is about to be sent."""
        timer = self._timer
        if timer is not None and timer.when() - asyncio.get_running_loop().time() <= EARLY_S:
            timer.cancel()
            self._beat()

    def event(self, language: str = ENGLISH) -> bytes:
        """The event of the last beat, the same for all readers of a language."""
        if language not in self._events:
            self._events[language] = beat(language)
        return self._events[language]

    def _due(self) -> None:
        self._beat()
        self._wake()

    def _beat(self) -> None:
        self._events.clear()
        self.count += 1
        self._plan()

    def _plan(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(BEAT_S, self._due)


def beat(language: str = ENGLISH) -> bytes:
    """The `beat` event, without an id. A page that misses it locks itself.

    `clock` and `day` are the time as the page shows it, `at` the same as ISO 8601; `now` is the
    server's own time, in milliseconds.
    """
    wall = time.time()
    data = {
        "clock": render(format_time(wall), language),
        "day": render(format_day(wall), language),
        "at": iso_time(wall),
        "now": round(clock.server_now() * 1000),
    }
    return f"event: beat\ndata: {json.dumps(data)}\n\n".encode()
