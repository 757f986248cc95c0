"""`operator-panel check [PANEL …]`: every fault of panel files, with its place.

Exit status, of the worst file: 0 good, 1 faults, 2 unreadable.
"""

import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from app.panel import Panel, check_panel
from app.system.errors import KioskError, PanelError
from app.system.settings import Settings, panel_path, shipped_path
from app.tools.cli.parser import Parser

PROG = "python -m app.check"
GOOD, FAULTY, UNREADABLE = range(3)
LOG: Final = "operators-log.sqlite3"  # in the data folder


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        paths = options.panel or [Settings.from_environment().panel]
    except KioskError as error:
        print(error, file=sys.stderr)
        return UNREADABLE
    if not options.panel and paths == [shipped_path("panel.toml")]:
        print("no panel file is named, so the shipped one is checked", file=sys.stderr, flush=True)
    return max(print_check(path, options.verbose) for path in paths)


def print_check(path: Path, verbose: bool = False) -> int:
    """Prints the faults or notes of one panel file; its exit status."""
    try:
        result = check_panel(path)
    except PanelError as error:
        print(error, file=sys.stderr, flush=True)
        return UNREADABLE if error.unreadable else FAULTY
    lines = [_summary(path, result.panel), *map(str, result.notes), *_room_notes(path, result.panel)]
    if verbose:
        lines += [line for remark in result.previews for line in str(remark).splitlines()]
    print("\n  ".join(lines), flush=True)
    return GOOD


def _room_notes(path: Path, panel: Panel) -> Iterator[str]:
    """That the operator's log of this machine, if it has one, is short of room for the panel's days."""
    try:
        settings = Settings.from_environment({**os.environ, "KIOSK_PANEL": str(path)})
        folder = settings.data_folder(settings.mode or panel.mode)
        if not (folder / LOG).exists():
            return
    except (KioskError, OSError):
        return
    from app.tools.doctor.findings import Report
    from app.tools.doctor.machine import check_log_room

    report = Report()
    check_log_room(report, folder, panel)
    yield from (f"log: {finding.sentence} {finding.do} ({folder})" for finding in report.findings)


def _summary(path: Path, panel: Panel) -> str:
    widgets = sum(1 for _ in panel.widgets())
    robots = f"{len(panel.robots)} robot(s), " if panel.robots else ""
    summary = f'"{panel.title}", {robots}{len(panel.pages)} page(s), {widgets} widget(s)'
    return f"{path}: good: {summary}"


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Lists every fault of panel files, with its place and what would be right.",
        epilog="Exit status, of the worst file: 0 good (notes are no faults), 1 faults, 2 unreadable.",
    )
    parser.add_argument(
        "-v", "--verbose", action="store_true", help="print the whole message that each press will send"
    )
    parser.add_argument(
        "panel",
        nargs="*",
        type=panel_path,
        metavar="PANEL",
        help="a panel file; without any, the one of KIOSK_PANEL or else the shipped one",
    )
    return parser
