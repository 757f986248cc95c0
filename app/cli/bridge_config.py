"""`operator-panel bridge-config [PANEL]`: a configuration of zenoh-bridge-ros2dds that fits a panel.

Exit status: 0 written, 1 it can't be written, 2 a mistake on the command line or a panel with faults.
"""

import os
import sys
from argparse import ArgumentTypeError
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from app.cli.arguments import PANEL_HELP
from app.cli.output import OutputError, add_force, draft_of
from app.cli.parser import Parser
from app.dialect.dialect import DOMAIN_MOST, WITHOUT_BRIDGE
from app.errors import KioskError
from app.interfaces.names import TOPIC
from app.panel import Panel, load_panel
from app.panel.base import ENDPOINT
from app.panel.model import RobotEntry
from app.settings import Settings
from app.transport.bridge_config import LISTEN, BridgeOptions, bridge_config

PROG: Final = "python -m app.cli bridge-config"
NO_BRIDGE: Final = (
    "this robot needs no bridge: by the panel file its nodes run on rmw_zenoh, at the Zenoh router that"
    " zenoh.json5 or `connect` names"
)


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    try:
        panel = load_panel(options.panel or Settings.from_environment().panel)
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    entry = _robot(parser, panel, options.robot)
    if (entry or panel).dialect in WITHOUT_BRIDGE:
        parser.error(NO_BRIDGE)
    text = bridge_config(panel, entry, _options(options, entry))
    if options.output is None:
        print(text, end="")
        return 0
    try:
        with draft_of(options.output, options.force) as draft:
            draft.write_text(text, encoding="utf-8")
    except OutputError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _robot(parser: Parser, panel: Panel, name: str | None) -> RobotEntry | None:
    """The robot that the bridge is for: of several one has to be named."""
    names = [entry.id for entry in panel.robots]
    if name is None and len(names) <= 1:
        return panel.robots[0] if panel.robots else None
    for entry in panel.robots:
        if entry.id == name:
            return entry
    listed = ", ".join(names) or "none: leave --robot out"
    parser.error(f"--robot names one of the panel's robots: there is {listed}")


def _options(options: Any, entry: RobotEntry | None) -> BridgeOptions:
    listen = options.listen or (entry.connect if entry and entry.connect else LISTEN)
    return BridgeOptions(
        domain=options.domain,
        listen=tuple(listen),
        nodename=options.nodename,
        prefixed=options.prefixed,
    )


def _domain(text: str) -> int:
    domain = int(text) if text.isascii() and text.isdigit() else -1
    if not 0 <= domain <= DOMAIN_MOST:
        raise ArgumentTypeError(f'"{text}" is not a ROS_DOMAIN_ID: 0 to {DOMAIN_MOST}')
    return domain


def _endpoint(text: str) -> str:
    if not ENDPOINT.fullmatch(text):
        raise ArgumentTypeError(
            f'"{text}" is not a Zenoh endpoint: it must be like tcp/192.0.2.10:7447'
        )
    return text


def _node(text: str) -> str:
    if not TOPIC.fullmatch(f"/{text}") or "/" in text:
        raise ArgumentTypeError(f'"{text}" is not a name of a ROS 2 node, like web_ui')
    return text


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes a configuration of the bridge that lets through what a panel needs.",
        epilog="Start the bridge with it: ROS_DISTRO=jazzy zenoh-bridge-ros2dds -c bridge.json5",
    )
    add = parser.add_argument
    add("panel", nargs="?", type=Path, metavar="PANEL", help=PANEL_HELP)
    add("-o", "--output", type=Path, metavar="FILE", help="where to write it; default: standard output")
    add_force(parser)
    add(
        "--domain",
        type=_domain,
        default=os.environ.get("ROS_DOMAIN_ID") or "0",
        metavar="N",
        help="ROS_DOMAIN_ID of the robot's nodes; default: this machine's, else 0",
    )
    add(
        "--listen",
        action="append",
        type=_endpoint,
        metavar="ENDPOINT",
        help="where the panel connects, such as tcp/192.0.2.10:7447; may be given several times;"
        " default: the robot's `connect` in the panel file, else tcp/127.0.0.1:7447",
    )
    add("--robot", metavar="ID", help="which robot, of a panel with several")
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
