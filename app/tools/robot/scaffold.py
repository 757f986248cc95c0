"""A scaffold of the robot that is there: what it is made of is read once, and only read."""

import asyncio
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.cell.link.observer import RobotObserver
from app.panel.file.load import faults_of_text
from app.ros.graph.model import (
    GraphSnapshot,
    RobotGraph,
    Server,
    SurveyedTopic,
    lost_servers,
    lost_topics,
    topic_forwarding,
)
from app.ros.graph.node_services import NodeParameter, NodeServices
from app.ros.messages import Interfaces, load_interfaces
from app.ros.messages.names import NAMESPACE, SHARED_TOPICS
from app.system.errors import DecodeError, KioskError
from app.tools.doctor.findings import few
from app.tools.robot.link import Place, check_namespace, nothing_there, opened, settled_graph
from app.tools.robot.topic_reader import endpoint_for
from app.tools.scaffold.checked import LeftOut, checked_draft
from app.tools.scaffold.draft import Known, lost_names, make_draft, public_topics
from app.tools.scaffold.parts import Draft, label_of, own_labels, shown_fields
from app.tools.scaffold.toml_text import alike_namespaces, toml_text
from app.tools.scaffold.widgets import JOINTS

LISTEN_S: Final = 3.0
SEVERAL: Final = "Robots"
ARRIVALS: Final = 3  # of a topic, by which it is known how often it is published
IRREGULAR: Final = 3.0  # the longest period of a regular topic, in its shortest one
MOST_ROBOTS: Final = 16
PARAMETERS_WITHIN_S: Final = 30.0  # of all nodes: one that does not answer takes 2 s
JITTER_S: Final = 0.2


def robot_at(graph: GraphSnapshot, namespace: str) -> tuple[RobotGraph, str]:
    """The robot that the pages are made of, and the part of a namespace that is below its bridge's."""
    for robot in sorted(graph.robots, key=lambda candidate: -len(candidate.namespace)):
        if f"{namespace}/".startswith(f"{robot.namespace}/") and (namespace or not robot.namespace):
            return robot, namespace.removeprefix(robot.namespace)
    return max(graph.robots, key=lambda candidate: len(candidate.topics)), ""


def fullest_of(graph: GraphSnapshot, namespaces: Sequence[str]) -> tuple[RobotGraph, str]:
    """As `robot_at`, of the namespace with the most topics."""
    candidates = [robot_at(graph, namespace) for namespace in namespaces]
    sizes = [sum(_is_of(topic, below) for topic in robot.topics) for robot, below in candidates]
    return candidates[sizes.index(max(sizes))]


def usable(graph: GraphSnapshot) -> GraphSnapshot:
    """The graph without the robots that a panel can't have: those with a namespace that is none of
    ROS 2, and those beyond the `MOST_ROBOTS` with the most topics."""
    robots = [robot for robot in graph.robots if NAMESPACE.fullmatch(robot.namespace)]
    robots = [robot for robot in robots if "__" not in robot.namespace]
    fullest = sorted(robots, key=lambda robot: -len(robot.topics))[:MOST_ROBOTS]
    return replace(graph, robots=tuple(robot for robot in graph.robots if robot in fullest))


async def read_scaffold_input(
    observer: RobotObserver, robot: RobotGraph, below: str, interfaces: Interfaces, listen_s: float
) -> Known:
    """What is on the robot, with names below the panel's namespace."""
    parameters, unreadable = await _parameters(NodeServices(robot, interfaces, observer), robot, below)
    topics = [_topic(topic, below) for topic in robot.topics if _is_of(topic, below)]
    heard = await _listen(observer, topics, interfaces, listen_s)
    return Known(
        has_dds_qos=robot.has_dds_qos,
        topics=topics,
        services=[
            _server(service, below) for service in robot.services if _is_below(service.name, below)
        ],
        actions=[_server(action, below) for action in robot.actions if _is_below(action.name, below)],
        parameters=parameters,
        samples={name: topic.message for name, topic in heard.items() if topic.message is not None},
        periods={
            name: period for name, topic in heard.items() if (period := topic.period_s) is not None
        },
        unreadable=unreadable,
        denied=_names(
            (topic.name for topic in robot.topics if topic_forwarding(robot, topic) == "denied"), below
        ),
        lost=_names((*(topic.name for topic in lost_topics(robot)), *lost_servers(robot)), below),
    )


