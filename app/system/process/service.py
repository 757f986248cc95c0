"""Notifications to the service manager: readiness, status and the watchdog."""

import asyncio
import logging
import os
import socket
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Final, Protocol

from app.system.process.listen_sockets import listener_names, wait_for_listener
from app.system.texts import TextLike, render, say

# The service manager's notification protocol: state messages and the watchdog interval.
#
# Source: sd_notify(3) and sd_watchdog_enabled(3). Without `NOTIFY_SOCKET` nothing is sent.

sd_log = logging.getLogger("kiosk.systemd")

MAX_STATUS_BYTES: Final = 2000


class ServiceManager:
    """systemd, or another service manager with its protocol. `interval_s` is the watchdog's, None
    without one."""

    def __init__(self, env: Mapping[str, str] = os.environ) -> None:
        self._address = _socket_address(env.get("NOTIFY_SOCKET", ""))
        self.interval_s = _watchdog_interval_s(env) if self._address else None
        self._failed = False

    @property
    def is_enabled(self) -> bool:
        return bool(self._address)

    def notify(self, *lines: str) -> None:
        """Sends `NAME=value` lines without blocking; a failure is logged once."""
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as speaker:
                speaker.setblocking(False)
                speaker.sendto("\n".join(lines).encode(errors="replace"), self._address)
            self._failed = False
        except OSError as error:
            if not self._failed:
                sd_log.warning("can't tell the service manager %s: %s", lines[0], error)
            self._failed = True


def status_line(text: str) -> str:
    """The `STATUS=` line of a text."""
    return "STATUS=" + " ".join(text.split())[:MAX_STATUS_BYTES]


def _socket_address(path: str) -> str:
    """The socket address of a path or of an abstract socket ("@name"); "" if it is neither."""
    if path.startswith("@"):
        return "\0" + path[1:]
    if path and not path.startswith("/"):
        sd_log.warning('NOTIFY_SOCKET is "%s": only a path or an abstract socket (@…) is used', path)
        return ""
    return path


def _watchdog_interval_s(env: Mapping[str, str]) -> float | None:
    """The watchdog interval in seconds; None if this process has none."""
    timeout_us = env.get("WATCHDOG_USEC", "")
    if not timeout_us or env.get("WATCHDOG_PID") not in (None, "", str(os.getpid())):
        return None
    if not timeout_us.isdecimal() or int(timeout_us) == 0:
        sd_log.warning('WATCHDOG_USEC is "%s": it must be a number of microseconds', timeout_us)
        return None
    return int(timeout_us) / 1e6


# Reports readiness, status and liveness to the service manager.
#
# A watchdog ping is sent while the event loop runs and every robot's link responds. It detects a
# deadlock between Zenoh's callbacks and a lock, which only a restart ends. A lost bridge is no failure
# of the process.

log = logging.getLogger("kiosk.watchdog")

STATUS_INTERVAL_S: Final = 5.0  # where there is no watchdog to ping
POLL_INTERVAL_S: Final = 0.05


class RespondingLink(Protocol):
    def probe(self) -> None:
        """Returns if the link is not stalled; blocks while it is."""


class Watchdog:
    """Runs from `run` until it is cancelled."""

    def __init__(
        self,
        manager: ServiceManager,
        links: Callable[[], Iterable[tuple[str, RespondingLink]]],
        state: Callable[[], TextLike],
    ) -> None:
        """`links` returns (robot's name, link) of all sessions; `state` returns the status text."""
        self._manager = manager
        self._links = links
        self._status_text = state
        self._probes: dict[int, threading.Thread] = {}
        self._unresponsive = ""
        self._stopping = False
        self._every_s = (manager.interval_s or 2 * STATUS_INTERVAL_S) / 2

    async def run(self) -> None:
        """Sends READY when the server listens, then status and pings until it is cancelled."""
        if not self._manager.is_enabled:
            return
        await wait_for_listener(listener_names())
        self._manager.notify("READY=1")
        while True:
            stuck = await self._unresponsive_links()
            if stuck != self._unresponsive and stuck:
                log.critical("%s", say("link_session_stalled", name=stuck))
            self._unresponsive = stuck
            if not self._stopping:
                text = say("link_session_stalled", name=stuck) if stuck else self._status_text()
                ping = ["WATCHDOG=1"] if self._manager.interval_s and not stuck else []
                self._manager.notify(*ping, status_line(render(text)))
            await asyncio.sleep(self._every_s)

    def notify_stopping(self) -> None:
        """Reports that the server is stopping."""
        if not self._stopping:
            self._stopping = True
            self._manager.notify("STOPPING=1", status_line(render(say("stopping"))))

    async def _unresponsive_links(self) -> str:
        """The names of the robots whose links did not respond in a quarter of the interval; "" for
        none."""
        loop = asyncio.get_running_loop()
        links = [(name or render(say("robot")), link) for name, link in self._links()]
        for _, link in links:
            if id(link) not in self._probes:
                # A separate thread: the executor's may all be busy, and this one may never end.
                thread = threading.Thread(target=link.probe, name="watchdog", daemon=True)
                self._probes[id(link)] = thread
                thread.start()
        end = loop.time() + self._every_s / 2
        while self._running_probes() and loop.time() < end:
            await asyncio.sleep(POLL_INTERVAL_S)
        alive = self._running_probes()
        return ", ".join(name for name, link in links if id(link) in alive)

    def _running_probes(self) -> dict[int, threading.Thread]:
        self._probes = {
            link_id: thread for link_id, thread in self._probes.items() if thread.is_alive()
        }
        return self._probes
