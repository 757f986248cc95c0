"""The `Peer` of a robot of which the panel file does not say how it is reached: a bridge or nodes on
rmw_zenoh, whichever is there.

What is there when the first of them is seen decides, until the session is lost. If both are there,
everything stays locked: a command would go to one of them, and no one said to which. A peer does not
see other peers through a router, which nodes are: a client is opened to look for them.
"""

import asyncio
import logging
import math
from collections.abc import Iterable
from contextlib import suppress
from typing import Final

from app.cell.link.bridge import BridgePeer
from app.cell.link.peer import Peer, RobotAccess, RobotContext
from app.cell.link.rmw_zenoh import RmwZenohPeer
from app.ros.dialects.auto_dialect import AutoDialect, Kind
from app.ros.dialects.bridge_dialect import EVERY_BRIDGE
from app.ros.dialects.dialect import any_hash
from app.ros.dialects.peer_traits import AMBIGUOUS_TRAITS, AUTO_TRAITS, PEER_TRAITS
from app.ros.dialects.rmw_zenoh import every_node
from app.ros.graph.bridge_graph import observe_bridges
from app.ros.graph.model import GraphSnapshot
from app.ros.graph.rmw_zenoh_graph import graph_of, observe_nodes
from app.ros.zenoh.answers import GraphLink
from app.ros.zenoh.config import Config, in_own_thread, tokens_for_clients
from app.system.concurrency import keep_running
from app.system.errors import LinkError
from app.system.log import RobotLog

log = logging.getLogger("kiosk.auto")

FAILED: Final = "finding out how the robot is reached failed"
LOOK_EVERY_S: Final = 1.0


