"""The options by which a command finds a robot, and the robot's graph that they lead to.

Exit status of the commands that use it: 1 there is no such robot or topic, 2 a mistake on the command
line.
"""

import argparse
import asyncio
import os
import sys
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from app.cli.arguments import seconds
from app.errors import KioskError, LinkError
from app.graph.model import GraphSnapshot, RobotGraph, Topic, near
from app.interfaces import DISTROS
from app.interfaces.names import NAMESPACE
from app.panel import load_panel
from app.settings import LOOPBACK_HOSTS, Settings
from app.transport.bridge_observer import CONNECT_S, BridgeObserver
from app.transport.zenoh_config import config_from

GONE, USAGE = 1, 2
DEFAULT_DISTRO: Final = "jazzy"
BRIDGE_HINT: Final = (
    "start zenoh-bridge-ros2dds on the robot, or name its place with --connect tcp/HOST:7447"
)
ELSEWHERE_HINT: Final = (
    ". As shipped, the bridge accepts connections from its own machine only: put this address into"
    " `listen` of its file"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where to look, by the command line: `namespace` is "" for all robots."""

    zenoh: Path
    connect: tuple[str, ...] = ()
    namespace: str = ""
    distro: str = DEFAULT_DISTRO
    interfaces: tuple[Path, ...] = ()
    within_s: float = CONNECT_S


def add_options(parser: argparse.ArgumentParser) -> None:
    """--connect, --zenoh, --panel, --namespace, --interfaces, --distro, --wait."""
    add = parser.add_argument_group("where the robot is").add_argument
    add(
        "--connect",
        action="append",
        metavar="ENDPOINT",
        help="the bridge, such as tcp/robot1:7447; may be given several times",
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
    add("--distro", choices=DISTROS, help=f"of ROS 2; default: {DEFAULT_DISTRO}")
    add(
        "--wait",
        type=seconds(),
        default=CONNECT_S,
        metavar="S",
        help="seconds to wait for a connection; default: %(default)g",
    )


def namespace(text: str) -> str:
    given = f"/{text.strip('/')}" if text.strip("/") else ""
    if not NAMESPACE.fullmatch(given):
        raise argparse.ArgumentTypeError(f'"{text}" is not a ROS 2 namespace, like /robot1')
    return given


def place_of(given: Any) -> Place:
    """What the options say; a panel file's where they say nothing. KioskError for a faulty file."""
    settings = Settings.from_environment()
    connect, named = tuple(given.connect or ()), given.namespace
    distro, folders = given.distro, tuple(given.interfaces or ())
    if given.panel is not None:
        panel = load_panel(given.panel)
        robots = panel.robots
        connect = connect or tuple(dict.fromkeys(e for robot in robots for e in robot.connect))
        if named is None:
            named = robots[0].namespace if len(robots) == 1 else panel.namespace
        distro, folders = distro or panel.distro, folders or panel.interfaces
    return Place(
        zenoh=given.zenoh or settings.zenoh,
        connect=connect,
        namespace=named or "",
        distro=distro or DEFAULT_DISTRO,
        interfaces=tuple(folders),
        within_s=given.wait,
    )


def _is_elsewhere(endpoint: str) -> bool:
    """Whether an endpoint, such as "tcp/robot1:7447", is on another machine."""
    return endpoint.partition("/")[2].rpartition(":")[0] not in LOOPBACK_HOSTS


@asynccontextmanager
async def opened(place: Place) -> AsyncIterator[tuple[BridgeObserver, GraphSnapshot]]:
    """A connected observer and the graph now. LinkError says what is missing, and what to do."""
    observer = BridgeObserver(config_from(place.zenoh, place.connect))
    try:
        try:
            await observer.connect(place.within_s)
        except LinkError as error:
            elsewhere = ELSEWHERE_HINT if any(map(_is_elsewhere, observer.endpoints)) else ""
            raise LinkError(f"{error}: {BRIDGE_HINT}{elsewhere}") from error
        graph = await observer.graph()
        where = ", ".join(observer.endpoints)
        if not graph.bridges:
            raise LinkError(f"Zenoh answers at {where}, but no bridge to ROS 2 is there: {BRIDGE_HINT}")
        if not any(bridge.answers for bridge in graph.bridges):
            raise LinkError(f"the bridge at {where} does not answer: it hangs; restart it")
        yield observer, graph
    finally:
        await observer.close()


def full_name(robot: RobotGraph, name: str) -> str:
    """The name behind the namespace of the robot's bridge."""
    return f"{robot.namespace}{name}"


def shown_topics(graph: GraphSnapshot, below: str) -> dict[str, tuple[RobotGraph, Topic]]:
    """The topics below a namespace, by their names without it."""
    return {
        name.removeprefix(below): (robot, topic)
        for robot in graph.robots
        for topic in robot.topics
        if (name := full_name(robot, topic.name)).startswith(f"{below}/")
    }


def check_namespace(graph: GraphSnapshot, below: str) -> None:
    """LinkError if no topic is below the namespace."""
    if below and not shown_topics(graph, below):
        robots = [robot.namespace for robot in graph.robots if robot.namespace]
        hint = f": the bridges have {', '.join(robots)}" if robots else ": no bridge has a namespace"
        raise LinkError(f"there are no topics below {below}{hint}")


def topic_named(graph: GraphSnapshot, below: str, given: str) -> tuple[RobotGraph, Topic]:
    """The topic of this name; LinkError with similar names."""
    check_namespace(graph, below)
    known = shown_topics(graph, below)
    name = f"/{given.lstrip('/')}"
    if name not in known:
        close = near(name, known)
        hint = f"did you mean {' or '.join(close)}?" if close else "`operator-panel topics` lists them"
        raise LinkError(f"no topic {name} is there: {hint}")
    return known[name]


def ended(work: Callable[[], Coroutine[Any, Any, int]]) -> int:
    """Runs a command to its end. Ctrl-C and a closed output (`| head`) end it without a message."""
    try:
        return asyncio.run(work())
    except KeyboardInterrupt:
        return 0
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # for the flush at exit
        return 0
    except KioskError as error:
        print(error, file=sys.stderr, flush=True)
        return GONE
