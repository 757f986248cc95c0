"""The `Peer` of a robot behind zenoh-bridge-ros2dds: how the panel joins its ROS graph, and what the
bridges are asked."""

import asyncio
import json
import logging
import math
import time
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from typing import Any, Final

from app.cell.link.bridge_admin import BridgeAdmin
from app.cell.link.declarations import LivelinessTokens
from app.cell.link.liveness import WITHIN_S, CoalescedQuery, PeerLiveness, wait_until_matched
from app.cell.link.peer import RobotAccess, RobotContext
from app.cell.robot.publishers import Publisher
from app.ros.dialects import bridge_dialect
from app.ros.dialects import bridge_entities as entities
from app.ros.dialects.bridge_dialect import BridgeDialect
from app.ros.dialects.bridge_entities import Writer
from app.ros.dialects.dialect import within
from app.ros.dialects.peer_traits import BRIDGE_TRAITS
from app.ros.graph.bridge_graph import observe_bridges
from app.system.concurrency import end_tasks, keep_running
from app.system.errors import LinkError
from app.system.log import RobotLog

# Asks the bridges for the publishers of the interlocks' topics.
#
# No token says that a second node publishes a topic, so the admin space is asked at intervals: of each
# topic its DDS writers, and the names of nodes when writers have changed.

ASK_EVERY_S: Final = 1.0  # where an interlock locks while there are several
ASK_SELDOM_S: Final = 5.0

Nodes = dict[tuple[Writer, str], tuple[str, ...]]  # (writer, topic's name) → nodes


class PublisherWatch:
    """Keeps the publishers of one robot's interlocks up to date."""

    def __init__(self, context: RobotContext, bridges: BridgeAdmin, log: RobotLog) -> None:
        self._robot = context.robot
        self._link = context.link
        self._changed = context.signals.changed.emit
        self._bridges = bridges
        self._log = log
        interlocks = context.panel.interlocks
        self._keys = sorted({self._robot.key(interlock.topic) for interlock in interlocks})
        is_needed = any(interlock.publishers == "one" for interlock in interlocks)
        self._every_s = ASK_EVERY_S if is_needed else ASK_SELDOM_S
        self._nodes: Nodes = {}
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        if self._keys:
            self._task = keep_running(self._run, self._log, "asking for publishers failed")

    async def stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)

    async def update(self) -> bool:
        """Asks once; returns whether publishers have changed. LinkError without a link."""
        publishers_of_topics = await asyncio.gather(*(self._publishers(key) for key in self._keys))
        changed = [
            self._robot.topic_publishers.update(key, publishers)
            for key, publishers in zip(self._keys, publishers_of_topics, strict=True)
        ]
        known = {
            (publisher.peer, publisher.guid)
            for publishers in publishers_of_topics
            for publisher in publishers
        }
        self._nodes = {at: n for at, n in self._nodes.items() if (at[0].zid, at[0].guid) in known}
        return any(changed)

    async def _run(self) -> None:
        while True:
            await asyncio.sleep(self._every_s)
            with suppress(LinkError):
                if self._robot.graph.peers and await self.update():
                    self._changed()

    async def _publishers(self, key: str) -> list[Publisher]:
        return [
            Publisher(writer.zid, writer.guid, await self._nodes_of(writer, name))
            for zid, name in self._names(key)
            for writer in await self._writers(zid, name)
        ]

    def _names(self, key: str) -> Iterator[tuple[str, str]]:
        """(bridge, name of the topic behind it)."""
        for zid in sorted(self._robot.graph.peers):
            namespace = self._bridges.namespaces.get(zid, "")
            if within(f"/{key}", namespace):
                yield zid, f"/{key}".removeprefix(namespace)

    async def _writers(self, zid: str, name: str) -> Collection[Writer]:
        answers = await self._link.query_all(entities.writers(zid, name))
        writers = (entities.writer_place(key) for key, _ in answers)
        return sorted({writer for writer in writers if writer is not None})

    async def _nodes_of(self, writer: Writer, name: str) -> tuple[str, ...]:
        """The nodes of a writer's process that publish the topic; asked for until they are known."""
        if known := self._nodes.get((writer, name)):
            return known
        answers = await self._link.query_all(entities.nodes_of(writer))
        nodes = [node for key, answer in answers if (node := _publishing(key, answer, name))]
        self._nodes[writer, name] = tuple(sorted(nodes))
        return self._nodes[writer, name]


