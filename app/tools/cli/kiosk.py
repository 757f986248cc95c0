"""`operator-panel kiosk`: the panel on this machine's screen.

Exit status: 0 it was ended, 1 it could not start, 2 a mistake on the command line.
"""

import asyncio
import logging
import os
import signal
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from app.system.errors import SettingsError
from app.system.process.service import ServiceManager
from app.tools.cli.parser import Parser
from app.tools.kiosk.config import (
    COMPOSITORS,
    DEFAULT_URL,
    ROTATIONS,
    KioskConfig,
    read_config,
    runtime_folder,
)
from app.tools.kiosk.watcher import Watcher

PROG = "python -m app.cli kiosk"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = vars(make_parser(prog).parse_args(arguments))
    file, folder = options.pop("config"), options.pop("folder")
    logging.basicConfig(format="[%(levelname)s] %(message)s", level=logging.INFO)
    try:
        config = read_config(file, **options)
        asyncio.run(_run(config, folder or runtime_folder()))
    except (SettingsError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return 0


async def _run(config: KioskConfig, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    watcher = Watcher(config, folder.resolve(), ServiceManager(), os.environ)
    running = asyncio.ensure_future(watcher.run())
    loop = asyncio.get_running_loop()

    def stop() -> None:
        watcher.stop()
        running.cancel()

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        loop.add_signal_handler(number, stop)
    with suppress(asyncio.CancelledError):
        await running


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Shows the panel on this machine's screen: starts a compositor and the browser,"
        " looks at the page once a second, and restarts what hangs.",
        epilog="Options go before the keys of the file: see docs/how-to/kiosk.md.",
    )
    add = parser.add_argument
    add(
        "--config",
        type=Path,
        metavar="FILE",
        help="such as /etc/operator-panel/kiosk.toml",
    )
    add("--url", help=f"address of the server on this machine; default: {DEFAULT_URL}")
    add("--panel", metavar="FILE", help="the panel file: its languages are those of the waiting page")
    add("--compositor", choices=COMPOSITORS, help="none: in the session that there is; default: sway")
    add("--browser", metavar="PROGRAM", help="default: the Chromium or Chrome that is installed")
    add("--flag", action="append", dest="flags", metavar="FLAG", help="a further flag of the browser")
    add("--rotate", type=int, choices=ROTATIONS, help="clockwise; default: 0")
    add("--folder", type=Path, metavar="FOLDER", help="for the profile, in memory; default: the unit's")
    return parser
