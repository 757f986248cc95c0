"""Diagnoses one robot of a panel through its bridge: the link, the ROS graph, what the robot
publishes."""

import asyncio
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.diagnose.bridges import check_bridges
from app.diagnose.clocks import check_clocks
from app.diagnose.findings import Report
from app.diagnose.link import check_link, configured
from app.diagnose.names import NamesBehindBridge, PanelRobot
from app.diagnose.observation import Observation, copies, observe
from app.diagnose.permissions import check_permissions
from app.diagnose.topics import TopicChecks
from app.dialect.bridge_dialect import BridgeDialect
from app.errors import LinkError
from app.interfaces import load_interfaces
from app.survey.model import GraphSnapshot
from app.transport.bridge_graph_reader import first_graph, later_graph, silent
from app.transport.zenoh_config import config_from
from app.transport.zenoh_session import ZenohSession

LISTEN_S: Final = 5.0
CONNECTED_WITHIN_S: Final = 4.0


async def check_connection(
    report: Report, robot_id: str, zenoh: Path, connect: tuple[str, ...]
) -> list[str]:
    """Checks the Zenoh configuration and the link; returns the endpoints at which Zenoh answers."""
    endpoints = configured(report, zenoh, connect, robot_id)
    return await check_link(report, zenoh, endpoints, robot_id)


async def check_robot(
    report: Report, robot: PanelRobot, zenoh: Path, listen_s: float = LISTEN_S
) -> GraphSnapshot | None:
    """Adds all findings of a robot to the report. Returns its graph, None without a link."""
    connect = robot.entry.connect if robot.entry else ()
    endpoints = await check_connection(report, robot.id, zenoh, connect)
    if not endpoints:
        return None
    session = await asyncio.to_thread(
        ZenohSession, config_from(zenoh, endpoints), lambda _: None, BridgeDialect()
    )
    try:
        await session.connected(CONNECTED_WITHIN_S)
        return await _inspect(report, robot, session, endpoints, listen_s)
    except LinkError as error:
        report.find("zenoh_config", str(zenoh), robot=robot.id, detail=str(error))
        return None
    finally:
        with suppress(LinkError):
            await asyncio.to_thread(session.close)


async def _inspect(
    report: Report, robot: PanelRobot, session: ZenohSession, endpoints: list[str], listen_s: float
) -> GraphSnapshot:
    """Observes the topics first, then reads the graph: what ended in the meantime is not in it."""
    interfaces = load_interfaces(robot.panel.distro, robot.panel.interfaces)
    before = await first_graph(session, session.zid)
    if not check_bridges(report, before, NamesBehindBridge.of(robot, before), endpoints):
        return before
    observed = await _observe(robot, session, before, listen_s)
    graph = await _later(session, before)
    if gone := silent(before, graph):
        for bridge in gone:
            report.find("bridge_silent", bridge, robot=robot.id)
        return before
    behind = NamesBehindBridge.of(robot, graph)
    check_permissions(report, behind, observed, interfaces)
    TopicChecks(report, behind, interfaces, NamesBehindBridge.of(robot, before)).check()
    check_clocks(report, robot, observed, interfaces)
    check_copies(report, robot, observed)
    return graph


async def _later(session: ZenohSession, before: GraphSnapshot) -> GraphSnapshot:
    """The graph now; empty if no bridge answers."""
    try:
        return await later_graph(session, session.zid, before)
    except LinkError:
        return GraphSnapshot()


def check_copies(report: Report, robot: PanelRobot, observed: Observation) -> None:
    """Reports topics of which a bridge sends each message more than once."""
    for topic in robot.panel.subscriptions():
        samples = [one for key in robot.possible_keys(topic) for one in observed.live(key)]
        if (times := copies(samples)) > 1:
            report.find("bridge_piled_readers", topic, robot=robot.id, times=times)


async def _observe(
    robot: PanelRobot, session: ZenohSession, graph: GraphSnapshot, longest_s: float
) -> Observation:
    """Observes the panel's topics until interlocks that are not latched, or have a max_age_s, have been
    received often enough."""
    panel, behind, dialect = robot.panel, NamesBehindBridge.of(robot, graph), BridgeDialect()
    topics = panel.subscriptions()
    expressions = {
        key: dialect.topic(key, of) for name, of in topics.items() for key in robot.possible_keys(name)
    }
    waited_for = {
        robot.key(one.topic)
        for one in panel.interlocks
        if one.max_age_s is not None
        or not any(end.qos.transient_local for end in behind.publishers(one.topic))
    }
    return await observe(session, expressions, waited_for, longest_s)
