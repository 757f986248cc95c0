"""The copy of the operator's log by syslog: RFC 5424 messages over TLS (RFC 5425). Blocks; used by one
thread."""

import os
import socket
import ssl
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from app.audit.copied import as_line
from app.audit.entry import Entry

PRIORITY: Final = 13 * 8 + 6  # facility "log audit", severity "informational"
TIMEOUT_S: Final = 5.0
ENDS_WITHIN_S: Final = 0.5
REPEATED: Final = 100  # entries that are sent again over a new connection
BOM: Final = "\ufeff"


def message(entry: Entry, host: str, pid: int) -> bytes:
    """An entry as a message of RFC 5424: the entry as JSON, its kind as MSGID."""
    at = datetime.fromtimestamp(entry.at / 1000, UTC).isoformat(timespec="milliseconds")
    head = f"<{PRIORITY}>1 {at.replace('+00:00', 'Z')} {host} operator-panel {pid} {entry.kind} -"
    return f"{head} {BOM}{as_line(entry)}".encode("utf-8", "replace")


class SyslogSink:
    """A connection to a syslog server. The protocol has no acknowledgement: over a new connection the
    last entries are sent again, and a collector knows them by their numbers."""

    kind: Final = "syslog"

    def __init__(self, host: str, port: int, ca: Path | None) -> None:
        self.name = f"{host}:{port}"
        self._address = (host, port)
        self._ca = ca
        self._host = socket.gethostname() or "-"
        self._socket: ssl.SSLSocket | None = None
        self._sent: deque[Entry] = deque(maxlen=REPEATED)

    def open(self) -> Entry | None:
        """Connects; returns the newest entry that was sent before those that are sent again, None
        without one. OSError, which includes errors of certificates."""
        context = ssl.create_default_context(cafile=str(self._ca) if self._ca else None)
        raw = socket.create_connection(self._address, TIMEOUT_S)
        try:
            self._socket = context.wrap_socket(raw, server_hostname=self._address[0])
        except BaseException:
            raw.close()
            raise
        again = tuple(self._sent)
        self._sent.clear()
        if again:
            self.write(again)
        return again[-1] if again else None

    def write(self, entries: Sequence[Entry]) -> None:
        """Sends entries; OSError."""
        assert self._socket is not None  # it is open
        self.check()
        for entry in entries:
            data = message(entry, self._host, os.getpid())
            self._socket.sendall(f"{len(data)} ".encode() + data)
            self._sent.append(entry)

    def check(self) -> None:
        """OSError if the server has closed the connection. It sends nothing in this protocol."""
        assert self._socket is not None  # it is open
        self._socket.settimeout(0)
        try:
            while self._socket.recv(1024):
                pass
        except (ssl.SSLWantReadError, BlockingIOError):
            return
        finally:
            self._socket.settimeout(TIMEOUT_S)
        raise ConnectionResetError("the syslog server has closed the connection")

    def close(self) -> None:
        if self._socket is not None:
            with suppress(OSError, ValueError):
                self._socket.settimeout(ENDS_WITHIN_S)
                self._socket.unwrap()  # says that nothing was cut off
            with suppress(OSError):
                self._socket.close()
            self._socket = None
