"""The options by which a command finds a robot.

Exit status of the commands that use it: 1 there is no such robot or topic, 2 a mistake on the command
line.
"""

import argparse
import asyncio
import sys
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any, get_args

from app.cell.link.observer import CONNECT_S
from app.panel import load_panel
from app.ros.dialects.dialect import DEFAULT_DIALECT, DialectName
from app.ros.messages import DISTROS
from app.ros.messages.names import NAMESPACE
from app.system.errors import KioskError
from app.system.settings import Settings
from app.tools.cli.arguments import ros_domain, seconds
from app.tools.doctor.findings import few
from app.tools.robot.link import DEFAULT_DISTRO, Place, lost_text

GONE, USAGE = 1, 2


def add_options(parser: argparse.ArgumentParser) -> None:
    """--connect, --zenoh, --panel, --namespace, --interfaces, --distro, --wait."""
    add = parser.add_argument_group("where the robot is").add_argument
    add(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help="the bridge or router, such as tcp/robot1:7447; may be given several times",
    )
    add("--zenoh", type=Path, metavar="FILE", help="Zenoh configuration (KIOSK_ZENOH)")
    add(
        "--panel",
        type=Path,
        metavar="FILE",
        help="a panel file, for its namespace, endpoints, distro and interfaces",
    )
    add(
        "--namespace",
        type=namespace,
        metavar="NAMESPACE",
        help="only what is below it, such as /robot1; names are then given without it",
    )
    add(
        "--interfaces",
        action="append",
        type=Path,
        metavar="FOLDER",
        help="packages with definitions of types, such as a workspace's install/; may be given several"
        " times",
    )
    add(
        "--dialect",
        choices=get_args(DialectName),
        help="bridge: the robot is behind zenoh-bridge-ros2dds; rmw_zenoh: its nodes run on rmw_zenoh."
        f" Default: the panel file's, else {DEFAULT_DIALECT}",
    )
    add(
        "--domain",
        type=ros_domain,
        metavar="N",
        help="the nodes' ROS_DOMAIN_ID on rmw_zenoh; default: 0",
    )
    add("--distro", choices=DISTROS, help=f"of ROS 2; default: {DEFAULT_DISTRO}")
    add(
        "--wait",
        type=seconds(),
        default=CONNECT_S,
        metavar="S",
        help="seconds to wait for a connection; default: %(default)g",
    )


def namespace(text: str) -> str:
    name = f"/{text.strip('/')}" if text.strip("/") else ""
    if not NAMESPACE.fullmatch(name):
        raise argparse.ArgumentTypeError(f'"{text}" is not a ROS 2 namespace, like /robot1')
    return name


def place_of(options: Any) -> Place:
    """What the options say; a panel file's where they say nothing. KioskError for a faulty file."""
    settings = Settings.from_environment()
    connect, named = tuple(options.connect or ()), options.namespace
    distro, folders = options.distro, tuple(options.interfaces or ())
    namespaces: tuple[str, ...] = ()
    bridges, dialect, ros_domain = 0, DEFAULT_DIALECT, 0
    if options.panel is not None:
        panel = load_panel(options.panel)
        robots = panel.robots
        dialect = robots[0].dialect if robots else panel.dialect
        ros_domain = robots[0].domain if robots else panel.domain
        if not connect:
            connect = tuple(dict.fromkeys(e for robot in robots for e in robot.connect))
            bridges = len({robot.connect for robot in robots if robot.connect})
        namespaces = tuple(robot.namespace for robot in robots) or (panel.namespace,)
        if named is None:
            named = robots[0].namespace if len(robots) == 1 else panel.namespace
        distro, folders = distro or panel.distro, folders or panel.interfaces
    return Place(
        zenoh=options.zenoh or settings.zenoh,
        connect=connect,
        robots=namespaces,
        bridges=bridges,
        namespace=named or "",
        distro=distro or DEFAULT_DISTRO,
        interfaces=tuple(folders),
        within_s=options.wait,
        dialect=options.dialect or dialect,
        domain=ros_domain if options.domain is None else options.domain,
    )


def report_lost(names: Sequence[str], code: str = "topic_unrouted") -> int:
    """The exit status. Names that the bridge has lost are printed as the doctor's finding."""
    if not names:
        return 0
    print(lost_text(few(names), code), file=sys.stderr, flush=True)
    return GONE


def ended(work: Callable[[], Coroutine[Any, Any, int]]) -> int:
    """Runs a command to its end. Ctrl-C ends it without a message."""
    try:
        return asyncio.run(work())
    except KeyboardInterrupt:
        return 0
    except KioskError as error:
        print(error, file=sys.stderr, flush=True)
        return GONE
