"""`operator-panel prove [PANEL]`: whether each control is locked when it has to be, on the simulated
robot.

Exit status: 0 every case holds, 1 some do not, 2 the panel can't be used.
"""

import json
import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from app.panel import load_panel
from app.system.errors import KioskError
from app.system.settings import Settings, panel_path
from app.tools.cli.parser import Parser

PROG: Final = "python -m app.cli prove"
HOLDS, FAULTS, UNUSABLE = range(3)


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        return _prove(options)
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return UNUSABLE


def _prove(options: Namespace) -> int:
    """Imported here: the help needs no server."""
    from app.records.log_key import load_or_make_key
    from app.tools.prove.proof import Result, prove
    from app.tools.prove.report import Subject, as_html, as_json, as_text, signed

    path = options.panel or Settings.from_environment().panel
    panel = load_panel(path)
    shows = sys.stderr.isatty()

    def show(result: Result) -> None:
        if shows:
            print("✗" if result.fault else "·", end="", file=sys.stderr, flush=True)

    proof = prove(panel, show, with_browser=not options.no_browser)
    if shows:
        print(file=sys.stderr)
    key = None
    if options.sign:
        own = {"KIOSK_DATA": options.data} if options.data else {}
        settings = Settings.from_environment({**os.environ, **own})
        folder = settings.data or settings.data_folder(panel.mode)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        key = load_or_make_key(folder)
    report = signed(as_json(Subject(path, panel, datetime.now(UTC)), proof), key)
    if options.report is not None:
        options.report.write_text(as_html(report), encoding="utf-8")
    if options.json:
        print(json.dumps(report, indent=2, ensure_ascii=False))
    else:
        print(as_text(proof))
    return HOLDS if proof.holds else FAULTS


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Proves a panel on its simulated robot: tries each control in each situation of its"
        " interlocks, each end of a hold, and each alarm. Nothing reaches a real robot.",
        epilog="Exit status: 0 every case holds, 1 some do not, 2 the panel can't be used.",
    )
    add = parser.add_argument
    add("--json", action="store_true", help="print the report as JSON")
    add("--report", type=Path, metavar="FILE", help="write the report as a page for the technical file")
    add(
        "--sign",
        action="store_true",
        help="sign the report with the key of the operator's log in the data folder",
    )
    add("--no-browser", action="store_true", help="do not look at the pages in Chromium")
    add("--data", metavar="FOLDER", help="the data folder (KIOSK_DATA), which has the key of --sign")
    add(
        "panel",
        nargs="?",
        type=panel_path,
        metavar="PANEL",
        help="a panel file; without any, the one of KIOSK_PANEL or else the shipped one",
    )
    return parser
