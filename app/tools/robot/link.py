"""Where a robot is, a link that only reads from it, and its graph once that is settled."""

import asyncio
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

from app.cell.link.observer import CONNECT_S, RobotObserver
from app.cell.link.peer import RobotAccess
from app.cell.link.robot_access import detect_access
from app.ros.dialects.dialect import DEFAULT_DIALECT, DialectName, within
from app.ros.dialects.peer_traits import PeerTraits
from app.ros.graph.model import GraphSnapshot, RobotGraph, SurveyedTopic, lost_topics, near
from app.ros.messages.names import GLOBAL
from app.ros.zenoh.config import Config, config_from
from app.system.errors import LinkError
from app.system.settings import LOOPBACK_HOSTS
from app.tools.doctor.findings import Finding, few

DEFAULT_DISTRO: Final = "jazzy"
TWO_KINDS: Final = (
    "a bridge and nodes on rmw_zenoh are there: say with --dialect which of them is the robot"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """Where to look, by the command line: `namespace` is "" for all robots. `dialect` is that of all of
    them, `domain` their ROS domain. `robots` are the namespaces of the panel's robots, and `bridges`
    how many bridges they have at least; 0: one an endpoint."""

    zenoh: Path
    connect: tuple[str, ...] = ()
    robots: tuple[str, ...] = ()
    bridges: int = 0
    namespace: str = ""
    distro: str = DEFAULT_DISTRO
    interfaces: tuple[Path, ...] = ()
    within_s: float = CONNECT_S
    dialect: DialectName = DEFAULT_DIALECT
    domain: int = 0

    @property
    def reached(self) -> dict[str, Any]:
        """The keys of a panel file that say how such a robot is reached, where that is not usual."""
        reached: dict[str, Any] = {}
        if self.dialect != DEFAULT_DIALECT:
            reached["dialect"] = self.dialect
        return reached | ({"domain": self.domain} if self.domain else {})


def _is_elsewhere(endpoint: str) -> bool:
    """Whether an endpoint, such as "tcp/robot1:7447", is on another machine."""
    return endpoint.partition("/")[2].rpartition(":")[0] not in LOOPBACK_HOSTS


async def _connected(place: Place) -> tuple[RobotObserver, PeerTraits]:
    """A connected observer of the kind of robot that is there. LinkError says what is missing."""
    config = config_from(place.zenoh, place.connect)
    access = await _access(place, config)
    while True:
        observer, traits = RobotObserver(config, access, place.domain), access.traits
        try:
            await observer.connect(place.within_s)
            after = await _access(place, config) if access.kinds else access
            if after is access:
                return observer, traits
            access = after  # it was not there before
        except LinkError as error:
            await observer.close()
            elsewhere = traits.elsewhere_hint if any(map(_is_elsewhere, observer.endpoints)) else ""
            raise LinkError(f"{error}: {traits.start_hint}{elsewhere}") from error
        await observer.close()


async def _access(place: Place, config: Config) -> RobotAccess:
    access, *others = await detect_access(place.dialect, config, place.domain)
    if others:
        raise LinkError(TWO_KINDS)
    return access


@asynccontextmanager
async def opened(place: Place) -> AsyncIterator[tuple[RobotObserver, GraphSnapshot]]:
    """A connected observer and the graph now. LinkError says what is missing, and what to do."""
    observer, traits = await _connected(place)
    try:
        graph = await observer.observe()
        where = ", ".join(observer.endpoints)
        if not graph.robots:
            hint = traits.start_hint
            raise LinkError(f"Zenoh answers at {where}, but no {traits.title} is there: {hint}")
        if not any(robot.answers for robot in graph.robots):
            raise LinkError(f"the {traits.answering} at {where} does not answer: it hangs; restart it")
        yield observer, graph
    finally:
        await observer.close()


def nothing_there(robots: Sequence[RobotGraph], below: str) -> str:
    """The sentence about a domain without nodes."""
    where = f" below {below}" if below else ""
    if not any(robot.bridges for robot in robots):
        return f"there is no topic{where}: start the robot's nodes"
    domains = few(sorted({str(bridge.domain) for robot in robots for bridge in robot.bridges}))
    return (
        f"the bridge sees no topic{where} in domain {domains}: start the robot's nodes, and set"
        " `domain` in the bridge's file to their ROS_DOMAIN_ID"
    )


def absent_robots(graph: GraphSnapshot, place: Place) -> list[str]:
    """The namespaces of the panel's robots that are not in the graph, or do not answer."""
    there = [robot.namespace for robot in graph.robots if robot.answers]
    return [name for name in place.robots if not any(within(name, outer) for outer in there)]


def full_name(robot: RobotGraph, name: str) -> str:
    """The name behind the namespace of the robot's bridge."""
    return f"{robot.namespace}{name}"


def shown_topics(graph: GraphSnapshot, below: str) -> dict[str, tuple[RobotGraph, SurveyedTopic]]:
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
        hint = f": the bridges have {few(robots)}" if robots else ": no bridge has a namespace"
        raise LinkError(f"there are no topics below {below}{hint if graph.bridges else ''}")


def lost_text(about: str, code: str = "topic_unrouted") -> str:
    """The doctor's finding about what the bridge has lost, with what to do."""
    lost = Finding(code, about)
    return f"{lost.sentence} {lost.do}"


def topic_named(graph: GraphSnapshot, place: Place, wanted: str) -> tuple[RobotGraph, SurveyedTopic]:
    """The topic of this name, which is not below the namespace if it begins with "//"; LinkError with
    similar names."""
    check_namespace(graph, place.namespace)
    known = shown_topics(graph, "" if wanted.startswith(GLOBAL) else place.namespace)
    name = f"/{wanted.lstrip('/')}"
    if name not in known:
        close = near(name, known)
        hint = f"did you mean {' or '.join(close)}?" if close else "`operator-panel topics` lists them"
        if absent := [name or "/" for name in absent_robots(graph, place)]:
            hint = f"no bridge answers for the panel's namespace {', '.join(absent)}; {hint}"
        raise LinkError(f"no topic {name} is there: {hint}")
    return known[name]


# The graph of robots whose peers, or whose nodes, may have started just now.
#
# A bridge knows a topic some time before it announces it, nodes are discovered one after the other, and
# of several bridges one may be connected before the others.

SETTLES_WITHIN_S: Final = 5.0
READ_EVERY_S: Final = 0.5


class GraphReader(Protocol):
    @property
    def endpoints(self) -> Sequence[str]: ...

    async def observe(self) -> GraphSnapshot: ...


async def settled_graph(
    reader: GraphReader,
    first: GraphSnapshot,
    place: Place,
    is_enough: Callable[[GraphSnapshot], bool] = lambda _: False,
    within_s: float = SETTLES_WITHIN_S,
    every_s: float = READ_EVERY_S,
) -> GraphSnapshot:
    """The first graph that is enough; else the graph once it has topics, has the same ones twice, has
    all bridges of the place, and these announce all that their `allow` and `deny` let through; the last
    one read after `within_s`."""
    clock = asyncio.get_running_loop().time
    end = clock() + within_s
    bridges = place.bridges or len(reader.endpoints)
    before, now = first, first
    while not is_enough(now) and clock() < end:
        await asyncio.sleep(every_s)
        before, now = now, await reader.observe()
        if _topics(now) and _topics(now) == _topics(before) and _is_whole(now, place, bridges):
            break
    return now


def _topics(graph: GraphSnapshot) -> set[str]:
    return {topic.key for robot in graph.robots for topic in robot.topics}


def _is_whole(graph: GraphSnapshot, place: Place, bridges: int) -> bool:
    return (
        (not graph.bridges or sum(bridge.answers for bridge in graph.bridges) >= bridges)
        and not absent_robots(graph, place)
        and not any(any(lost_topics(robot)) for robot in graph.robots)
    )
