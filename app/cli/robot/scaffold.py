"""`operator-panel scaffold [-o FILE]`: a first panel that fits the robot behind a bridge.

Exit status: 0 it is written, 1 there is no robot, or the file exists, 2 a mistake on the command line.
"""

import asyncio
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from app.cli.parser import Parser
from app.cli.robot.link import (
    GONE,
    Place,
    add_options,
    check_namespace,
    ended,
    opened,
    place_of,
    seconds,
)
from app.cli.robot.topic_reader import endpoint_for
from app.errors import DecodeError, KioskError, PanelError
from app.graph.model import Node, RobotGraph, RosGraph, Server, Topic
from app.graph.node_services import NodeParameter, NodeServices
from app.interfaces import Interfaces, load_interfaces
from app.panel import check_panel
from app.scaffold.displays import JOINTS
from app.scaffold.draft import Known, make_draft, shown
from app.scaffold.entry import Draft
from app.scaffold.fields import shown_fields
from app.scaffold.naming import label_of
from app.scaffold.toml_text import toml_text
from app.settings import APP
from app.transport.bridge_observer import BridgeObserver

PROG = "python -m app.cli scaffold"
LISTEN_S: Final = 3.0
STDOUT: Final = "-"


class ScaffoldError(KioskError):
    """A panel that can't be made or written."""


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    given = make_parser(prog).parse_args(arguments)
    return ended(lambda: _scaffold(given))


async def _scaffold(given: Any) -> int:
    target = None if given.output == STDOUT else Path(given.output)
    if target is not None and target.exists() and not given.force:
        raise ScaffoldError(f"{target} exists: give another name with -o, or --force to replace it")
    place = place_of(given)
    interfaces = load_interfaces(place.distro, place.interfaces)
    async with opened(place) as (observer, graph):
        check_namespace(graph, place.namespace)
        robot, below = _chosen(graph, place.namespace)
        known = await _read(observer, robot, below, interfaces, given.listen)
    draft = make_draft(known, interfaces, _base(given, place, graph, robot, below, target))
    if given.controls and not draft.interlocks:
        raise ScaffoldError(
            "no topic looks like a permission of the robot, so no control is made live: leave"
            " --controls out, and give the controls an interlock of your own"
        )
    text = toml_text(draft, given.controls)
    if target is None:
        print(text, end="")
        return 0
    return _written(target, text, draft)


def _chosen(graph: RosGraph, below: str) -> tuple[RobotGraph, str]:
    """The robot that the pages are made of, and the part of a namespace that is below its bridge's."""
    for robot in sorted(graph.robots, key=lambda one: -len(one.namespace)):
        if f"{below}/".startswith(f"{robot.namespace}/") and (below or not robot.namespace):
            return robot, below.removeprefix(robot.namespace)
    return max(graph.robots, key=lambda one: len(one.topics)), ""


def _base(
    given: Any, place: Place, graph: RosGraph, robot: RobotGraph, below: str, target: Path | None
) -> Draft:
    """All but the pages. Several robots, and a place that is not that of zenoh.json5, are entries."""
    namespace = f"{robot.namespace}{below}"
    others = [one.namespace for one in graph.robots if one.topics] if not place.namespace else []
    names = others if len(others) > 1 else [namespace]
    robots = []
    for number, name in enumerate(names, 1):
        own_id = f"robot{number}" if len(names) > 1 else "robot"
        entry: dict[str, Any] = {"id": own_id, "name": _title(name, own_id)}
        entry |= {"namespace": name} if name else {}
        robots.append(entry | ({"connect": list(place.connect)} if place.connect else {}))
    folder = Path() if target is None else target.parent
    return Draft(
        title=_title(namespace, "Robot"),
        namespace=namespace,
        robots=robots if len(names) > 1 or place.connect else (),
        distro=place.distro,
        interfaces=[os.path.relpath(one, folder) for one in place.interfaces],
    )


def _title(namespace: str, otherwise: str) -> str:
    return label_of(namespace) if namespace else label_of(otherwise)