def _publishing(key: str, answer: bytes, name: str) -> str:
    """The name of the node in an answer, if it publishes the topic; else ""."""
    place = entities.node_place(key)
    node: Any = None
    with suppress(ValueError):
        node = json.loads(answer)
    if place is None or not isinstance(node, dict):
        return ""
    return place[2] if name in {topic for topic, _ in entities.names_of(node, "publishers")} else ""


# Joins the ROS graph of a bridge: queries what it has, then declares liveliness tokens.
#
# A token makes the bridge create a DDS reader or writer. The tokens of what the panel publishes are
# held as long as there is a bridge, so that a topic is known before its first message and no message is
# lost. The first to create a route fixes its type and QoS for all. So a bridge that has just appeared
# gets time to discover the robot's nodes.

joining_log = logging.getLogger("kiosk.joining")

FAILED: Final = "joining the robot's topics failed"
FRESH_S: Final = 1.0  # waited for a bridge that appeared while the panel server ran
FOUND_WITHIN_S: Final = 1.0  # then it was there before: its replies arrive after all its tokens
SETTLE_S: Final = 0.2  # from the tokens to routes that carry the first message
ASK_JOINED_EVERY_S: Final = 5.0
ASK_AGAIN_S: Final = 0.5
UNROUTED_ALLOWED: Final = 3  # queries in a row that find a topic which its bridge does not read


class GraphMembership:
    """Holds the panel's tokens while there is a bridge, and queries the bridges' admin space."""

    def __init__(self, context: RobotContext) -> None:
        self._signals = context.signals
        self._panel = context.panel
        self._robot = context.robot
        self._log = RobotLog(joining_log, self._robot.name)
        self._link = context.link
        self._bridges = BridgeAdmin(self._robot, self._link)
        self._publishers = PublisherWatch(context, self._bridges, self._log)
        self._tokens = LivelinessTokens(self._panel, context.interfaces, self._robot)
        self._unrouted = 0
        self._started_at = time.monotonic()
        self._joining: asyncio.Task[None] | None = None
        self._asking: asyncio.Task[None] | None = None
        self._changed = asyncio.Event()

    def start(self) -> None:
        self._asking = keep_running(self._ask_regularly, self._log, FAILED)
        self._publishers.start()

    async def stop(self) -> None:
        """Ends its tasks. The tokens end with the session."""
        await self._publishers.stop()
        await end_tasks((self._joining, self._asking))

    def on_graph_change(self, peer_appeared: bool) -> None:
        """Joins, updates its tokens, or leaves. `peer_appeared`: there was no bridge before."""
        if peer_appeared or not self._robot.graph.peers:
            self._leave()
        if peer_appeared:
            self._joining = keep_running(self._join, self._log, FAILED)
        if self._joined:
            self._hold()
            self._changed.set()

    async def answered(self, within_s: float) -> bool:
        """Whether all of this robot's bridges answer a query within `within_s`. If not, all their data
        is queried again soon."""
        if await self._bridges.answered(within_s):
            return True
        self._changed.set()
        return False

    @property
    def _joined(self) -> bool:
        return self._robot.settled_at < math.inf

    def _hold(self) -> None:
        try:
            self._link.declare_tokens(self._tokens.own_tokens(self._link.zid))
        except LinkError as error:
            self._log.warning("%s", error)

    def _leave(self) -> None:
        self._tokens.forget()
        self._robot.settled_at = math.inf
        if self._joining is not None:
            self._joining.cancel()
            self._joining = None
        try:
            self._link.declare_tokens(())
        except LinkError as error:
            self._log.warning("%s", error)

    async def _join(self) -> None:
        if time.monotonic() - self._started_at >= FOUND_WITHIN_S:
            await asyncio.sleep(FRESH_S)
        await self._ask_until_answered()
        if not self._robot.graph.peers:
            return  # those that answered are other robots'
        self._hold()
        await self._settle()
        await self._ask_until_answered()
        with suppress(LinkError):
            await self._publishers.update()
        self._robot.settled_at = time.monotonic()
        self._log.info("joined the robot's topics")
        self._signals.graph_read.emit()

    async def _settle(self) -> None:
        """Waits until every subscriber in the graph is matched: then the routes carry the first
        message."""
        graph = self._robot.graph
        subscribed = [
            key
            for key in map(self._robot.key, self._panel.publications())
            if graph.has_endpoint("MS", key)
        ]
        await wait_until_matched(self._link, subscribed, SETTLE_S)

    async def _ask_until_answered(self) -> None:
        """Queries until every bridge has answered. Joins nothing before."""
        while True:
            try:
                await self._bridges.ask()
                if self._bridges.missed == 0:
                    return
            except LinkError as error:
                self._log.warning("%s", error)
            self._signals.changed.emit()
            await asyncio.sleep(ASK_AGAIN_S)

    async def _ask_regularly(self) -> None:
        """Queries the bridges at intervals; sooner after a missing reply or a change of the graph."""
        while True:
            await self._pause(
                ASK_AGAIN_S if self._bridges.missed or self._unrouted else ASK_JOINED_EVERY_S
            )
            if self._joined:
                try:
                    await self._bridges.ask()
                    if not self._robot.graph.peers:
                        self._leave()
                    elif self._joined:  # it may have left during the query
                        self._hold()
                        self._reopen_session()
                except LinkError as error:
                    self._log.warning("%s", error)
                self._signals.graph_read.emit()

    def _reopen_session(self) -> None:
        """Opens a new session if a bridge does not read a subscribed topic: for a new session it
        does."""
        subscribed = (self._robot.key(topic) for topic in self._panel.subscriptions())
        lost = [key for key in subscribed if self._robot.graph.is_unrouted(key)]
        self._unrouted = self._unrouted + 1 if lost else 0
        if self._unrouted >= UNROUTED_ALLOWED:
            self._unrouted = 0
            self._log.error("the bridge does not pass on %s: a new session", ", ".join(lost))
            self._signals.route_lost.emit()

    async def _pause(self, longest_s: float) -> None:
        """Waits until the next query is due: after `longest_s`, or shortly after a change of the
        graph."""
        with suppress(TimeoutError):
            async with asyncio.timeout(longest_s):
                await self._changed.wait()
                await asyncio.sleep(ASK_AGAIN_S)
        self._changed.clear()


