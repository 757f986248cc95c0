"""The `Peer` of a robot behind zenoh-bridge-ros2dds, which may have several bridges."""

import logging
from collections.abc import Iterable
from typing import Final

from app.dialect.bridge_dialect import BridgeDialect
from app.dialect.peer_traits import BRIDGE_TRAITS
from app.ros_logging import RobotLog
from app.transport.bridge_graph_reader import observe_bridges
from app.transport.bridge_join import GraphMembership
from app.transport.bridge_liveness import BridgeLiveness
from app.transport.peer import RobotAccess, RobotContext
from app.transport.readiness import WITHIN_S, CoalescedQuery

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
