"""A process that has imported the libraries of many short-lived processes, and forks these on order.

Imports only the standard library, because ROS 2's Python runs it too.

Orders come on a socket: each message is an order in JSON, `{"arguments": […], "env": {…}}`, with four
files: the child's stdin, stdout and stderr, and a pipe for its pid and then its exit code. The process
ends when the other end is closed.
"""

import json
import os
import select
import signal
import socket
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

LONGEST: Final = 1 << 18  # bytes of an order
STANDARD: Final = (0, 1, 2)


class ForkParent:
    """Forks children, and reports their exit codes. `begin` is called in the child with the order's
    arguments and raises SystemExit at its end. `added` are variables that imports have set."""

    def __init__(
        self, orders: socket.socket, begin: Callable[[list[str]], None], added: Mapping[str, str]
    ) -> None:
        assert len(list(Path("/proc/self/task").iterdir())) == threading.active_count() == 1
        self._orders = orders
        self._begin = begin
        self._added = added
        self._status: dict[int, int] = {}  # status pipe by pid
        self._woken, self._wakes = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests may run under nohup
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.set_wakeup_fd(self._wakes, warn_on_full_buffer=False)

    def run(self) -> None:
        while True:
            ready, _, _ = select.select([self._orders.fileno(), self._woken], [], [])
            if self._woken in ready:
                os.read(self._woken, 4096)
            self._reap()
            if self._orders.fileno() in ready:
                text, files, _, _ = socket.recv_fds(self._orders, LONGEST, 4)
                if not text:
                    return
                self._fork(json.loads(text), files[:3], files[3])

    def _reap(self) -> None:
        while self._status:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                return
            pipe = self._status.pop(pid)
            os.write(pipe, f"{os.waitstatus_to_exitcode(status)}\n".encode())
            os.close(pipe)

    def _fork(self, order: Mapping[str, Any], standard: list[int], status: int) -> None:
        pid = os.fork()
        if pid:
            self._status[pid] = status
            os.write(status, f"{pid}\n".encode())
            for file in standard:
                os.close(file)
            return
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        self._orders.close()
        for file in (status, self._woken, self._wakes, *self._status.values()):
            os.close(file)
        for file, place in zip(standard, STANDARD, strict=True):
            os.dup2(file, place)
            os.close(file)
        os.environ.clear()
        os.environ.update({**self._added, **order["env"]})
        self._begin(order["arguments"])