def _names(names: Iterable[str], below: str) -> list[str]:
    return [name.removeprefix(below) for name in names if _is_below(name, below)]


async def _parameters(
    services: NodeServices, robot: RobotGraph, below: str
) -> tuple[list[NodeParameter], list[str]]:
    """Those of all nodes but the bridge's own, and the nodes that have some which can't be read."""
    parameters: list[NodeParameter] = []
    unreadable: list[str] = []
    bridges = {bridge.node for bridge in robot.bridges}
    end = asyncio.get_running_loop().time() + PARAMETERS_WITHIN_S
    for node in robot.nodes:
        if not _is_below(node.name, below) or node.name in bridges:
            continue
        late = asyncio.get_running_loop().time() > end
        of_node = None if late else await services.parameters(node)
        if of_node is not None:
            parameters += [replace(known, node=known.node.removeprefix(below)) for known in of_node]
        elif robot.service(f"{node.name}/list_parameters") is not None:
            unreadable.append(node.name.removeprefix(below))
    return parameters, unreadable


def _is_below(name: str, namespace: str) -> bool:
    return name.startswith(f"{namespace}/")


def _is_of(topic: SurveyedTopic, namespace: str) -> bool:
    """Whether a topic is below a namespace, or a node below it has the topic by its absolute name."""
    nodes = (node for end in (*topic.publishers, *topic.subscribers) for node in end.nodes)
    return _is_below(topic.name, namespace) or any(_is_below(node, namespace) for node in nodes)


def _topic(topic: SurveyedTopic, below: str) -> SurveyedTopic:
    """With its name as a panel file has it."""
    if _is_below(topic.name, below):
        return replace(topic, name=topic.name.removeprefix(below))
    return topic if topic.name in SHARED_TOPICS else replace(topic, name=f"/{topic.name}")


def _server(server: Server, below: str) -> Server:
    return replace(server, name=server.name.removeprefix(below))


def _has_use(topic: SurveyedTopic, interfaces: Interfaces) -> bool:
    """Whether a message of it has names or values that the panel is made with."""
    return topic.type == JOINTS or any(shown_fields(topic.type, interfaces))


@dataclass(slots=True)
class Heard:
    """What arrived on a topic: the first message that can be decoded, and when live ones arrived."""

    message: Any = None
    arrivals: list[float] = field(default_factory=list)

    def is_enough(self, latched: bool) -> bool:
        return self.message is not None and (latched or len(self.arrivals) >= ARRIVALS)

    @property
    def period_s(self) -> float | None:
        """The longest time between two messages; None of a topic that is not published regularly."""
        gaps = [after - before for before, after in pairwise(self.arrivals)]
        if len(gaps) < ARRIVALS - 1 or max(gaps) > IRREGULAR * min(gaps) + JITTER_S:
            return None
        return max(gaps)


async def _listen(
    observer: RobotObserver, topics: Sequence[SurveyedTopic], interfaces: Interfaces, listen_s: float
) -> dict[str, Heard]:
    """What arrived on each topic that has a use, by the topic's name: until it is enough of all, or
    time is up."""
    wanted = {
        topic.key: topic
        for topic in public_topics(topics)
        if topic.publishers and topic.type in interfaces.structures and _has_use(topic, interfaces)
    }
    heard_on = {topic.name: Heard() for topic in wanted.values()}
    if not wanted:
        return heard_on
    own = [endpoint_for(topic, topic.type) for topic in wanted.values()]
    with suppress(TimeoutError):
        async with asyncio.timeout(listen_s):
            async for key, sample in observer.listen(own):
                topic = wanted[key]
                heard = heard_on[topic.name]
                if not sample.cached:
                    heard.arrivals.append(sample.at)
                if heard.message is None:
                    with suppress(DecodeError):  # of another definition than the one known here
                        heard.message = interfaces.decode(topic.type, bytes(sample.payload))
                if all(heard_on[topic.name].is_enough(topic.latched) for topic in wanted.values()):
                    break
    return heard_on


