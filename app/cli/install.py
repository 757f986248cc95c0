"""`operator-panel install | uninstall | update`: the panel as services of this machine.

Exit status: 0 done, 1 it could not be done, 2 a mistake on the command line, or not confirmed.
"""

import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path

from app.cli.parser import USAGE_ERROR, Parser
from app.errors import SettingsError
from app.install.assets import checked_wheel
from app.install.host import Host
from app.install.plan import Options, steps, uninstall_steps
from app.install.step import Step, apply, describe, revert
from app.install.update import URL, SystemdServices, Updater

PROG = "python -m app.cli"


def install(arguments: Sequence[str], prog: str = f"{PROG} install") -> int:
    return _run(_install, _parser(prog), arguments)


def uninstall(arguments: Sequence[str], prog: str = f"{PROG} uninstall") -> int:
    return _run(_uninstall, _uninstall_parser(prog), arguments)


def update(arguments: Sequence[str], prog: str = f"{PROG} update") -> int:
    parser = _update_parser(prog)
    return _run(lambda given: _update(parser, given), parser, arguments)


def _run(what: Callable[[Namespace], int], parser: Parser, arguments: Sequence[str]) -> int:
    try:
        return what(parser.parse_args(arguments))
    except (SettingsError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


def _install(given: Namespace) -> int:
    host = Host(given.root.resolve())
    options = Options(
        wheel=checked_wheel(given.wheel),
        panel=given.panel,
        zenoh=given.zenoh,
        wheels=given.wheels and given.wheels.resolve(),
        screen=not given.no_screen,
        touch_matrix=tuple(given.touch_matrix.split()),
        any_system=given.any_system,
    )
    plan = steps(options, host)
    for line in describe(plan, host):
        print(line)
    if given.dry_run:
        return 0
    if not _confirmed(given, plan, host):
        return USAGE_ERROR
    print("installed" if apply(plan, host, _say) else "everything was done before")
    return 0


def _uninstall(given: Namespace) -> int:
    host = Host(given.root.resolve())
    plan = uninstall_steps(host)
    print("stops and removes the services, the releases, and the browser's user")
    print("keeps /etc/operator-panel, /var/lib/operator-panel (the operator's log) and the packages")
    if given.dry_run:
        return 0
    if not _confirmed(given, plan, host):
        return USAGE_ERROR
    revert(plan, host, _say)
    return 0


def _update(parser: Parser, given: Namespace) -> int:
    if given.back and given.wheel is not None:
        parser.error("either a wheel or --back")
    host = Host(given.root.resolve())
    url = given.url if host.runs_systemd else None
    updater = Updater(host=host, services=SystemdServices(host), url=url, say=_say)
    if given.back:
        updater.back()
    else:
        updater.update(checked_wheel(given.wheel), given.wheels and given.wheels.resolve())
    return 0


def _confirmed(given: Namespace, plan: Sequence[Step], host: Host) -> bool:
    if given.yes:
        return True
    if not sys.stdin.isatty():
        print("nothing was changed: add --yes to go on without a question", file=sys.stderr)
        return False
    return input("go on? [y/N] ").strip().lower() in ("y", "yes")


def _say(text: str) -> None:
    print(text, flush=True)


def _parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Installs the panel as services of this machine: server, compositor, browser. Says"
        " first what it will do. Can be run again: only what is missing is done.",
    )
    add = parser.add_argument
    add("wheel", nargs="?", type=Path, metavar="WHEEL", help="default: the wheel that this runs from")
    add("--panel", type=Path, metavar="FILE", help="your panel file; default: the one that is there")
    add("--zenoh", type=Path, metavar="FILE", help="your Zenoh configuration")
    add("--no-screen", action="store_true", help="the server alone, for browsers elsewhere")
    add("--touch-matrix", default="", metavar="'A B C D E F'", help="libinput's calibration matrix")
    add("--any-system", action="store_true", help="not only Debian 12 and 13 and Ubuntu 24.04")
    _add_common(parser)
    _add_wheels(parser)
    return parser


def _uninstall_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Takes back what install did. Panel file, settings and the operator's log stay.",
    )
    _add_common(parser)
    return parser


def _update_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Installs another version beside the one that runs, and starts it. If its server or"
        " page does not come up within a minute, the version of before runs again.",
    )
    parser.add_argument(
        "wheel",
        nargs="?",
        type=Path,
        metavar="WHEEL",
        help="of the other version; default: the wheel that this runs from",
    )
    parser.add_argument("--back", action="store_true", help="run the version of before again")
    parser.add_argument("--url", default=URL, help="where the server answers; default: %(default)s")
    _add_root(parser)
    _add_wheels(parser)
    return parser


def _add_common(parser: Parser) -> None:
    parser.add_argument("--dry-run", action="store_true", help="only say what would be done")
    parser.add_argument("--yes", action="store_true", help="do not ask whether to go on")
    _add_root(parser)


def _add_root(parser: Parser) -> None:
    parser.add_argument(
        "--root",
        type=Path,
        default=Path("/"),
        metavar="FOLDER",
        help="a folder that becomes a machine's file system, such as an image; nothing is started",
    )


def _add_wheels(parser: Parser) -> None:
    parser.add_argument(
        "--wheels",
        type=Path,
        metavar="FOLDER",
        help="the wheels of requirements.lock, for a machine without a package index",
    )