async def _read(
    observer: BridgeObserver, robot: RobotGraph, below: str, interfaces: Interfaces, listen_s: float
) -> Known:
    """What is on the robot, with names below the panel's namespace."""
    services = NodeServices(robot, interfaces, observer)
    parameters: list[NodeParameter] = []
    unasked = []
    bridges = {bridge.node for bridge in robot.bridges}
    for node in robot.nodes:
        if not node.name.startswith(f"{below}/") or node.name in bridges:
            continue
        told = await services.parameters(node)
        if told is not None:
            parameters += [replace(one, node=one.node.removeprefix(below)) for one in told]
        elif _has_services(robot, node):
            unasked.append(node.name.removeprefix(below))
    topics = [_below(one, below) for one in robot.topics if one.name.startswith(f"{below}/")]
    return Known(
        topics=topics,
        services=[_server(one, below) for one in robot.services if one.name.startswith(f"{below}/")],
        actions=[_server(one, below) for one in robot.actions if one.name.startswith(f"{below}/")],
        parameters=parameters,
        samples=await _samples(observer, topics, interfaces, listen_s),
        unasked=unasked,
    )


def _has_services(robot: RobotGraph, node: Node) -> bool:
    return robot.service(f"{node.name}/list_parameters") is not None


def _below(topic: Topic, below: str) -> Topic:
    return replace(topic, name=topic.name.removeprefix(below))


def _server(one: Server, below: str) -> Server:
    return replace(one, name=one.name.removeprefix(below))


def _tells(topic: Topic, interfaces: Interfaces) -> bool:
    """Whether a message of it tells a name or a range that the panel needs."""
    return topic.type == JOINTS or any(shown_fields(topic.type, interfaces))


async def _samples(
    observer: BridgeObserver, topics: Sequence[Topic], interfaces: Interfaces, listen_s: float
) -> dict[str, Any]:
    """A message of each topic that it tells something of, until all came or time is up."""
    wanted = {
        one.key: one
        for one in shown(topics)
        if one.publishers and one.type in interfaces.structures and _tells(one, interfaces)
    }
    found: dict[str, Any] = {}
    if not wanted:
        return found
    with suppress(TimeoutError):
        async with asyncio.timeout(listen_s):
            own = [endpoint_for(topic, topic.type) for topic in wanted.values()]
            async for key, sample in observer.listen(own):
                topic = wanted[key]
                with suppress(DecodeError):  # of another definition than the one known here
                    found[topic.name] = interfaces.decode(topic.type, bytes(sample.payload))
                if len(found) == len(wanted):
                    break
    return found


def _written(target: Path, text: str, draft: Draft) -> int:
    """Writes the file whole or not at all, checks it, and says what to do next."""
    beside = target.with_name(f".{target.name}.new")
    try:
        beside.write_text(text, encoding="utf-8")
        check_panel(beside)
        beside.replace(target)
    except OSError as error:
        raise ScaffoldError(f"{target} can't be written: {error.strerror}") from error
    except PanelError as error:
        raise ScaffoldError(
            f"the panel that was made has faults, which is a mistake of {APP}: {error}"
        ) from error
    finally:
        beside.unlink(missing_ok=True)
    widgets = [one for page in draft.pages.values() for one in page]
    acting = sum(one.control for one in widgets)
    live = "[[page.widget]]" in text
    print(f"{target}: {len(draft.pages)} page(s), {len(widgets) - acting} display(s)", end="")
    print(f", {acting} control(s), {len(draft.interlocks)} interlock candidate(s)")
    if acting and "# [[page.widget]]" in text:
        print("The controls are commented out: uncomment those that you want, each with its interlock.")
    print(f"Start it: {APP} run {target}", flush=True)
    return 0 if live or not widgets else GONE


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes a first panel file that fits what is on a robot now: lamps, gauges, joints,"
        " cameras, tables, trends, the log; controls commented out.",
        epilog="It only reads from the robot. Exit status: 1 there is no robot, or the file exists.",
    )
    add = parser.add_argument
    add(
        "-o",
        "--output",
        default="cell.toml",
        metavar="FILE",
        help='the panel file; default: %(default)s; "-" prints it',
    )
    add("--force", action="store_true", help="replace a file that exists")
    add(
        "--controls",
        action="store_true",
        help="live controls, each behind the first interlock candidate: look at each of them first",
    )
    add(
        "--listen",
        type=seconds,
        default=LISTEN_S,
        metavar="S",
        help="seconds to wait for messages, for names of joints and for ranges; default: %(default)g",
    )
    add_options(parser)
    return parser
