"""A process that imports the server's libraries once, and forks kiosk servers: importing them takes a
second per server. Message types, the panel's models and templates are prepared once, too.

Run as `python -m tests.support.kiosk_parent FD` in the project's folder. FD is a socket: each message
is an order in JSON with two files, the server's stderr and a pipe for its pid and then its exit code.
The process ends when the other end is closed.
"""

import ast
import faulthandler
import json
import os
import runpy
import select
import shutil
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from functools import partialmethod
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from jinja2 import Environment, FileSystemBytecodeCache

from app.panel import load_panel

MAIN: Final = Path("app/main.py")
PANEL: Final = Path("app/panel.toml")
UVICORN: Final = (
    "main",
    "lifespan.on",
    "loops.auto",
    "protocols.http.auto",
    "protocols.websockets.auto",
)
LATER: Final = (  # imported when a server starts, not by `app.main`
    "app.simulator.panel_robot",
    "app.simulator.zenoh_peer",
    "app.trends.recorder",
    "babel.dates",
    "babel.messages.pofile",
    "encodings.idna",
    "fastapi.telemetry._runtime",
    "uvloop",
)
LONGEST: Final = 1 << 18


def read_libraries() -> dict[str, str]:
    """Imports everything that `app.main` imports, but not `app.main`; returns the environment variables
    that the imports set."""
    before = dict(os.environ)
    for name in UVICORN:
        import_module(f"uvicorn.{name}")
    for statement in ast.parse(MAIN.read_text()).body:
        if isinstance(statement, ast.Import):
            for module in statement.names:
                import_module(module.name)
        elif isinstance(statement, ast.ImportFrom) and statement.module is not None:
            package = import_module(str(statement.module))
            for part in statement.names:
                if not hasattr(package, part.name):
                    import_module(f"{statement.module}.{part.name}")
    for name in LATER:
        import_module(name)
    assert len(list(Path("/proc/self/task").iterdir())) == threading.active_count() == 1
    return {name: value for name, value in os.environ.items() if before.get(name) != value}


def prepare(templates: str) -> None:
    """Loads the message types and builds a panel's models. The first server compiles the templates into
    the folder `templates`, the others read them from there."""
    load_panel(PANEL)
    keep = partialmethod(Environment.__init__, bytecode_cache=FileSystemBytecodeCache(templates))
    setattr(Environment, "__init__", keep)  # noqa: B010 - mypy takes no assignment to a method


class Parent:
    """Forks servers, and reports their exit codes."""

    def __init__(self, orders: socket.socket) -> None:
        self._orders = orders
        self._added = read_libraries()
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
                text, files, _, _ = socket.recv_fds(self._orders, LONGEST, 2)
                if not text:
                    return
                self._begin(json.loads(text), *files)

    def _reap(self) -> None:
        while self._status:
            pid, status = os.waitpid(-1, os.WNOHANG)
            if not pid:
                return
            pipe = self._status.pop(pid)
            os.write(pipe, f"{os.waitstatus_to_exitcode(status)}\n".encode())
            os.close(pipe)

    def _begin(self, order: Mapping[str, Any], stderr: int, status: int) -> None:
        pid = os.fork()
        if pid:
            self._status[pid] = status
            os.write(status, f"{pid}\n".encode())
            os.close(stderr)
            return
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        self._orders.close()
        for file in (status, self._woken, self._wakes, *self._status.values()):
            os.close(file)
        os.dup2(stderr, 2)
        os.close(stderr)
        os.environ.clear()
        os.environ.update({**self._added, **order["env"]})
        become(order["arguments"])


def become(arguments: list[str]) -> None:
    """Continues as `python -m uvicorn ARGUMENTS` in this folder."""
    time.tzset()
    if os.environ.get("PYTHONFAULTHANDLER"):
        faulthandler.enable()
    sys.argv = ["uvicorn", *arguments]
    runpy.run_module("uvicorn", run_name="__main__", alter_sys=True)
    sys.exit(0)


if __name__ == "__main__":
    parent = Parent(socket.socket(fileno=int(sys.argv[1])))
    compiled = tempfile.mkdtemp(prefix="templates-")
    prepare(compiled)
    parent.run()  # in a forked server, it ends by SystemExit
    shutil.rmtree(compiled)