class ScaffoldError(KioskError):
    """A panel that can't be made."""


class Scaffold(NamedTuple):
    """A panel for a robot, and the text of its file. `lost` names what the bridge has lost."""

    draft: Draft
    text: str
    lost: Sequence[str]


async def scaffold(
    place: Place,
    folder: Path,
    *,
    namespaces: Sequence[str] = (),
    controls: bool = False,
    listen_s: float = LISTEN_S,
) -> Scaffold:
    """The scaffold of the robot at a place, for a file in `folder`; with several `namespaces` that of
    these robots. `controls`: they are live. LinkError if there is no robot, ScaffoldError."""
    interfaces = load_interfaces(place.distro, place.interfaces)
    async with opened(place) as (observer, graph):
        graph = await settled_graph(observer, graph, place)
        for chosen in namespaces or (place.namespace,):
            check_namespace(graph, chosen)
        graph = usable(graph)
        if not graph.robots:
            raise ScaffoldError("no bridge has a namespace of ROS 2: correct `namespace` in its file")
        robot, below = fullest_of(graph, namespaces or (place.namespace,))
        known = await read_scaffold_input(observer, robot, below, interfaces, listen_s)
    if not any((known.topics, known.services, known.actions, known.parameters)):
        raise ScaffoldError(nothing_there([robot], f"{robot.namespace}{below}"))
    base = scaffold_base(place, graph, f"{robot.namespace}{below}", folder, namespaces)
    draft = _checked(partial(make_draft, known, interfaces, base, controls), folder)
    if controls and not draft.interlocks:
        raise ScaffoldError(
            "no topic looks like a permission of the robot, so no control is made live: leave"
            " --controls out, and give the controls an interlock of your own"
        )
    return Scaffold(draft, toml_text(draft, controls), lost_names(known))


def _checked(make: Callable[[LeftOut], Draft], folder: Path) -> Draft:
    """The draft without what a panel file can't have; ScaffoldError if it has other faults."""
    draft, faults = checked_draft(make, partial(faults_of_text, folder=folder))
    if faults:
        raise ScaffoldError(f"no panel can be made of this: {few([str(fault) for fault in faults])}")
    return draft


def scaffold_base(
    place: Place, graph: GraphSnapshot, below: str, folder: Path, chosen: Sequence[str] = ()
) -> Draft:
    """All but the pages. Several robots, and a place that is not that of zenoh.json5, are entries.
    `below` is the namespace of the pages; `chosen` are those of the robots, where the command line has
    them."""
    others = [robot.namespace for robot in graph.robots if robot.topics] if not place.namespace else []
    others = [*chosen] or others
    names = others if len(others) > 1 else [below]
    robots = []
    ids = [f"robot{number}" for number in range(1, len(names) + 1)] if len(names) > 1 else ["robot"]
    labels = own_labels(
        [(label_of(name or own_id), name) for name, own_id in zip(names, ids, strict=True)]
    )
    for name, own_id, label in zip(names, ids, labels, strict=True):
        entry: dict[str, Any] = {"id": own_id, "name": label}
        entry |= {"namespace": name} if name else {}
        entry |= place.reached
        robots.append(entry | ({"connect": list(place.connect)} if place.connect else {}))
    return Draft(
        title=SEVERAL if len(names) > 1 else label_of(below or "Robot"),
        namespace=below,
        reached=place.reached,
        robots=robots if len(names) > 1 or place.connect else (),
        distro=place.distro,
        interfaces=[os.path.relpath(interface, folder) for interface in place.interfaces],
        alike=() if len(names) > 1 or place.namespace else alike_namespaces(graph.robots[0]),
    )