class AutoPeer:
    """The peer of the kind that was chosen; before that, only locks."""

    def __init__(self, context: RobotContext) -> None:
        dialect = context.robot.dialect
        assert isinstance(dialect, AutoDialect)
        self._dialect = dialect
        self._context = context
        self._robot = context.robot
        self._link = context.link
        self._signals = context.signals
        self._log = RobotLog(log, context.robot.name)
        self._peers: dict[Kind, Peer] = {
            "bridge": BridgePeer(context),
            "rmw_zenoh": RmwZenohPeer(context),
        }
        self._robot.nodes_are_read = True  # of a bridge's, if it is one: until then no server is asked
        self._started: set[Kind] = set()
        self._chosen: Peer | None = None
        self._reopening = False  # by a choice, which stays
        self._changed = asyncio.Event()
        self._looking: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._looking = keep_running(self._look, self._log, FAILED)

    async def stop(self) -> None:
        if self._looking is not None:
            self._looking.cancel()
            await asyncio.gather(self._looking, return_exceptions=True)
        for kind in self._started:
            await self._peers[kind].stop()

    def appeared(self, zids: Iterable[str]) -> None:
        if self._chosen is not None:
            self._chosen.appeared(zids)

    def lost(self, zids: Iterable[str]) -> None:
        if self._chosen is not None:
            self._chosen.lost(zids)

    def on_graph_change(self, peer_appeared: bool) -> None:
        if not self._robot.link_up:
            if not self._reopening:
                self._forget_choice()
            self._reopening = False
        if self._chosen is not None:
            self._chosen.on_graph_change(peer_appeared)
            return
        if self._robot.traits is AMBIGUOUS_TRAITS:
            self._robot.graph.update_versions({})
        self._changed.set()

    def check_stall(self) -> None:
        if self._chosen is not None:
            self._chosen.check_stall()

    async def flushed(self) -> bool:
        return self._chosen is not None and await self._chosen.flushed()

    async def answers(self) -> bool:
        return self._chosen is not None and await self._chosen.answers()

    def _forget_choice(self) -> None:
        if self._chosen is None and self._robot.traits is AUTO_TRAITS:
            return
        if self._chosen is not None:
            self._chosen.on_graph_change(False)  # it leaves
        self._chosen, self._dialect.choice = None, None
        self._robot.traits, self._robot.nodes_are_read = AUTO_TRAITS, True
        self._robot.mark_link_lost()  # a graph without what was only of that kind

    async def _look(self) -> None:
        while True:
            every_s = LOOK_EVERY_S if self._chosen is None else None  # a choice ends with the link
            with suppress(TimeoutError):
                async with asyncio.timeout(every_s):
                    await self._changed.wait()
            self._changed.clear()
            if self._chosen is None and self._robot.link_up:
                try:
                    await self._choose_among(await self._kinds())
                except LinkError as error:
                    self._log.warning("%s", error)

    async def _kinds(self) -> set[Kind]:
        """The kinds of peers that are there now."""
        peers = _peers(self._dialect)
        others = await self._link.tokens_for_clients(peers)
        return _kinds_of((*self._robot.graph.peer_tokens, *others), self._dialect)

    async def _choose_among(self, kinds: set[Kind]) -> None:
        if not self._robot.link_up or self._chosen is not None:
            return
        traits = AMBIGUOUS_TRAITS if len(kinds) > 1 else AUTO_TRAITS
        if traits is not self._robot.traits:
            self._robot.traits = traits
            self._robot.graph.cache.clear()
            if traits is AMBIGUOUS_TRAITS:
                self._log.error("a bridge and nodes on rmw_zenoh are there: say `dialect`")
                self._robot.graph.update_versions({})
            self._signals.changed.emit()
        if len(kinds) == 1:
            await self._choose(kinds.pop())

    async def _choose(self, kind: Kind) -> None:
        for other in self._started - {kind}:
            await self._peers[other].stop()
        self._robot.is_responding = self._robot.is_caught_up = True
        if kind not in self._started:
            self._peers[kind].start()
        self._started = {kind}
        self._log.info("the robot is reached by %s", kind)
        before = self._dialect.current
        self._dialect.choice, self._chosen = kind, self._peers[kind]
        self._robot.traits = PEER_TRAITS[kind]
        self._robot.nodes_are_read = kind == "bridge"
        self._robot.settled_at = math.inf
        if self._dialect.current is before:
            self._chosen.on_graph_change(peer_appeared=True)
            self._signals.changed.emit()
        else:  # all key expressions are others
            self._reopening = True
            self._signals.link_lost.emit()


def _peers(dialect: AutoDialect) -> tuple[str, ...]:
    """The key expressions of the tokens of bridges and of nodes."""
    return EVERY_BRIDGE, every_node(dialect.nodes.domain)


def _kinds_of(tokens: Iterable[str], dialect: AutoDialect) -> set[Kind]:
    """The kinds of peers whose tokens are there; nodes of panels do not count."""
    kinds: set[Kind] = set()
    for token in tokens:
        if (end := dialect.nodes.endpoint(token)) and end.role is None:
            kinds.add("rmw_zenoh")
        elif (end := dialect.bridge.endpoint(token)) and end.role is None:
            kinds.add("bridge")
    return kinds


async def present_kinds(config: Config, domain: int) -> frozenset[Kind]:
    """The `KindsThere` of a robot whose dialect is not given."""
    dialect = AutoDialect(domain, any_hash)
    tokens = await in_own_thread(lambda: tokens_for_clients(config, _peers(dialect)))
    return frozenset(_kinds_of(tokens, dialect))


async def observe_either(
    link: GraphLink, zid: str, earlier: GraphSnapshot | None = None
) -> GraphSnapshot:
    """The `Observe` of the session of a panel, which was opened for the kind that is there."""
    tokens: list[str] = []
    with suppress(LinkError):  # a bridge is waited for
        tokens = await link.tokens()
    observe = observe_nodes if graph_of(tokens, zid).robots else observe_bridges
    return await observe(link, zid, earlier)


AUTO: Final = RobotAccess(AutoDialect, AUTO_TRAITS, AutoPeer, observe_either, present_kinds)
