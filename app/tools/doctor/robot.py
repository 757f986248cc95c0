"""Diagnoses one robot of a panel: the link to it, the ROS graph, what the robot publishes."""

import asyncio
import json
import re
import socket
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Final, Protocol

from app.cell.link.peer import RobotAccess
from app.cell.link.robot_access import ROBOT_ACCESS, detect_access
from app.cell.robot.clocks import APART_S, CLOCK, OTHER_TIME_S, are_apart, is_other_time
from app.ros.cdr.stamped import begins_with_stamp, first_stamp
from app.ros.dialects.dialect import DEFAULT_DIALECT, DEMO_VERSION, Dialect, any_hash
from app.ros.graph.model import Bridge, GraphSnapshot
from app.ros.messages import Interfaces, load_interfaces
from app.ros.messages.field_path import EARLIEST_S
from app.ros.zenoh.answers import AdminSpace, neighbour_queries
from app.ros.zenoh.config import config_from, endpoints_of, tls_files
from app.ros.zenoh.sample import Sample
from app.ros.zenoh.session import ZenohSession
from app.system.errors import LinkError, SettingsError
from app.system.texts import Text, say
from app.tools.doctor.findings import Report, few
from app.tools.doctor.maps import MapChecks
from app.tools.doctor.names import PanelNames, PanelRobot
from app.tools.doctor.received import ReceivedSamples, copies, receive
from app.tools.doctor.topics import TopicChecks, check_permissions

# The way to a robot's Zenoh router or peer: name, TCP, Zenoh's handshake, versions of Zenoh.

CONNECT_S: Final = 3.0
HANDSHAKE_S: Final = 3.0
ASK_S: Final = 1.0
ROUTERS: Final = (
    "@/*/router",
    "@/*/peer",
)  # in Zenoh's admin space: JSON with `version` and `sessions`
TCP: Final = re.compile(r"(?P<protocol>tcp|tls|ws)/(?P<host>\[[^\]]+\]|[^\s/?#:]+):(?P<port>\d+).*")
RELEASE: Final = re.compile(r"v?(\d+)\.\d+(\.\d+)?")  # those of one first number work together


class AdminSession(AdminSpace, Protocol):
    """A link with the id of its session."""

    zid: str


def configured(report: Report, zenoh: Path, connect: Sequence[str], robot: str) -> tuple[str, ...]:
    """The endpoints that a Zenoh configuration connects to; () if it can't be used."""
    try:
        endpoints = endpoints_of(config_from(zenoh, connect))
    except SettingsError as error:
        report.find("zenoh_config", str(zenoh), robot=robot, detail=" ".join(str(error).split()))
        return ()
    faults = tls_files(zenoh).faults()
    for fault in faults:
        report.find("zenoh_config", str(zenoh), robot=robot, detail=fault)
    if faults:
        return ()
    if not endpoints:
        detail = say("finding_no_endpoint", file=str(zenoh))
        report.find("zenoh_config", str(zenoh), robot=robot, detail=detail)
    return endpoints


async def check_link(
    report: Report, zenoh: Path, endpoints: Sequence[str], robot: str, dialect: Dialect
) -> list[str]:
    """The endpoints at which Zenoh answers."""
    answering = []
    for endpoint in endpoints:
        there = await asyncio.to_thread(connects, report, endpoint, robot)
        if there and await _shakes_hands(report, zenoh, endpoint, robot, dialect):
            answering.append(endpoint)
    return answering


def connects(report: Report, endpoint: str, robot: str) -> bool:
    """Whether TCP gets through; True where an endpoint is none of TCP."""
    match = TCP.fullmatch(endpoint)
    if match is None:
        return True
    try:
        with socket.create_connection((match["host"].strip("[]"), int(match["port"])), CONNECT_S):
            return True
    except socket.gaierror as error:
        report.find("host_unknown", endpoint, robot=robot, detail=(error.strerror or "").lower())
    except ConnectionRefusedError:
        report.find("no_router", endpoint, robot=robot)
    except TimeoutError:
        report.find(
            "no_route",
            endpoint,
            robot=robot,
            detail=say("finding_no_connection", seconds=f"{CONNECT_S:g}"),
        )
    except OSError as error:
        detail = (error.strerror or str(error)).lower()
        report.find("no_route", endpoint, robot=robot, detail=detail)
    return False


