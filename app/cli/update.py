"""`operator-panel update`: another release in place of the one that runs. Exit status: see
`app.cli.install`."""

from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from pathlib import Path

from app.cli.install import add_root, add_wheels, exit_status, print_progress
from app.cli.parser import Parser
from app.install.assets import checked_wheel
from app.install.host import Host
from app.install.update import URL, SystemdServices, Updater

PROG = "python -m app.cli update"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    if options.back and options.wheel is not None:
        parser.error("either a wheel or --back")
    return exit_status(_update, options)


def _update(options: Namespace) -> int:
    host = Host(options.root.resolve())
    url = options.url if host.runs_systemd else None
    updater = Updater(host=host, services=SystemdServices(host), url=url, say=print_progress)
    if options.back:
        updater.back()
    else:
        updater.update(checked_wheel(options.wheel), options.wheels and options.wheels.resolve())
    return 0


def _url(text: str) -> str:
    if not text.startswith(("http://", "https://")):
        raise ArgumentTypeError(f'"{text}" is not the address of a server, like {URL}')
    return text.rstrip("/")


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Installs another version beside the one that runs, and starts it. If its server or"
        " page does not come up within a minute, the version of before runs again.",
    )
    add = parser.add_argument
    add(
        "wheel",
        nargs="?",
        type=Path,
        metavar="WHEEL",
        help="of the other version; default: the wheel that this runs from",
    )
    add("--back", action="store_true", help="run the version of before again")
    add("--url", type=_url, default=URL, help="where the server answers; default: %(default)s")
    add_root(parser)
    add_wheels(parser)
    return parser
