"""`operator-panel prove [PANEL]`: whether each control is locked when it has to be, on the simulated
robot; with `--live` on a real one, with a person who watches.

Exit status: 0 every case holds, 1 some do not, 2 the panel can't be used, 3 a live proof was stopped.
"""

import json
import math
import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from contextlib import closing, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from app.system.errors import KioskError
from app.system.settings import Settings, panel_path
from app.tools.cli.arguments import add_kiosk, kiosk_token
from app.tools.cli.parser import Parser

if TYPE_CHECKING:
    from app.tools.prove.report import Subject
    from app.tools.prove.result import Proof, Result

PROG: Final = "python -m app.cli prove"
HOLDS, FAULTS, UNUSABLE, STOPPED = range(4)
ANSWERS: Final = ".proof-live.json"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        return _prove(options)
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return UNUSABLE


def _prove(options: Namespace) -> int:
    """Imported here: the help needs no server."""
    from app.tools.prove.report import subject_of

    subject = subject_of(options.panel or Settings.from_environment().panel)
    proof = _watched(options, subject) if options.live else _simulated(options, subject)
    _report(options, subject, proof)
    if proof.missing:
        return STOPPED
    return HOLDS if proof.holds else FAULTS


def _simulated(options: Namespace, subject: "Subject") -> "Proof":
    from app.tools.prove.cases import MOST_WAITED_S
    from app.tools.prove.proof import prove

    shows = sys.stderr.isatty()

    def show(result: "Result") -> None:
        if shows:
            print("✗" if result.fault else "·", end="", file=sys.stderr, flush=True)

    longest_s = math.inf if options.patient else MOST_WAITED_S
    proof = prove(subject.panel, show, with_browser=not options.no_browser, longest_s=longest_s)
    if shows:
        print(file=sys.stderr)
    return proof


def _watched(options: Namespace, subject: "Subject") -> "Proof":
    """The live proof, as far as it goes: Ctrl-C, the end of the input and the key q stop it."""
    from app.tools.prove.answers import AnswersFile
    from app.tools.prove.live import LiveProof, watched_robots, watcher_name
    from app.tools.prove.terminal import Terminal

    token = kiosk_token(options)
    path = options.state or subject.path.with_suffix(ANSWERS)
    with (
        watched_robots(options.live, token, options.trust, subject.panel) as robots,
        closing(AnswersFile(path, subject.path.name, subject.sha256)) as answers,
        Terminal(out=sys.stderr if options.json else sys.stdout) as terminal,
    ):
        if answers.aside is not None:
            terminal.say(
                f"The answers so far are of another panel file: each case begins again. They are in"
                f" {answers.aside}."
            )
        live = LiveProof(robots, answers, terminal, watcher_name(options.by, terminal))
        with suppress(EOFError, KeyboardInterrupt):
            live.run()
        proof = live.proof()
        proof.server = options.live
        if proof.missing:
            terminal.say(f"\nStopped. The same command continues; the answers are in {path}.")
        return proof


def _report(options: Namespace, subject: "Subject", proof: "Proof") -> None:
    from app.records.log_key import load_or_make_key
    from app.tools.cli.output import draft_of
    from app.tools.prove.report import as_html, as_json, as_text, signed

    key = None
    if options.sign:
        own = {"KIOSK_DATA": options.data} if options.data else {}
        settings = Settings.from_environment({**os.environ, **own})
        folder = settings.data or settings.data_folder(subject.panel.mode)
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        key = load_or_make_key(folder)
    report = signed(as_json(subject, proof), key)
    if options.report is not None:
        with draft_of(options.report, force=True) as draft:
            draft.write_text(as_html(report), encoding="utf-8")
    if options.json:
        print(json.dumps(report, indent=2, ensure_ascii=False))
    else:
        print(as_text(proof))


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Proves a panel on its simulated robot: tries each control in each situation of its"
        " interlocks, each end of a hold, and each alarm. Nothing reaches a real robot. With --live a"
        " person tries the same at a real robot, step by step; the command only watches its panel.",
        epilog="Exit status: 0 every case holds, 1 some do not, 2 the panel can't be used, 3 a live"
        " proof was stopped: the same command continues it.",
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
    add(
        "--patient",
        action="store_true",
        help="also try alarms that take longer than 30 s, one after another, as long as they take",
    )
    add("--live", default="", metavar="URL", help="the running panel of a real robot")
    add("--by", default="", metavar="NAME", help="who watches a live proof; else it is asked")
    add(
        "--state",
        type=Path,
        metavar="FILE",
        help=f"where the answers of a live proof are kept (PANEL{ANSWERS})",
    )
    add_kiosk(parser)
    add("--data", metavar="FOLDER", help="the data folder (KIOSK_DATA), which has the key of --sign")
    add(
        "panel",
        nargs="?",
        type=panel_path,
        metavar="PANEL",
        help="a panel file; without any, the one of KIOSK_PANEL or else the shipped one",
    )
    return parser
