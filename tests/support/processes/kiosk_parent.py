"""A process that imports the server's libraries once, and forks servers and commands: importing
them takes a second per server. Message types, the panel's models and templates are prepared once, too.

Run as `python -m tests.support.processes.kiosk_parent FD` in the project's folder, see `fork_parent`. A
child's arguments are its folder, a module, and the arguments of that.
"""

import ast
import faulthandler
import gc
import os
import runpy
import shutil
import socket
import sys
import tempfile
import time
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Final

from jinja2 import Environment, FileSystemBytecodeCache

from app.panel import load_panel
from app.tools.cli.command import COMMANDS
from app.web.pages import page_templates
from tests.support.operator_log import wait_for_the_disk
from tests.support.processes.fork_parent import ForkParent

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
    "app.tools.simulator.panel_robot",
    "app.tools.simulator.zenoh",
    "app.cell.history.trends",
    "babel.dates",
    "babel.messages.pofile",
    "encodings.idna",
    "fastapi.telemetry._runtime",
    "uvloop",
)


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
    for command in COMMANDS.values():
        command.load()
    return {name: value for name, value in os.environ.items() if before.get(name) != value}


def prepare(templates: str) -> None:
    """Loads the message types and builds a panel's models. The first server compiles the templates into
    the folder `templates`, the others read them from there."""
    load_panel(PANEL)
    wait_for_the_disk()
    keeping = partial(Environment, bytecode_cache=FileSystemBytecodeCache(templates))
    vars(page_templates)["Environment"] = keeping


def bear_standstills() -> None:
    """Tolerates stalls: beside other tests a server or a bridge may stall for a second, which locks
    nothing here and refuses no press. A test of stalls starts its server with `EXACT_LIVENESS=1`."""
    from app.cell.link import bridge, liveness

    vars(liveness).update(STALLED_S=10.0, SILENT_S=4.0, LONGEST_S=10.0)
    vars(bridge)["WITHIN_S"] = 10.0
    vars(liveness)["LIMIT_S"] = 15.0


def become(arguments: list[str]) -> None:
    """Continues as `python -m MODULE …` in a folder."""
    folder, module, *_ = arguments
    if not os.environ.get("EXACT_LIVENESS"):
        bear_standstills()
    os.chdir(folder)
    time.tzset()
    if os.environ.get("PYTHONFAULTHANDLER"):
        faulthandler.enable()
    sys.argv = arguments[1:]
    runpy.run_module(module, run_name="__main__", alter_sys=True)
    sys.exit(0)


if __name__ == "__main__":
    parent = ForkParent(socket.socket(fileno=int(sys.argv[1])), become, read_libraries())
    compiled = tempfile.mkdtemp(prefix="templates-")
    prepare(compiled)
    gc.freeze()  # a child does not scan these objects at its end: it would take 0.3 s
    parent.run()  # in a forked server, it ends by SystemExit
    shutil.rmtree(compiled, ignore_errors=True)
