"""The `Peer` of a robot whose nodes run on rmw_zenoh: without a bridge, the panel is a node among them.

A node stands for its Zenoh session. Nothing has to be made at the other end before the first message:
the panel joins by the tokens of its own node, and waits until the subscribers that the tokens show are
matched.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Final

from app.cell.link.liveness import CoalescedQuery, PeerLiveness, wait_until_matched
from app.cell.link.peer import RobotAccess, RobotContext
from app.cell.link.rosout import LOG_TYPE
from app.cell.robot.publishers import Publisher
from app.panel.model import Panel
from app.ros.dialects.auto_dialect import AutoDialect
from app.ros.dialects.dialect import PanelEndpoint
from app.ros.dialects.peer_traits import RMW_ZENOH_TRAITS
from app.ros.dialects.rmw_zenoh import PANEL_NODE, RmwZenohDialect, free_name
from app.ros.graph.rmw_zenoh_graph import observe_nodes
from app.ros.messages.names import ROSOUT, ROSOUT_TOPIC, Qos
from app.ros.zenoh.answers import neighbour_queries
from app.ros.zenoh.session import ZenohSession
from app.system.concurrency import keep_running
from app.system.errors import LinkError
from app.system.log import RobotLog

# The panel's own node among a robot's nodes: /web_ui, with its publishers, subscribers and clients as
# ROS tools list them. Nodes on rmw_zenoh need none of these tokens to exchange messages.


def panel_endpoints(panel: Panel, key: Callable[[str], str]) -> Iterator[PanelEndpoint]:
    """All that the node of a panel can have, with the QoS of the panel file. `key` makes the key of a
    name."""
    for topic, name in panel.publications().items():
        yield PanelEndpoint("MP", key(topic), name, panel.qos(topic).wire_qos)
    yield PanelEndpoint("MP", key(ROSOUT_TOPIC), LOG_TYPE, ROSOUT)
    for topic, name in panel.listened().items():
        yield PanelEndpoint("MS", key(topic), name, panel.qos(topic).wire_qos)
    for action, name in panel.actions().items():
        yield PanelEndpoint("AC", key(action), name)
    for service, name in panel.services().items():
        yield PanelEndpoint("SC", key(service), name)


class PanelNode:
    """The node of one robot's panel."""

    def __init__(self, context: RobotContext) -> None:
        self._panel = context.panel
        self._robot = context.robot
        self._link = context.link
        self.name = PANEL_NODE
        panel, key = context.panel, context.robot.key
        listened = panel.listened()
        self._any_durability = {key(topic) for topic in listened if panel.qos(topic).durability is None}
        self._adaptive = {key(topic) for topic in panel.adaptive_topics}

    def choose_name(self) -> None:
        """Takes the first name that no other panel on this robot has."""
        self.name = free_name({panel.node for panel in self._robot.graph.panels.values()})

    def give_way(self) -> bool:
        """Chooses again if a panel has the same name that joined at the same moment. Of two, the one
        with the greater zid does; returns whether it did."""
        panels = self._robot.graph.panels.values()
        if not any(p.node == f"/{self.name}" and p.zid < self._link.zid for p in panels):
            return False
        self.choose_name()
        return True

    def published_keys(self) -> list[str]:
        """The keys of the topics that the panel publishes, without its log."""
        return [self._robot.key(topic) for topic in self._panel.publications()]

    def tokens(self) -> list[str]:
        """All tokens that the panel holds now. What has another type on the robot is left out."""
        dialect, graph = self._robot.dialect, self._robot.graph
        assert isinstance(dialect, RmwZenohDialect | AutoDialect)
        own = [
            end
            for end in self._endpoints()
            if (end.role != "MP" and end.role != "MS")
            or graph.mismatched_type(end.role, end.key, end.type) is None
        ]
        return dialect.node_tokens(self._link.zid, self.name, own)

    def _endpoints(self) -> Iterator[PanelEndpoint]:
        panel = self._panel
        shown = panel.on_demand().keys() - panel.subscriptions().keys()
        on_demand = {self._robot.key(topic) for topic in shown}
        for end in panel_endpoints(panel, self._robot.key):
            if end.role != "MS":
                yield end
            elif end.key not in on_demand or end.key in self._robot.camera_topics:
                yield replace(end, qos=self._subscription_qos(end))

    def _subscription_qos(self, end: PanelEndpoint) -> Qos:
        """The panel's, with what it takes from the publisher."""
        graph, key, qos = self._robot.graph, end.key, end.qos
        if key in self._any_durability:
            qos = qos._replace(transient_local=graph.is_transient_local(key) or False)
        if key in self._adaptive and graph.is_reliable(key) is False:
            qos = qos._replace(reliable=False)
        return qos


log = logging.getLogger("kiosk.rmw_zenoh")

FAILED: Final = "joining the robot's topics failed"
SETTLE_S: Final = 0.05
ASK_AGAIN_S: Final = 0.5


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
        return neighbour_queries(routers, peers & self.robot.graph.peers)

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
            self._joining = keep_running(self._join, self._log, FAILED)
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
        if self._node.give_way():
            self._log.info("another panel has the same name: this one is %s", self._node.name)
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
        self._node.choose_name()
        self._hold()
        await self._settle()
        self._hold()
        self._robot.settled_at = time.monotonic()
        self._log.info("joined the robot's topics as %s", self._node.name)
        self._signals.graph_read.emit()

    async def _settle(self) -> None:
        """Waits until every subscriber in the graph is matched: then the first message arrives."""
        graph = self._robot.graph
        subscribed = [key for key in self._node.published_keys() if graph.has_endpoint("MS", key)]
        await wait_until_matched(self._link, subscribed, SETTLE_S)


RMW_ZENOH: Final = RobotAccess(RmwZenohDialect, RMW_ZENOH_TRAITS, RmwZenohPeer, observe_nodes)
