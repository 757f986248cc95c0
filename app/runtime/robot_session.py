"""A session with one robot: opens, closes and renews what `wiring` has put together.

Data flow: the inbox wakes the event loop → `Turn` → robot, holds, confirmations, view → event streams.
"""

import asyncio
import logging
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from typing import Protocol

from app.alarms.engine import AlarmEngine
from app.audit.press_record import Log, PressLog
from app.commands.acts import ActRunner
from app.commands.diagnostic_acts import Doctor
from app.commands.dispatch import Dispatcher
from app.commands.holds.controller import HoldController
from app.commands.press_guard import PressGuard
from app.commands.presses import Presses
from app.commands.recipe_acts import RecipeBooks
from app.errors import LinkError
from app.i18n import TextLike
from app.interfaces import Interfaces
from app.panel.model import Panel, RobotEntry
from app.panel.widgets.parameter import Parameter
from app.permission.control_authority import ControlAuthority
from app.permission.interlocks import link_verdict
from app.permission.verdict import Verdict, locked
from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.runtime.frames import Frames
from app.runtime.graph_survey import GraphSurvey
from app.runtime.ingest import Ingest, SampleListener
from app.runtime.live_look import LiveLooks
from app.runtime.node_round_trips import NodeRoundTrips
from app.runtime.renewal import Renewal
from app.runtime.robot_commands import RobotCommands
from app.runtime.turn import Turn
from app.transport.declarations import Declarations, declarations
from app.transport.peer import Peer, RobotContext
from app.transport.rosout import Rosout
from app.transport.zenoh_session import ZenohSession
from app.view.publisher import ViewPublisher
from app.view.refresh import ViewRefresher

log = logging.getLogger("kiosk")


class SessionRecorder(SampleListener, Protocol):
    """A listener that keeps samples until it is stopped."""

    def stop(self) -> None: ...


@dataclass(eq=False, kw_only=True)
class RobotSession:
    """The session with one robot, opened by `start`, closed by `stop`. Used on the event loop only.
    `entry` is the robot's if the panel has several robots, `base` the path of its pages."""

    context: RobotContext
    entry: RobotEntry | None
    base: str
    operators_log: Log
    control: ControlAuthority
    control_acts: ActRunner[ControlAuthority]
    alarm_acts: ActRunner[AlarmEngine]
    recipe_acts: ActRunner[RecipeBooks]
    diagnostic_acts: ActRunner[Doctor]
    shift_acts: ActRunner[None]
    press_guard: PressGuard
    press_log: PressLog
    refresher: ViewRefresher
    peer: Peer
    commands: RobotCommands
    ingest: Ingest
    turn: Turn
    frames: Frames
    survey: GraphSurvey
    node_trips: NodeRoundTrips
    looks: LiveLooks
    renewal: Renewal
    rosout: Rosout
    recorders: Sequence[SessionRecorder]
    _listeners: ExitStack = field(default_factory=ExitStack, init=False)

    @property
    def panel(self) -> Panel:
        return self.context.panel

    @property
    def interfaces(self) -> Interfaces:
        return self.context.interfaces

    @property
    def robot(self) -> RobotState:
        return self.context.robot

    @property
    def link(self) -> ZenohSession:
        return self.context.link

    @property
    def publisher(self) -> ViewPublisher:
        return self.refresher.publisher

    @property
    def dispatcher(self) -> Dispatcher:
        return self.commands.dispatcher

    @property
    def presses(self) -> Presses:
        return self.commands.presses

    @property
    def holds(self) -> HoldController:
        return self.commands.holds

    async def start(self) -> None:
        """Declares subscribers, publishers and queries. Does not wait for the robot."""
        await self.commands.start()
        self.interfaces.prepare_codecs(
            {*self.panel.subscriptions().values(), *self.panel.publications().values()}
        )
        self.link.start(self._declared())
        self.rosout.start()
        self.peer.start()
        self._listeners.enter_context(self.operators_log.notifying(self.show))

    def _declared(self) -> Declarations:
        declared = declarations(self.panel, self.interfaces, self.robot)
        return replace(
            declared,
            immediate=self.ingest.immediate,
            lossless=self.ingest.lossless,
            recorded=self.ingest.recorded,
        )

    async def stop(self) -> None:
        """Ends the streams, all tasks and the Zenoh session."""
        self.close()
        self.frames.close()
        self.turn.stop()
        self._listeners.close()
        self.rosout.stop()
        self.refresher.stop()
        self.press_guard.close()
        await self.looks.stop()
        await self.survey.stop()
        await self.node_trips.stop()
        await self.renewal.stop()
        await self.peer.stop()
        await self.commands.stop()
        for recorder in self.recorders:
            recorder.stop()
        try:
            await asyncio.to_thread(self.link.close)
        except LinkError as error:
            RobotLog(log, self.robot.name).warning("%s", error)

    def close(self) -> None:
        """Ends holds, while their stop messages can still be sent, presses and streams."""
        self.commands.close()
        self.publisher.close()

    def show(self) -> None:
        """Updates holds and the view. Call it after a change of a permission or of anything shown."""
        self.turn.changed()

    @property
    def link_verdict(self) -> Verdict:
        """Whether commands can reach the robot now."""
        if self.operators_log.lock:
            return Verdict(False, "log", self.operators_log.lock)
        return link_verdict(self.robot, time.monotonic())

    async def check_readiness(self) -> Verdict:
        """`link_verdict` after a query of its peer, which takes at most a second."""
        if not self.link_verdict.permitted or await self.peer.answers():
            return self.link_verdict
        verdict, silent = self.link_verdict, self.robot.traits.sentences.silent
        return locked(silent) if verdict.permitted else verdict

    def read_again(self, widget_id: str) -> TextLike:
        """Queries the node of a parameter; returns why it can't be queried, else "". NotFound for other
        ids."""
        return self.commands.parameters.read_again(self.panel.widget(widget_id, Parameter))

    def reopen(self) -> None:
        """Replaces a working Zenoh session. The old one still sends the stop messages of holds."""
        self.holds.end_all(self.robot.traits.sentences.renewal)
        self.renew()

    def renew(self) -> None:
        """Replaces the Zenoh session. Until the new one has joined, no endpoint is known."""
        self.robot.mark_link_lost()
        self.turn.on_graph_change(peer_appeared=False)
        self.show()
        self.link.expect(self._declared())  # the dialect may be another one
        self.renewal.begin()
