"""`operator-panel install`: the panel as services of this machine.

Exit status, of `update` and `uninstall` too: 0 done, 1 it could not be done, 2 a mistake on the command
line, or not confirmed.
"""

import os
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from app.system.errors import SettingsError
from app.tools.cli.parser import USAGE_ERROR, Parser
from app.tools.install.host import Host
from app.tools.install.plan import SCREEN, SERVER, Options, steps
from app.tools.install.release import checked_wheel
from app.tools.install.steps import apply, describe

PROG = "python -m app.cli install"
UMASK: Final = 0o022  # the server's user has to read what root's shell may keep for itself


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    return exit_status(_install, make_parser(prog).parse_args(arguments))


def exit_status(work: Callable[[Namespace], int], options: Namespace) -> int:
    """That of the work; 1 with the sentence if it can't be done."""
    os.umask(UMASK)
    try:
        return work(options)
    except (SettingsError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


def _install(arguments: Namespace) -> int:
    host = Host(arguments.root.resolve())
    options = Options(
        wheel=checked_wheel(arguments.wheel),
        panel=arguments.panel,
        zenoh=arguments.zenoh,
        wheels=arguments.wheels and arguments.wheels.resolve(),
        screen=not arguments.no_screen,
        touch_matrix=tuple(arguments.touch_matrix.split()),
        any_system=arguments.any_system,
        key=arguments.key,
    )
    plan = steps(options, host)
    for line in describe(plan, host):
        print(line)
    if arguments.dry_run:
        return 0
    if not confirmed(arguments):
        return USAGE_ERROR
    print("installed" if apply(plan, host, print_progress) else "everything was done before")
    if host.runs_systemd:
        units = [SERVER, SCREEN] if options.screen else [SERVER]
        print(f"see whether it runs: systemctl status {' '.join(units)}")
    return 0


def confirmed(options: Namespace) -> bool:
    """By --yes or by the user."""
    if options.yes:
        return True
    if not sys.stdin.isatty():
        print("nothing was changed: add --yes to go on without a question", file=sys.stderr)
        return False
    return input("go on? [y/N] ").strip().lower() in ("y", "yes")


def print_progress(text: str) -> None:
    print(text, flush=True)


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Installs the panel as services of this machine: server, compositor, browser. Lists"
        " first what it will do. Can be run again: only what is missing is done.",
    )
    add = parser.add_argument
    add("wheel", nargs="?", type=Path, metavar="WHEEL", help="default: the wheel that this runs from")
    add("--panel", type=Path, metavar="FILE", help="your panel file; default: the installed one")
    add("--zenoh", type=Path, metavar="FILE", help="your Zenoh configuration")
    add(
        "--key",
        type=Path,
        metavar="FILE",
        help="the public key of the releases (minisign.pub): later updates have to be signed with it",
    )
    add("--no-screen", action="store_true", help="the server alone, for browsers elsewhere")
    add("--touch-matrix", default="", metavar="'A B C D E F'", help="libinput's calibration matrix")
    add("--any-system", action="store_true", help="not only Debian 12 and 13 and Ubuntu 24.04")
    add_questions(parser)
    add_root(parser)
    add_wheels(parser)
    return parser


def add_questions(parser: Parser) -> None:
    """--dry-run, --yes."""
    parser.add_argument("--dry-run", action="store_true", help="only list what would be done")
    parser.add_argument("--yes", action="store_true", help="go on without a question")


def add_root(parser: Parser) -> None:
    parser.add_argument(
        "--root",
        type=Path,
        default=Path("/"),
        metavar="FOLDER",
        help="a folder that becomes a machine's file system, such as an image; nothing is started",
    )


def add_wheels(parser: Parser) -> None:
    parser.add_argument(
        "--wheels",
        type=Path,
        metavar="FOLDER",
        help="the wheels of requirements.lock, for a machine without a package index",
    )
