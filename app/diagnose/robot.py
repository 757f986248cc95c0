"""One robot of a panel, looked at through its bridge: the way there, its graph, what it publishes."""

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.diagnose.bridges import check_bridges
from app.diagnose.clocks import check_clocks
from app.diagnose.findings import Report
from app.diagnose.link import check_link, configured
from app.diagnose.names import Behind, PanelRobot
from app.diagnose.permissions import check_permissions
from app.diagnose.topics import TopicChecks
from app.diagnose.watch import Watched, copies, watch
from app.dialect.bridge_dialect import BridgeDialect
from app.errors import LinkError
from app.graph.model import RosGraph
from app.interfaces import load_interfaces
from app.transport.bridge_graph_reader import first_graph, later_graph, silent
from app.transport.zenoh_config import config_from
from app.transport.zenoh_session import ZenohSession

LISTEN_S: Final = 5.0
CONNECTED_WITHIN_S: Final = 4.0


async def check_way(report: Report, robot_id: str, zenoh: Path, connect: tuple[str, ...]) -> list[str]:
    """The endpoints at which Zenoh answers."""
    endpoints = configured(report, zenoh, connect, robot_id)
    return await check_link(report, zenoh, endpoints, robot_id)


async def check_robot(
    report: Report, robot: PanelRobot, zenoh: Path, listen_s: float = LISTEN_S
) -> RosGraph | None:
    """Everything that can be found out of a robot; its graph, None where there is no way to it."""
    connect = robot.entry.connect if robot.entry else ()
    endpoints = await check_way(report, robot.id, zenoh, connect)
    if not endpoints:
        return None
    session = await asyncio.to_thread(
        ZenohSession, config_from(zenoh, endpoints), lambda _: None, BridgeDialect()
    )
    try:
        await session.connected(CONNECTED_WITHIN_S)
        return await _look(report, robot, session, endpoints, listen_s)
    except LinkError as error:
        report.find("zenoh_config", str(zenoh), robot=robot.id, detail=str(error))
        return None
    finally:
        with suppress(LinkError):
            await asyncio.to_thread(session.close)


async def _look(
    report: Report, robot: PanelRobot, session: ZenohSession, endpoints: list[str], listen_s: float
) -> RosGraph:
    """Listens first: what ended in the meantime is not in the graph after it any more."""
    interfaces = load_interfaces(robot.panel.distro, robot.panel.interfaces)
    before = await first_graph(session, session.zid)
    if not check_bridges(report, before, Behind.of(robot, before), endpoints):
        return before
    watched = await _watched(robot, session, before, listen_s)
    graph = await _later(session, before)
    if gone := silent(before, graph):
        for bridge in gone:
            report.find("bridge_silent", bridge, robot=robot.id)
        return before
    behind = Behind.of(robot, graph)
    check_permissions(report, behind, watched, interfaces)
    TopicChecks(report, behind, interfaces, Behind.of(robot, before)).check()
    check_clocks(report, robot, watched, interfaces)
    check_copies(report, robot, watched)
    return graph


async def _later(session: ZenohSession, before: RosGraph) -> RosGraph:
    """Empty if no answer comes."""
    try:
        return await later_graph(session, session.zid, before)
    except LinkError:
        return RosGraph()


def check_copies(report: Report, robot: PanelRobot, watched: Watched) -> None:
    """Whether a bridge reads a topic more than once for each message."""
    for topic in robot.panel.subscriptions():
        if (times := copies(watched.live(robot.key(topic)))) > 1:
            report.find("bridge_piled_readers", topic, robot=robot.id, times=times)


async def _watched(
    robot: PanelRobot, session: ZenohSession, graph: RosGraph, longest_s: float
) -> Watched:
    """Waits for permissions that are not latched, and for those that may not be old."""
    panel, behind, dialect = robot.panel, Behind.of(robot, graph), BridgeDialect()
    topics = panel.subscriptions()
    expressions = {robot.key(name): dialect.topic(robot.key(name), of) for name, of in topics.items()}
    waited_for = {
        robot.key(one.topic)
        for one in panel.interlocks
        if one.max_age_s is not None
        or not any(end.qos.transient_local for end in behind.publishers(one.topic))
    }
    return await watch(session, expressions, waited_for, longest_s)