async def _shakes_hands(
    report: Report, zenoh: Path, endpoint: str, robot: str, dialect: Dialect
) -> bool:
    session = await asyncio.to_thread(
        ZenohSession, config_from(zenoh, [endpoint]), lambda _: None, dialect
    )
    try:
        if not await session.connected(HANDSHAKE_S):
            report.find("not_zenoh", endpoint, robot=robot)
            return False
        await check_version(report, session, endpoint, robot)
        return True
    except LinkError as error:
        report.find("zenoh_config", str(zenoh), robot=robot, detail=str(error))
        return False
    finally:
        with suppress(LinkError):
            await asyncio.to_thread(session.close)


async def check_version(report: Report, session: AdminSession, endpoint: str, robot: str) -> None:
    """Whether the other side has a Zenoh that works with this one; its admin space may be off."""
    ours = version("eclipse-zenoh")
    answers = await asyncio.gather(*(session.query_all(selector, ASK_S) for selector in ROUTERS))
    for _, answer in (answer for several in answers for answer in several):
        with suppress(
            ValueError, TypeError, AttributeError, LookupError, RecursionError
        ):  # an answer that is none of Zenoh's
            said = json.loads(answer)
            if all(session.zid != peer.get("peer") for peer in said["sessions"]):
                continue  # further away
            theirs = RELEASE.match(said["version"])
            if theirs is not None and theirs[1] != ours.split(".")[0]:
                report.find("zenoh_version", endpoint, robot=robot, theirs=theirs[0], ours=ours)
            elif theirs is not None:
                report.fact(f"Zenoh {theirs[0].lstrip('v')} answers at {endpoint}; {ours} is here")
            return
    report.fact(f"Zenoh answers at {endpoint} (its version is not known: its admin space is off)")


# The peers of a robot: bridges that respond, of the right namespace, domain and version, and nodes. Of
# a robot without bridges, only its nodes. Pure.

TESTED: Final = "1.10.2"  # zenoh-plugin-ros2dds; see docs/compatibility.md


def check_graph(report: Report, graph: GraphSnapshot, behind: PanelNames) -> bool:
    """Whether there is something to be said of the robot's topics."""
    robot = behind.robot
    if not behind.graphs:
        theirs = graph.robots[0].namespace
        report.find("bridge_namespace", robot=robot.id, theirs=theirs, ours=robot.namespace)
        return False
    bridges = [bridge for graph in behind.graphs for bridge in graph.bridges]
    for bridge in bridges:
        _check_bridge(report, bridge, robot.id)
    _check_several(report, behind, robot.id)
    if not any(graph.answers for graph in behind.graphs):
        return False
    return _check_nodes(report, behind, bridges)


def _check_bridge(report: Report, bridge: Bridge, robot: str) -> None:
    if not bridge.answers:
        report.find("link_bridge_silent", bridge.zid, robot=robot)
        return
    version = bridge.version.lstrip("v")
    if version not in (TESTED, DEMO_VERSION.strip('"')):
        report.find("bridge_version", bridge.zid, robot=robot, theirs=version, tested=TESTED)
    if bridge.config.get("reliable_routes_blocking") is False:
        report.find("bridge_drops", bridge.zid, robot=robot)
    where = f'domain {bridge.domain}, namespace "{bridge.namespace or "/"}"'
    report.fact(f"bridge {bridge.zid} is version {version}, {where}")


def _check_several(report: Report, behind: PanelNames, robot: str) -> None:
    """Whether two bridges forward the same for the same namespace."""
    shared = {}
    for name in sorted(behind.robot.needed()):
        there = [t for t in behind.topics(name) if t.announced]
        zids = {e.bridge for t in there for e in (*t.publishers, *t.subscribers)}
        zids |= {server.bridge for server in (*behind.services(name), *behind.actions(name))}
        if len(zids) > 1:
            shared[name] = zids
    if shared:
        bridges = sorted(set[str]().union(*shared.values()))
        report.find("bridges_two", few([*shared]), robot=robot, number=len(bridges), zids=few(bridges))


def _check_nodes(report: Report, behind: PanelNames, bridges: Sequence[Bridge]) -> bool:
    """Whether the bridges see nodes, and any of what the panel needs."""
    topics = sum(len(graph.topics) for graph in behind.graphs)
    nodes = behind.nodes()
    domain = few(sorted({str(bridge.domain) for bridge in bridges}))
    # Limited to its machine and on another interface than the nodes, it learns their names at most.
    forwarded = any(topic.announced for graph in behind.graphs for topic in graph.topics)
    if any(map(_is_limited, bridges)) and not forwarded:
        report.find("bridge_localhost", robot=behind.robot.id, domain=domain)
        return False
    if not topics and not nodes:
        report.find("bridge_domain", robot=behind.robot.id, domain=domain)
        return False
    where = f"domain {domain}" if bridges else "the robot"
    report.fact(f"{where} has nodes: {len(nodes)}, and topics: {topics}")
    needed = behind.robot.needed()
    there = any(behind.topics(n) or behind.offers(n) or behind.has_node(n) for n in needed)
    if not there and (near := next(behind.elsewhere(needed), None)) is not None:
        report.find("robot_elsewhere", robot=behind.robot.id, found=near[0], namespace=near[1])
    return True


