"""`operator-panel router-config [PANEL]`: a configuration of a Zenoh router (zenohd) for a robot whose
nodes run on rmw_zenoh, by which the panel can send its commands and nothing else.

Exit status: see `peer_config`.
"""

import re
from argparse import ArgumentTypeError
from collections.abc import Sequence
from typing import Final

from app.ros.dialects.dialect import WITHOUT_ROUTER
from app.tools.cell_config.rmw_zenoh_router import LISTEN, NODES, RouterOptions, router_config
from app.tools.cli.parser import Parser
from app.tools.cli.peer_config import add_domain, add_options, listen_of, read_panel, write

PROG: Final = "python -m app.cli router-config"
NO_ROUTER: Final = (
    "this robot is behind a bridge, by the panel file: `operator-panel bridge-config` writes a"
    " configuration of the bridge"
)
NOT_TLS: Final = "--tls needs a place that has TLS: name it with --listen tls/192.0.2.10:7447"
OVER_TLS: Final = ("tls/", "quic/")
INTERFACE: Final = re.compile(r"[^\s/\"\\]{1,15}")  # as Linux names them


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    if (cell := read_panel(parser, options)) is None:
        return 2
    if cell.robot.dialect in WITHOUT_ROUTER:
        parser.error(NO_ROUTER)
    router = RouterOptions(
        domain=cell.robot.domain if options.domain is None else options.domain,
        listen=listen_of(options, cell.entry, LISTEN),
        nodes=tuple(options.nodes or NODES),
        tls=cell.tls,
    )
    if cell.tls is not None and not all(end.startswith(OVER_TLS) for end in router.listen):
        parser.error(NOT_TLS)
    return write(router_config(cell.panel, cell.interfaces, cell.entry, router), options)


def _interface(text: str) -> str:
    if not INTERFACE.fullmatch(text):
        raise ArgumentTypeError(f'"{text}" is not a network interface, like lo or eth0')
    return text


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes a configuration of a Zenoh router for a robot on rmw_zenoh: the robot's"
        " nodes may do everything, and clients at the panel's endpoint only what the panel needs.",
        epilog="Start the router with it: zenohd -c router.json5",
    )
    add_options(parser, listen=f"{LISTEN[0]} for a panel on the same machine")
    add_domain(parser, None, "that in the panel file")
    parser.add_argument(
        "--nodes",
        action="append",
        type=_interface,
        metavar="INTERFACE",
        help="the network interface by which the robot's nodes come to the router; may be given several"
        f" times; default: {NODES[0]}, for nodes on the router's machine",
    )
    return parser
