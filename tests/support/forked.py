"""Kiosk servers forked from one process, see `kiosk_parent`, with the interface of `Popen`."""

import atexit
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import IO, Final

ROOT: Final = Path(__file__).resolve().parent.parent.parent
# Variables that take effect only at the start of a process.
AT_BEGIN: Final = ("LD_", "MALLOC", "PYTHON")
NETWORK: Final = Path("/proc/thread-self/ns/net")  # a test may have moved its thread into another one
OURS: Final = NETWORK.stat().st_ino
APPS: Final = ("app.main:", "tests.support.apps.")
FORKED_TOO: Final = {"PYTHONFAULTHANDLER": "1", "PYTHONPATH": ""}


def can_fork(command: Sequence[str], env: Mapping[str, str], folder: object) -> bool:
    """Whether the command starts this project's server with this Python and no special environment."""
    if list(command[:3]) != [sys.executable, "-m", "uvicorn"] or folder != ROOT:
        return False
    if not command[3].startswith(APPS):
        return False
    if NETWORK.stat().st_ino != OURS or os.environ.get("FAULTS") == "long":
        return False
    special = {name: value for name, value in env.items() if name.startswith(AT_BEGIN)}
    return "--reload" not in command and special.items() <= FORKED_TOO.items()


@cache
def _parent() -> socket.socket:
    """The socket to the parent of all forked servers, which is started on first use."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for one in (ours, theirs):
        one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 18)
    process = subprocess.Popen(
        [sys.executable, "-m", "tests.support.kiosk_parent", str(theirs.fileno())],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": ""},
        pass_fds=[theirs.fileno()],
    )
    theirs.close()

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours


class Forked:
    """A forked server; the subset of `Popen` that the tests use."""

    stdin = stdout = None

    def __init__(self, command: Sequence[str], env: Mapping[str, str]) -> None:
        self.args = command
        self.returncode: int | None = None
        self._lock = threading.Lock()
        stderr, stderr_writer = os.pipe2(os.O_CLOEXEC)
        self._status, status_writer = os.pipe2(os.O_CLOEXEC)
        order = json.dumps({"arguments": list(command[3:]), "env": {**os.environ, **env}})
        socket.send_fds(_parent(), [order.encode()], [stderr_writer, status_writer])
        os.close(stderr_writer)
        os.close(status_writer)
        self.stderr: IO[str] = open(stderr, encoding="utf-8")  # noqa: SIM115 - closed by the reader
        self._text = b""
        self.pid = int(self._line(None) or 0)

    def _line(self, timeout_s: float | None) -> bytes | None:
        """The next line of the status pipe (the pid, then the exit code); None at the timeout."""
        if not select.select([self._status], [], [], timeout_s)[0]:
            return None
        line = bytearray()
        while not line.endswith(b"\n"):
            byte = os.read(self._status, 1)
            assert byte, f"the parent of the kiosks has ended before {self.args!r}"
            line += byte
        return bytes(line)

    def _ended(self, timeout_s: float | None) -> int | None:
        with self._lock:
            if self.returncode is None and (line := self._line(timeout_s)):
                self.returncode = int(line)
                os.close(self._status)
            return self.returncode

    def poll(self) -> int | None:
        return self._ended(0)

    def wait(self, timeout: float | None = None) -> int:
        status = self._ended(timeout)
        if status is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0)
        return status

    def send_signal(self, number: signal.Signals) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)