def _is_limited(bridge: Bridge) -> bool:
    """Whether its file limits it to its own machine."""
    limited = bridge.config.get("ros_automatic_discovery_range") == "Localhost"
    return limited or bridge.config.get("ros_localhost_only") is True


# The robot's clocks against this machine's: that of the bridge's machine, by Zenoh's time stamps, and
# that of the nodes, by the stamps in their headers. Pure.


def check_clocks(
    report: Report,
    robot: PanelRobot,
    observed: ReceivedSamples,
    interfaces: Interfaces,
    *,
    has_clock: bool = False,
) -> None:
    """`has_clock`: a node publishes `/clock`, so the stamps are not of a wall clock."""
    types = robot.panel.subscriptions()
    live = {
        topic: [sample for key in robot.possible_keys(topic) for sample in observed.live(key)]
        for topic in types
    }
    sent = [sample.sent - sample.wall for several in live.values() for sample in several if sample.sent]
    if not sent:
        report.find("clock_unknown", robot=robot.id, window=f"{observed.window_s:.1f}")
        return
    is_apart = _compare(report, robot.id, "the bridge's machine", sent)
    if has_clock:
        report.find("simulated_clock", CLOCK, robot=robot.id)
    if has_clock or is_apart:
        return  # the nodes' stamps are of that time, or would only say it again
    for topic, samples in live.items():
        stamps = [*_stamps(types[topic], samples, interfaces)]
        offsets = [stamp - wall for stamp, wall in stamps]
        if stamps and max(stamp for stamp, _ in stamps) < EARLIEST_S:
            report.find("simulated_time", topic, robot=robot.id)
        elif stamps and is_other_time(max(offsets)):
            days = f"{abs(max(offsets)) // OTHER_TIME_S:.0f}"
            direction = _direction(max(offsets))
            report.find("other_time", topic, robot=robot.id, days=days, direction=direction)
        elif stamps:
            _compare(report, robot.id, f"the stamps on {topic}", offsets)


def _compare(report: Report, robot: str, about: str, offsets: Iterable[float]) -> bool:
    """Whether a clock differs: delay only makes an offset smaller."""
    seconds = max(offsets)
    if not are_apart(seconds):
        report.fact(f"the clock of {about} is within {APART_S:g} s of this machine's")
        return False
    about_s = {"seconds": f"{abs(seconds):.1f}", "direction": _direction(seconds)}
    report.find("clock_differs", about, robot=robot, **about_s)
    return True


def _direction(seconds: float) -> Text:
    return say("finding_ahead" if seconds > 0 else "finding_behind")


def _stamps(
    type_name: str, samples: Iterable[Sample], interfaces: Interfaces
) -> Iterator[tuple[float, float]]:
    """(stamp, when it came) of messages that begin with a stamp; seconds since the epoch."""
    if begins_with_stamp(type_name, interfaces.structures):
        for sample in samples:
            if (stamp := first_stamp(bytes(sample.payload))) is not None:
                yield stamp, sample.wall


LISTEN_S: Final = 5.0
CONNECTED_WITHIN_S: Final = 4.0


@dataclass(frozen=True, slots=True)
class RobotLink:
    """A session with a robot, how robots of its kind are reached, and the names that it has."""

    session: ZenohSession
    access: RobotAccess
    dialect: Dialect

    async def graph(self, earlier: GraphSnapshot | None = None) -> GraphSnapshot:
        """The graph now, see `Observe`. LinkError without a link."""
        return await self.access.observe(self.session, self.session.zid, earlier)

    async def is_queryable(self) -> bool:
        """Whether what it is connected to answers the queries by which a panel sees that it is
        there."""
        queries = neighbour_queries(*self.session.neighbours())
        return all(await asyncio.gather(*(self.session.query_all(q, ASK_S) for q in queries)))

    def is_at_several(self, graph: GraphSnapshot) -> bool:
        """Whether it is connected to a router, and to another router or a bridge at the same time."""
        routers, peers = self.session.neighbours()
        bridges = {bridge.zid for bridge in graph.bridges}
        return len(routers | peers) > 1 and bool(routers - bridges)


