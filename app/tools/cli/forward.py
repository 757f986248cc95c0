"""`operator-panel forward`: what the cell has for the plant's central database, sent once, or
checked.

A server with `KIOSK_FORWARD` sends by itself. Exit status: 0 done, 1 something is not sent or not
right, 2 a mistake on the command line or in the settings.
"""

import sys
import time
from argparse import Namespace
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from app.cell.forward.config import ForwardConfig, read_forward
from app.system.errors import KioskError, LogError, SettingsError
from app.system.settings import Settings
from app.tools.cli.arguments import add_data_folder, data_folder
from app.tools.cli.parser import Parser

if TYPE_CHECKING:
    from app.cell.forward.status import ForwardStatus

PROG: Final = "python -m app.cli forward"
CLOCKS_APART_S: Final = 5.0


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        config, folder = read_forward(settings_file(options)), data_folder(options)
    except SettingsError as error:
        print(error, file=sys.stderr)
        return 2
    try:
        return _send(config, folder) if options.once else _check(config, folder)
    except KioskError as error:
        print(error, file=sys.stderr)
        return 1


def settings_file(options: Namespace) -> Path:
    """The file of `--settings`, else of `KIOSK_FORWARD`; SettingsError without either."""
    file: Path | None = options.settings or Settings.from_environment().forward
    if file is None:
        raise SettingsError("there is no settings' file: name it with KIOSK_FORWARD or --settings")
    return file


def _send(config: ForwardConfig, folder: Path) -> int:
    from app.cell.forward.forwarder import send_all

    status = send_all(config, folder)
    if status.fault:
        print(f"not sent: {status.fault} ({_backlog(status)})", file=sys.stderr)
        return 1
    if status.note:
        print(f"note: {status.note}", file=sys.stderr)
    print(f"{status.sent} rows sent to {status.address}; {_backlog(status)}")
    return 0


def _backlog(status: "ForwardStatus") -> str:
    if not status.rows:
        return "nothing is left"
    age_s = status.lag_s(time.time())
    return f"{status.rows} rows are left, about {status.size} bytes, the oldest {age_s:.0f} s old"


def _check(config: ForwardConfig, folder: Path) -> int:
    for line in _checks(config, folder):
        print(line)
    return 0


def _checks(config: ForwardConfig, folder: Path) -> Iterator[str]:
    """What is right, line by line; KioskError for the first thing that is not."""
    from app.cell.forward.centre import Centre
    from app.cell.forward.streams import STREAMS
    from app.records.log_key import load_key

    key = load_key(folder)
    if key is None:
        raise LogError(f"there is no key in {folder}: the server makes it at its first start")
    centre = Centre(config.connection)
    try:
        yield f"ok: connected to {config.connection.address}"
        if not config.connection.is_encrypted:
            mode = config.connection.keys["sslmode"]
            yield f"note: sslmode={mode}: the server is not checked by its name"
        ahead_s = time.time() - centre.clock().timestamp()
        if abs(ahead_s) > CLOCKS_APART_S:
            yield f"note: this machine's clock is {ahead_s:+.0f} s from the server's"
        centre.register(config.panel, config.site, key.public)
        yield f'ok: "{config.panel}" may write, with the key {key.public}'
        positions = centre.positions()
        for name in config.streams:
            last, at = STREAMS[name].ends(folder)[1], positions.get(name)
            yield f"ok: {name}: row {last} here, row {at.seq if at else 0} there"
    finally:
        centre.close()


def add_settings_file(parser: Parser) -> None:
    """--settings."""
    parser.add_argument(
        "--settings",
        type=Path,
        metavar="FILE",
        help="the file with the connection; default: that of KIOSK_FORWARD",
    )


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Sends what this cell keeps to the plant's central database (PostgreSQL).",
        epilog="A server that was started with KIOSK_FORWARD sends by itself.",
    )
    work = parser.add_mutually_exclusive_group(required=True)
    work.add_argument("--once", action="store_true", help="send all that is not sent yet, and end")
    work.add_argument(
        "--check", action="store_true", help="connect, and say what is not right; nothing is sent"
    )
    add_settings_file(parser)
    add_data_folder(parser)
    return parser
