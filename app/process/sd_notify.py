"""The service manager's protocol: what this process tells it, and how often it wants to hear.

Source: sd_notify(3) and sd_watchdog_enabled(3). Nothing is told where nobody asked for it.
"""

import logging
import os
import socket
from collections.abc import Mapping
from typing import Final

log = logging.getLogger("kiosk.systemd")

MAX_STATUS_BYTES: Final = 2000  # bytes of a state in words


class ServiceManager:
    """systemd, or another that speaks its protocol; `interval_s` is None without a watchdog."""

    def __init__(self, env: Mapping[str, str] = os.environ) -> None:
        self._address = _socket_address(env.get("NOTIFY_SOCKET", ""))
        self.interval_s = _watchdog_interval_s(env) if self._address else None
        self._failed = False

    @property
    def is_enabled(self) -> bool:
        return bool(self._address)

    def notify(self, *lines: str) -> None:
        """Sends `NAME=value` lines at once or not at all."""
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as speaker:
                speaker.setblocking(False)
                speaker.sendto("\n".join(lines).encode(errors="replace"), self._address)
            self._failed = False
        except OSError as error:
            if not self._failed:
                log.warning("can't tell the service manager %s: %s", lines[0], error)
            self._failed = True


def status_line(text: str) -> str:
    """The line for a state in words."""
    return "STATUS=" + " ".join(text.split())[:MAX_STATUS_BYTES]


def _socket_address(given: str) -> str:
    """A path, or an abstract socket ("@name"), whose name starts with a zero byte."""
    if given.startswith("@"):
        return "\0" + given[1:]
    if given and not given.startswith("/"):
        log.warning('NOTIFY_SOCKET is "%s": only a path or an abstract socket (@…) is used', given)
        return ""
    return given


def _watchdog_interval_s(env: Mapping[str, str]) -> float | None:
    """Seconds between pings at most, if they are this process's to send."""
    given = env.get("WATCHDOG_USEC", "")
    if not given or env.get("WATCHDOG_PID") not in (None, "", str(os.getpid())):
        return None
    if not given.isdecimal() or int(given) == 0:
        log.warning('WATCHDOG_USEC is "%s": it must be a number of microseconds', given)
        return None
    return int(given) / 1e6
