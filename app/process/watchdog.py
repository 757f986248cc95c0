"""Tells the service manager that the server serves, how it is, and that it still turns.

A ping goes out while the event loop turns and every robot's link responds. What it is to catch is a
deadlock between Zenoh's callbacks and a lock: nothing in the process ends it, a restart does. A bridge
that is away is no failure of the process.
"""

import asyncio
import logging
import threading
from collections.abc import Callable, Iterable
from typing import Final, Protocol

from app.i18n import TextLike, render, say
from app.process.listen_sockets import listening, names
from app.process.sd_notify import ServiceManager, status

log = logging.getLogger("kiosk.watchdog")

STATUS_EVERY_S: Final = 5.0  # where there is no watchdog to ping
LOOK_EVERY_S: Final = 0.05


class Responding(Protocol):
    def respond(self) -> None:
        """Returns when nothing in it stands still; blocks for as long as something does."""


class Watchdog:
    """Runs from `run` until it is cancelled."""

    def __init__(
        self,
        manager: ServiceManager,
        links: Callable[[], Iterable[tuple[str, Responding]]],
        state: Callable[[], TextLike],
    ) -> None:
        """`links` are those of now, with their robots' names; `state` is the server's, in words."""
        self._manager = manager
        self._links = links
        self._state = state
        self._asking: dict[int, threading.Thread] = {}
        self._stuck = ""
        self._ended = False
        self._every_s = (manager.interval_s or 2 * STATUS_EVERY_S) / 2

    async def run(self) -> None:
        """Says READY when the server listens, then how it is, for ever."""
        if not self._manager.listens:
            return
        await listening(names())
        self._manager.tell("READY=1")
        while True:
            stuck = await self._standing_still()
            if stuck != self._stuck and stuck:
                log.critical("%s", say("link_stands_still", name=stuck))
            self._stuck = stuck
            if not self._ended:
                text = say("link_stands_still", name=stuck) if stuck else self._state()
                ping = ["WATCHDOG=1"] if self._manager.interval_s and not stuck else []
                self._manager.tell(*ping, status(render(text)))
            await asyncio.sleep(self._every_s)

    def end(self) -> None:
        """The server was told to end."""
        if not self._ended:
            self._ended = True
            self._manager.tell("STOPPING=1", status(render(say("stopping"))))

    async def _standing_still(self) -> str:
        """The robots whose links did not respond in a quarter of the interval; "" for none."""
        loop = asyncio.get_running_loop()
        links = [(name or render(say("robot")), link) for name, link in self._links()]
        for _, link in links:
            if id(link) not in self._asking:
                # A thread of its own: the executor's may all be busy, and this one may never end.
                thread = threading.Thread(target=link.respond, name="watchdog", daemon=True)
                self._asking[id(link)] = thread
                thread.start()
        end = loop.time() + self._every_s / 2
        while self._alive() and loop.time() < end:
            await asyncio.sleep(LOOK_EVERY_S)
        alive = self._alive()
        return ", ".join(name for name, link in links if id(link) in alive)

    def _alive(self) -> dict[int, threading.Thread]:
        self._asking = {of: thread for of, thread in self._asking.items() if thread.is_alive()}
        return self._asking
