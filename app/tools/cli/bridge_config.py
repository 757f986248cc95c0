"""`operator-panel bridge-config [PANEL]`: a configuration of zenoh-bridge-ros2dds that fits a panel.

Exit status: see `peer_config`.
"""

from argparse import ArgumentTypeError
from collections.abc import Sequence
from typing import Final

from app.ros.dialects.dialect import WITHOUT_BRIDGE
from app.ros.messages.names import TOPIC
from app.tools.cell_config.bridge_config import LISTEN, BridgeOptions, bridge_config
from app.tools.cli.parser import Parser
from app.tools.cli.peer_config import (
    add_domain,
    add_options,
    listen_of,
    own_domain,
    read_panel,
    write,
)

PROG: Final = "python -m app.cli bridge-config"
NO_BRIDGE: Final = (
    "this robot needs no bridge: by the panel file its nodes run on rmw_zenoh, at the Zenoh router that"
    " zenoh.json5 or `connect` names; `operator-panel router-config` writes a file for the router"
)


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    if (cell := read_panel(parser, options)) is None:
        return 2
    if cell.robot.dialect in WITHOUT_BRIDGE:
        parser.error(NO_BRIDGE)
    bridge = BridgeOptions(
        domain=options.domain,
        listen=listen_of(options, cell.entry, LISTEN),
        nodename=options.nodename,
        prefixed=options.prefixed,
        tls=cell.tls,
    )
    return write(bridge_config(cell.panel, cell.interfaces, cell.entry, bridge), options)


def _node(text: str) -> str:
    if not TOPIC.fullmatch(f"/{text}") or "/" in text:
        raise ArgumentTypeError(f'"{text}" is not a name of a ROS 2 node, like web_ui')
    return text


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes a configuration of the bridge that lets through what a panel needs, and"
        " lets the panel send its commands only.",
        epilog="Start the bridge with it: ROS_DISTRO=jazzy zenoh-bridge-ros2dds -c bridge.json5",
    )
    add_options(parser, listen=LISTEN[0])
    add_domain(parser, own_domain(), "this machine's, else 0")
    add = parser.add_argument
    add(
        "--prefixed",
        action="store_true",
        help="the robot's nodes have the panel's namespace in their own names; else the bridge adds it",
    )
    add(
        "--nodename",
        type=_node,
        default="web_ui",
        metavar="NAME",
        help="in `ros2 node list`; default: %(default)s",
    )
    return parser
