"""The service manager's notification protocol: state messages and the watchdog interval.

Source: sd_notify(3) and sd_watchdog_enabled(3). Without `NOTIFY_SOCKET` nothing is sent.
"""

import logging
import os
import socket
from collections.abc import Mapping
from typing import Final

log = logging.getLogger("kiosk.systemd")

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
                log.warning("can't tell the service manager %s: %s", lines[0], error)
            self._failed = True


def status_line(text: str) -> str:
    """The `STATUS=` line of a text."""
    return "STATUS=" + " ".join(text.split())[:MAX_STATUS_BYTES]


def _socket_address(path: str) -> str:
    """The socket address of a path or of an abstract socket ("@name"); "" if it is neither."""
    if path.startswith("@"):
        return "\0" + path[1:]
    if path and not path.startswith("/"):
        log.warning('NOTIFY_SOCKET is "%s": only a path or an abstract socket (@…) is used', path)
        return ""
    return path


def _watchdog_interval_s(env: Mapping[str, str]) -> float | None:
    """The watchdog interval in seconds; None if this process has none."""
    timeout_us = env.get("WATCHDOG_USEC", "")
    if not timeout_us or env.get("WATCHDOG_PID") not in (None, "", str(os.getpid())):
        return None
    if not timeout_us.isdecimal() or int(timeout_us) == 0:
        log.warning('WATCHDOG_USEC is "%s": it must be a number of microseconds', timeout_us)
        return None
    return int(timeout_us) / 1e6
