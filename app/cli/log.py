"""`operator-panel log verify [--data FOLDER] [--head HASH]`: was the operator's log changed?

Exit status: 0 it was not, 1 an entry was changed, removed, reordered or inserted, 2 it can't be read.
"""

import sys
from collections.abc import Sequence
from pathlib import Path

from app.audit.verify import verify
from app.cli.parser import Parser
from app.errors import KioskError
from app.settings import Settings

PROG = "python -m app.log"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        verification = verify(options.data or _usual_folder(), options.head)
    except KioskError as error:
        print(f"the operator's log can't be read: {error}", file=sys.stderr)
        return 2
    if verification.fault:
        print(f"the log was changed: {verification.fault} ({verification.count} entries verified)")
        return 1
    print(f"ok, {verification.count} entries, head {verification.head}")
    return 0


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
    check.add_argument(
        "--data", type=Path, metavar="FOLDER", help="where the log is; default: KIOSK_DATA's folder"
    )
    check.add_argument(
        "--head",
        default="",
        metavar="HASH",
        help="a hash saved earlier; the check fails if the log no longer contains it",
    )
    return parser