# Whether a robot's bridges answer: they are asked for their versions.


class BridgeLiveness(PeerLiveness):
    """Detects whether one robot's bridges respond."""

    def queries(self) -> frozenset[str]:
        return frozenset(map(bridge_dialect.version, self.robot.graph.peers))

    def log_answer(self, log: RobotLog) -> None:
        log.info("the bridge answers")

    def log_silence(self, log: RobotLog) -> None:
        log.warning("the bridge does not answer")


# The `Peer` of a robot behind zenoh-bridge-ros2dds, which may have several bridges.

log = logging.getLogger("kiosk.bridge")


class BridgePeer:
    """The bridges of one robot: joined, watched, queried."""

    def __init__(self, context: RobotContext) -> None:
        self._log = RobotLog(log, context.robot.name)
        self._membership = GraphMembership(context)
        self._liveness = BridgeLiveness(context.robot, context.link, context.signals.changed.emit)
        self._readiness = CoalescedQuery(lambda: self._membership.answered(WITHIN_S))

    def start(self) -> None:
        self._membership.start()
        self._liveness.start()

    async def stop(self) -> None:
        await self._readiness.stop()
        await self._liveness.stop()
        await self._membership.stop()

    def appeared(self, zids: Iterable[str]) -> None:
        for zid in zids:
            self._log.info("bridge %s found", zid)

    def lost(self, zids: Iterable[str]) -> None:
        for zid in zids:
            self._log.warning("bridge %s lost", zid)

    def on_graph_change(self, peer_appeared: bool) -> None:
        self._membership.on_graph_change(peer_appeared)

    def check_stall(self) -> None:
        self._liveness.check_stall()

    async def flushed(self) -> bool:
        return await self._liveness.flushed()

    async def answers(self) -> bool:
        return await self._readiness.answers()


# A bridge has the domain and the hashes in its own configuration and messages.
BRIDGE: Final = RobotAccess(
    lambda _domain, _hash: BridgeDialect(), BRIDGE_TRAITS, BridgePeer, observe_bridges
)
