"""Joins the ROS graph of a bridge: queries what it has, then declares liveliness tokens.

A token makes the bridge create a DDS reader or writer. The tokens of what the panel publishes are held
as long as there is a bridge, so that a topic is known before its first message and no message is lost.
The first to create a route fixes its type and QoS for all. So a bridge that has just appeared gets time
to discover the robot's nodes.
"""

import asyncio
import logging
import math
import time
from contextlib import suppress
from typing import Final

from app.concurrency import end_tasks, spawn_logged
from app.errors import LinkError
from app.ros_logging import RobotLog
from app.transport.bridge_admin import BridgeAdmin
from app.transport.bridge_publishers import PublisherWatch
from app.transport.liveliness_tokens import LivelinessTokens
from app.transport.peer import RobotContext

log = logging.getLogger("kiosk.joining")

FAILED: Final = "joining the robot's topics failed"
FRESH_S: Final = 1.0  # waited for a bridge that appeared while the panel server ran
FOUND_WITHIN_S: Final = 1.0  # then it was there before: its replies arrive after all its tokens
SETTLE_S: Final = 0.2  # from the tokens to routes that carry the first message
SETTLE_MOST_S: Final = 2.0  # a press's receipt says if a subscriber is not matched by then
ASK_EVERY_S: Final = 5.0
ASK_AGAIN_S: Final = 0.5
UNROUTED_ALLOWED: Final = 3  # queries in a row that find a topic which its bridge does not read


class GraphMembership:
    """Holds the panel's tokens while there is a bridge, and queries the bridges' admin space."""

    def __init__(self, context: RobotContext) -> None:
        self._signals = context.signals
        self._panel = context.panel
        self._robot = context.robot
        self._log = RobotLog(log, self._robot.name)
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
        self._asking = spawn_logged(self._ask_regularly(), self._log, FAILED)
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
            self._joining = spawn_logged(self._join(), self._log, FAILED)
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
            self._link.declare_tokens(self._tokens.wanted(self._link.zid))
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
        end = time.monotonic() + SETTLE_MOST_S
        await asyncio.sleep(SETTLE_S)
        while time.monotonic() < end and not all(map(self._is_matched, subscribed)):
            await asyncio.sleep(SETTLE_S)

    def _is_matched(self, key: str) -> bool:
        try:
            return self._link.has_reader(key)
        except LinkError:
            return False

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
            await self._pause(ASK_AGAIN_S if self._bridges.missed or self._unrouted else ASK_EVERY_S)
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
