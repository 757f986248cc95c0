"""`operator-panel wall`: the HTTP server of a wall of cells. It needs no panel file, and reaches no
robot.

Exit status: see `run`.
"""

import os
from argparse import ArgumentTypeError
from collections.abc import Sequence

from app.system.errors import SettingsError
from app.system.settings import ALL_SITES, Settings
from app.tools.cli.parser import Parser
from app.tools.cli.run import add_server, serve

PROG = "python -m app.cli wall"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    return serve(parser, options)


def _sites(text: str) -> str:
    try:
        Settings.from_environment({**os.environ, "KIOSK_WALL": text})
    except SettingsError as error:
        raise ArgumentTypeError(str(error)) from None
    return text


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Serves a wall: a page with the state of all cells that publish a summary ([site]"
        " in their panel files) at the Zenoh routers of --zenoh. It only shows.",
        epilog="A tile leads to the cell's own panel. A wall has no Stop: Stop is at each cell.",
    )
    add = parser.add_argument
    add(
        "--sites",
        dest="wall",
        type=_sites,
        default=ALL_SITES,
        metavar="SITES",
        help='the sites that it shows, with commas between, such as "line 1,line 2"; default: all'
        " (KIOSK_WALL)",
    )
    add("--zenoh", metavar="FILE", help="Zenoh configuration (KIOSK_ZENOH)")
    add("--data", metavar="FOLDER", help="where the log of sign-ins and the users are (KIOSK_DATA)")
    add_server(parser)
    return parser
