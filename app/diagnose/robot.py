"""Diagnoses one robot of a panel: the link to it, the ROS graph, what the robot publishes."""

import asyncio
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.diagnose.bridges import check_graph
from app.diagnose.clocks import check_clocks
from app.diagnose.findings import Report
from app.diagnose.link import check_link, configured
from app.diagnose.names import PanelNames, PanelRobot
from app.diagnose.permissions import check_permissions
from app.diagnose.received import ReceivedSamples, copies, receive
from app.diagnose.topics import TopicChecks
from app.dialect.dialect import DEFAULT_DIALECT, Dialect, any_hash
from app.errors import LinkError
from app.interfaces import load_interfaces
from app.runtime.robot_access import ROBOT_ACCESS, access_there
from app.survey.model import GraphSnapshot
from app.transport.peer import RobotAccess
from app.transport.zenoh_config import config_from
from app.transport.zenoh_session import ZenohSession

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
    access, *others = await access_there(robot.dialect, config_from(zenoh, endpoints), robot.domain)
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
    check_clocks(report, robot, received, interfaces)
    if graph.bridges:
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
