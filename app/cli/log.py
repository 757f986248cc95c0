"""`operator-panel log`: the operator's log of a server, also while it runs.

`log verify`: exit status 0 nothing was changed, 1 an entry was changed, removed, reordered or inserted,
2 the log can't be read. `log panel`: 1 if the log or the kept files have no answer, 0 and 2 as above.
"""

import sys
import time
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from app.audit.verify import verify
from app.cli.parser import Parser
from app.errors import KioskError, LogError
from app.settings import Settings

if TYPE_CHECKING:
    from app.audit.shown_panel import Run

PROG = "python -m app.log"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        status: int = options.run(options)
    except KioskError as error:
        print(f"the operator's log can't be read: {error}", file=sys.stderr)
        return 2
    return status


def _verify(options: Namespace) -> int:
    verification = verify(options.data or _usual_folder(), options.head)
    if verification.fault:
        print(f"the log was changed: {verification.fault} ({verification.count} entries verified)")
        return 1
    print(f"ok, {verification.count} entries, head {verification.head}")
    return 0


def _panel(options: Namespace) -> int:
    """Prints the panel file that was shown at a time, or writes it and all of its files."""
    from app.audit.shown_panel import read_panel, runs, shown_at

    folder = options.data or _usual_folder()
    starts = runs(folder)
    now = time.time_ns() // 1_000_000
    try:
        shown = shown_at(starts, now if options.at is None else options.at, now)
        began = datetime.fromtimestamp(shown.run.at / 1000).astimezone().isoformat(timespec="seconds")
        print(f"entry {shown.run.seq}: the server started at {began}", file=sys.stderr)
        for doubt in shown.doubts:
            print(f"note: {doubt}", file=sys.stderr)
        if options.to is not None:
            return _write_files(folder, shown.run, options.to)
        sys.stdout.buffer.write(read_panel(folder, shown.run))
    except LogError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _write_files(folder: Path, run: "Run", to: Path) -> int:
    from app.audit.shown_panel import read_files

    missing = 0
    try:
        for name, data in read_files(folder, run):
            if isinstance(data, LogError):
                print(data, file=sys.stderr)
                missing += 1
                continue
            path = to / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    except OSError as error:
        print(f"{error.filename} can't be written: {error.strerror}", file=sys.stderr)
        return 1
    print(f"written to {to}", file=sys.stderr)
    return 1 if missing else 0


def _time(text: str) -> int:
    """Milliseconds since 1970; of two times that the clock shows twice, the first."""
    try:
        return int(datetime.fromisoformat(text).timestamp() * 1000)
    except (ValueError, OverflowError, OSError):
        raise ArgumentTypeError(f'"{text}" is not a time, like 2027-01-20T10:00') from None


def _usual_folder() -> Path:
    """That of a server that was started with these settings."""
    settings = Settings.from_environment()
    if settings.data is not None:  # a panel file with a fault does not matter then
        return settings.data
    from app.panel import load_panel  # takes half of the command's time, and is seldom needed

    return settings.data_folder(settings.mode or load_panel(settings.panel).mode)


def make_parser(prog: str) -> Parser:
    parser = Parser(prog=prog, description="The operator's log.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    check = commands.add_parser("verify", help="check that no entry was changed")
    check.set_defaults(run=_verify)
    _add_data(check)
    check.add_argument(
        "--head",
        default="",
        metavar="HASH",
        help="a hash saved earlier; the check fails if the log no longer contains it",
    )
    panel = commands.add_parser("panel", help="print the panel file that was shown at a time")
    panel.set_defaults(run=_panel)
    _add_data(panel)
    panel.add_argument(
        "--at",
        type=_time,
        metavar="TIME",
        help="like 2027-01-20T10:00, in this machine's zone if it has none; default: now",
    )
    panel.add_argument(
        "--to",
        type=Path,
        metavar="FOLDER",
        help="write the panel file and all files that it used into this folder",
    )
    return parser


def _add_data(parser: ArgumentParser) -> None:
    parser.add_argument(
        "--data", type=Path, metavar="FOLDER", help="where the log is; default: KIOSK_DATA's folder"
    )