async def check_connection(
    report: Report,
    robot_id: str,
    zenoh: Path,
    connect: tuple[str, ...],
    dialect: Dialect | None = None,
) -> list[str]:
    """Checks the Zenoh configuration and the link; returns the endpoints at which Zenoh answers."""
    endpoints = configured(report, zenoh, connect, robot_id)
    dialect = dialect or ROBOT_ACCESS[DEFAULT_DIALECT].dialect(0, any_hash)
    return await check_link(report, zenoh, endpoints, robot_id, dialect)


async def check_robot(
    report: Report, robot: PanelRobot, zenoh: Path, listen_s: float = LISTEN_S
) -> GraphSnapshot | None:
    """Adds all findings of a robot to the report. Returns its graph, None without a link."""
    connect = robot.entry.connect if robot.entry else ()
    dialect = ROBOT_ACCESS[robot.dialect].dialect(robot.domain, any_hash)
    endpoints = await check_connection(report, robot.id, zenoh, connect, dialect)
    if not endpoints:
        return None
    access, *others = await detect_access(robot.dialect, config_from(zenoh, endpoints), robot.domain)
    if others:
        report.find("link_two_kinds", ", ".join(endpoints), robot=robot.id)
        return None
    dialect = access.dialect(robot.domain, any_hash)
    session = await asyncio.to_thread(
        ZenohSession, config_from(zenoh, endpoints), lambda _: None, dialect
    )
    try:
        await session.connected(CONNECTED_WITHIN_S)
        return await _inspect(report, robot, RobotLink(session, access, dialect), endpoints, listen_s)
    except LinkError as error:
        report.find("zenoh_config", str(zenoh), robot=robot.id, detail=str(error))
        return None
    finally:
        with suppress(LinkError):
            await asyncio.to_thread(session.close)


async def _inspect(
    report: Report, robot: PanelRobot, link: RobotLink, endpoints: list[str], listen_s: float
) -> GraphSnapshot:
    """Listens to the topics first, then reads the graph: what ended in the meantime is not in it."""
    interfaces = load_interfaces(robot.panel.distro, robot.panel.interfaces)
    before = await link.graph()
    sentences = link.access.traits.sentences
    if not before.robots:
        report.find(sentences.absent, ", ".join(endpoints), robot=robot.id)
        return before
    if sentences.unqueryable and not await link.is_queryable():
        report.find(sentences.unqueryable, ", ".join(endpoints), robot=robot.id)
    if not check_graph(report, before, PanelNames.for_robot(robot, before)):
        return before
    received = await _receive(robot, link, before, listen_s)
    graph = await _later(link, before)
    if silent := graph.silent_since(before):
        for bridge in silent:
            report.find(sentences.silent, bridge, robot=robot.id)
        return before
    behind = PanelNames.for_robot(robot, graph)
    check_permissions(report, behind, received, interfaces)
    TopicChecks(report, behind, interfaces, PanelNames.for_robot(robot, before)).check()
    MapChecks(report, behind, received, interfaces).check()
    has_clock = any(behind.publishers(CLOCK))
    check_clocks(report, robot, received, interfaces, has_clock=has_clock)
    if link.is_at_several(graph):
        report.find("peer_at_routers", ", ".join(endpoints), robot=robot.id)
    elif graph.bridges:
        check_copies(report, robot, received)
    return graph


async def _later(link: RobotLink, before: GraphSnapshot) -> GraphSnapshot:
    """The graph now; empty if no peer answers."""
    try:
        return await link.graph(before)
    except LinkError:
        return GraphSnapshot()


def check_copies(report: Report, robot: PanelRobot, received: ReceivedSamples) -> None:
    """Reports topics of which a bridge sends each message more than once."""
    for topic in robot.panel.subscriptions():
        samples = [sample for key in robot.possible_keys(topic) for sample in received.live(key)]
        if (times := copies(samples)) > 1:
            report.find("bridge_piled_readers", topic, robot=robot.id, times=times)


async def _receive(
    robot: PanelRobot, link: RobotLink, graph: GraphSnapshot, longest_s: float
) -> ReceivedSamples:
    """Listens to the panel's topics until interlocks that are not latched, or have a max_age_s, have
    been received often enough."""
    panel, behind, dialect = robot.panel, PanelNames.for_robot(robot, graph), link.dialect
    topics = panel.subscriptions()
    expressions = {
        key: dialect.topic(key, type_name)
        for name, type_name in topics.items()
        for key in robot.possible_keys(name)
    }
    waited_for = {
        robot.key(interlock.topic)
        for interlock in panel.interlocks
        if interlock.max_age_s is not None
        or not any(end.qos.transient_local for end in behind.publishers(interlock.topic))
    }
    return await receive(link.session, dialect, expressions, waited_for, longest_s)
