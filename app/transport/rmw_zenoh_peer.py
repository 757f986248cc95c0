"""The `Peer` of a robot whose nodes run on rmw_zenoh: without a bridge, the panel is a node among them.

A node stands for its Zenoh session. Nothing has to be made at the other end before the first message:
the panel joins by the tokens of its own node, and waits until the subscribers that the tokens show are
matched.
"""

import asyncio
import logging
import math
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

from app.concurrency import spawn_logged
from app.dialect.peer_traits import RMW_ZENOH_TRAITS
from app.dialect.rmw_zenoh_dialect import RmwZenohDialect
from app.errors import LinkError
from app.robot.topic_publishers import Publisher
from app.ros_logging import RobotLog
from app.transport.liveness import PeerLiveness
from app.transport.peer import RobotAccess, RobotContext
from app.transport.readiness import CoalescedQuery
from app.transport.rmw_zenoh_graph import observe_nodes
from app.transport.rmw_zenoh_node import PanelNode
from app.transport.zenoh_session import ZenohSession

log = logging.getLogger("kiosk.rmw_zenoh")

FAILED: Final = "joining the robot's topics failed"
SETTLE_S: Final = 0.05
SETTLE_MOST_S: Final = 2.0  # a press's receipt says if a subscriber is not matched by then
ASK_AGAIN_S: Final = 0.5
MOST_TRIES: Final = 20


class RouterLiveness(PeerLiveness):
    """Detects whether the way to the robot responds: its routers, or without a router the sessions of
    its nodes to which the panel is connected. They are asked by their admin space, which rmw_zenoh's
    configurations have switched on."""

    def __init__(self, context: RobotContext) -> None:
        super().__init__(context.robot, context.link, context.signals.changed.emit)
        self._session: ZenohSession = context.link

    def queries(self) -> frozenset[str]:
        try:
            routers, peers = self._session.neighbours()
        except LinkError:
            return frozenset()  # between two sessions
        if routers:
            return frozenset(f"@/{zid}/router" for zid in routers)
        return frozenset(f"@/{zid}/peer" for zid in peers & self.robot.graph.peers)

    def log_answer(self, log: RobotLog) -> None:
        log.info("the router answers")

    def log_silence(self, log: RobotLog) -> None:
        log.warning("the router does not answer")


class RmwZenohPeer:
    """The nodes of one robot: joined, watched, queried."""

    def __init__(self, context: RobotContext) -> None:
        self._robot = context.robot
        self._link = context.link
        self._signals = context.signals
        self._log = RobotLog(log, context.robot.name)
        self._node = PanelNode(context)
        self._liveness = RouterLiveness(context)
        self._readiness = CoalescedQuery(self._liveness.flushed)
        interlocks = context.panel.interlocks
        self._counted = sorted({self._robot.key(interlock.topic) for interlock in interlocks})
        self._joining: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._liveness.start()

    async def stop(self) -> None:
        await self._readiness.stop()
        await self._liveness.stop()
        if self._joining is not None:
            self._joining.cancel()
            await asyncio.gather(self._joining, return_exceptions=True)

    def appeared(self, zids: Iterable[str]) -> None:
        for zid in zids:
            self._log.info("nodes of session %s found", zid)

    def lost(self, zids: Iterable[str]) -> None:
        for zid in zids:
            self._log.warning("nodes of session %s lost", zid)

    def on_graph_change(self, peer_appeared: bool) -> None:
        graph = self._robot.graph
        if peer_appeared or not graph.peers:
            self._leave()
        # No bridge puts a namespace before their names.
        graph.update_namespaces(dict.fromkeys(graph.every_peer, ""))
        self._robot.update_shared_topics()
        for key in self._counted:
            self._robot.topic_publishers.update(key, self._publishers(key))
        if peer_appeared:
            self._joining = spawn_logged(self._join(), self._log, FAILED)
        if self._robot.settled_at < math.inf:
            self._hold()

    def check_stall(self) -> None:
        self._liveness.check_stall()

    async def flushed(self) -> bool:
        return await self._liveness.flushed()

    async def answers(self) -> bool:
        return await self._readiness.answers()

    def _publishers(self, key: str) -> list[Publisher]:
        """Each has a token of its own."""
        tokens = self._robot.graph.tokens_of("MP", key)
        return [Publisher(end.zid, token, (end.node,)) for token, end in tokens.items()]

    def _hold(self) -> None:
        try:
            self._link.declare_tokens(self._node.tokens())
        except LinkError as error:
            self._log.warning("%s", error)

    def _leave(self) -> None:
        self._robot.settled_at = math.inf
        if self._joining is not None:
            self._joining.cancel()
            self._joining = None
        with suppress(LinkError):
            self._link.declare_tokens(())

    async def _join(self) -> None:
        while not await self._liveness.flushed():  # before that, not all tokens have arrived
            await asyncio.sleep(ASK_AGAIN_S)
        for _ in range(MOST_TRIES):
            if await self._named():
                break
            await asyncio.sleep(SETTLE_S)
        self._hold()
        await self._settle()
        self._robot.settled_at = time.monotonic()
        self._log.info("joined the robot's topics as %s", self._node.name)
        self._signals.graph_read.emit()

    async def _named(self) -> bool:
        """Chooses a name that no other panel has; whether the tokens of others could be read. Zenoh may
        answer early, with none or few of them."""
        try:
            nodes = self._node.choose_name(await self._link.tokens())
        except LinkError as error:
            self._log.warning("%s", error)
            return False
        return self._robot.graph.nodes <= nodes

    async def _settle(self) -> None:
        """Waits until every subscriber in the graph is matched: then the first message arrives."""
        graph = self._robot.graph
        subscribed = [key for key in self._node.published_keys() if graph.has_endpoint("MS", key)]
        end = time.monotonic() + SETTLE_MOST_S
        await asyncio.sleep(SETTLE_S)
        while time.monotonic() < end and not all(map(self._is_matched, subscribed)):
            await asyncio.sleep(SETTLE_S)

    def _is_matched(self, key: str) -> bool:
        try:
            return self._link.has_reader(key)
        except LinkError:
            return False


RMW_ZENOH: Final = RobotAccess(RmwZenohDialect, RMW_ZENOH_TRAITS, RmwZenohPeer, observe_nodes)
