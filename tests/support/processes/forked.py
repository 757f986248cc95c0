"""Processes forked from a process with the imported libraries, with the interface of `Popen`: servers,
see `kiosk_parent`, and ROS 2 nodes, see `ros_parent`."""

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
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import IO, Final, Literal

ROOT: Final = Path(__file__).resolve().parents[3]
KIOSK_PARENT: Final = "tests.support.processes.kiosk_parent"
ROS_PARENT: Final = "tests.support.processes.ros_parent"
# Variables that take effect only at the start of a process.
AT_BEGIN: Final = ("LD_", "MALLOC", "PYTHON")
NETWORK: Final = Path("/proc/thread-self/ns/net")  # a test may have moved its thread into another one
OURS: Final = NETWORK.stat().st_ino
APPS: Final = ("app.main:", "tests.support.apps.")
FORKED_TOO: Final = {"PYTHONFAULTHANDLER": "1", "PYTHONPATH": ""}


def as_here() -> bool:
    """Whether a child of an existing parent equals a process that is started here and now."""
    return NETWORK.stat().st_ino == OURS and os.environ.get("FAULTS") != "long"


def can_fork(command: Sequence[str], env: Mapping[str, str], folder: object) -> bool:
    """Whether the command starts this project's server with this Python and no special environment."""
    if list(command[:3]) != [sys.executable, "-m", "uvicorn"] or folder != ROOT:
        return False
    special = {name: value for name, value in env.items() if name.startswith(AT_BEGIN)}
    ordinary = "--reload" not in command and special.items() <= FORKED_TOO.items()
    return as_here() and ordinary and command[3].startswith(APPS)


@cache
def _parent(python: str, module: str) -> socket.socket:
    """The socket to a parent of forked processes, which is started on first use."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for sock in (ours, theirs):
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 18)
    process = subprocess.Popen(
        [python, "-m", module, str(theirs.fileno())],
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
    """A forked process; the subset of `Popen` that the tests use. `piped` are those of the standard
    streams that are pipes to here, the others are those of this process."""

    def __init__(
        self,
        parent: socket.socket,
        arguments: Sequence[str],
        env: Mapping[str, str],
        piped: Sequence[Literal["stdin", "stdout", "stderr"]],
    ) -> None:
        self.args = arguments
        self.returncode: int | None = None
        self._lock = threading.Lock()
        files = {"stdin": 0, "stdout": 1, "stderr": 2}
        streams: dict[str, IO[str]] = {}
        for name in piped:
            read, write = os.pipe2(os.O_CLOEXEC)
            ours, files[name] = (write, read) if name == "stdin" else (read, write)
            mode = "w" if name == "stdin" else "r"
            streams[name] = os.fdopen(ours, mode, encoding="utf-8")  # closed by who reads or writes
        self.stdin, self.stdout, self.stderr = map(streams.get, files)
        self._status, files["status"] = os.pipe2(os.O_CLOEXEC)
        order = json.dumps({"arguments": list(arguments), "env": dict(env)})
        socket.send_fds(parent, [order.encode()], list(files.values()))
        for theirs in (*piped, "status"):
            os.close(files[theirs])
        self.pid = int(self._line(None) or 0)

    @classmethod
    def server(cls, command: Sequence[str], env: Mapping[str, str]) -> "Forked":
        """A server whose stderr is read."""
        parent = _parent(sys.executable, KIOSK_PARENT)
        return cls(parent, [str(ROOT), *command[2:]], {**os.environ, **env}, ["stderr"])

    @classmethod
    def command(cls, folder: Path, words: Sequence[str], env: Mapping[str, str]) -> "Forked":
        """`python -m WORDS` in a folder, with one of the project's modules; its output is read."""
        parent = _parent(sys.executable, KIOSK_PARENT)
        return cls(parent, [str(folder), *words], env, ["stdout", "stderr"])

    @classmethod
    def ros_program(cls, command: Sequence[str], env: Mapping[str, str]) -> "Forked":
        """A program of `tests/ros_nodes` that is controlled by stdin and stdout."""
        return cls(_parent(command[0], ROS_PARENT), command[1:], env, ["stdin", "stdout"])

    def _line(self, timeout_s: float | None) -> bytes | None:
        """The next line of the status pipe (the pid, then the exit code); None at the timeout."""
        if not select.select([self._status], [], [], timeout_s)[0]:
            return None
        line = bytearray()
        while not line.endswith(b"\n"):
            byte = os.read(self._status, 1)
            assert byte, f"the parent has ended before {self.args!r}"
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
            with suppress(ProcessLookupError):  # it has ended, and its parent is about to report it
                os.kill(self.pid, number)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)
