"""A session with one robot: wires its link, view and presses.

Data flow: the inbox wakes the event loop → `Turn` → robot, holds, confirmations, view → event streams.
"""

import asyncio
import logging
import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

from app.audit.press_record import Log, PressLog
from app.commands.control_acts import ControlActs
from app.commands.press_context import PressGuard
from app.errors import LinkError
from app.i18n import TextLike
from app.interfaces import load_interfaces
from app.interfaces.names import ROSOUT_TOPIC
from app.panel.model import Panel, RobotEntry
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.trend import trends_of
from app.permission.control_authority import ControlAuthority
from app.permission.interlocks import link_verdict
from app.permission.verdict import Verdict, locked
from app.robot.log_lines import LogListener
from app.robot.slices import Slices
from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.runtime.frames import Frames
from app.runtime.ingest import Ingest
from app.runtime.renewal import Renewal
from app.runtime.robot_commands import RobotCommands
from app.runtime.turn import Turn
from app.transport.declarations import declarations
from app.transport.peer import RobotAccess, RobotContext
from app.transport.rosout import Rosout
from app.transport.zenoh_config import Config
from app.transport.zenoh_session import ZenohSession
from app.view.refresh import NoOtherRobots, OtherRobots, ViewRefresher, ViewSources

if TYPE_CHECKING:
    from app.recording import Recorder, Recordings
    from app.trends.recorder import TrendRecorder

log = logging.getLogger("kiosk")

ALONE: Final = NoOtherRobots()


@dataclass(frozen=True, slots=True)
class ServerParts:
    """The parts that all sessions share; `revision` is that of the page's files, `root_path` that below
    which a proxy shows all pages."""

    panel: Panel
    revision: str
    operators_log: Log
    recordings: "Recordings | None" = None
    slices: Slices | None = None
    simulated: bool = False
    root_path: str = ""


class RobotSession:
    """The session with one robot, opened by `start`, closed by `stop`. Used on the event loop only."""

    def __init__(
        self,
        server: ServerParts,
        config: Config,
        access: RobotAccess,
        *,
        entry: RobotEntry | None = None,
        others: OtherRobots = ALONE,
    ) -> None:
        """`access` is how the robot is reached. If the panel has several robots, `entry` is this one
        and `others` gives access to all of them."""
        panel, operators_log = server.panel, server.operators_log
        self.panel = panel
        self.entry = entry
        self.base = server.root_path + (f"/robots/{entry.id}" if entry else "")
        self._operators_log = operators_log
        self._listeners = ExitStack()
        self.interfaces = load_interfaces(panel.distro, panel.interfaces)
        self.link = ZenohSession(config, lambda immediate: self._turn.wake(immediate), access.dialect)
        zid = self.link.zid
        self.robot = RobotState(panel, self.interfaces, access.dialect, zid, entry, server.slices)
        self.robot.endpoints = self.link.endpoints
        self._log = RobotLog(log, self.robot.name)
        self._renewal = Renewal(self.link, self.robot)
        context = RobotContext(
            panel,
            self.interfaces,
            self.robot,
            self.link,
            self.show,
            lambda: self._turn.on_graph_read(),
            self.renew,
            self.reopen,
        )
        self.control = ControlAuthority(
            panel.control,
            self.robot.title,
            log_line=self._log.info,
            on_hand_over=lambda hand_over: self.control_acts.log_hand_over(hand_over),
        )
        sources = ViewSources(self.control, operators_log, others, server.recordings, server.simulated)
        self.refresher = ViewRefresher(panel, self.robot, server.revision, sources)
        self.publisher = self.refresher.publisher
        self._recorder = self._recording(server.recordings)
        self._trends = self._trend_recorders()
        self.press_guard = PressGuard(
            self.publisher, self.control, operators_log, panel.press_expires_s, others.boots
        )
        self.press_log = PressLog(operators_log, self.robot.name, lambda: self.publisher.id)
        self.control_acts = ControlActs(
            self.control, self.press_guard, self.press_log, self.robot.name, self.show
        )
        self.peer = access.peer(context)
        self._commands = RobotCommands(
            context, self.peer, self.press_log, self._recorder, lambda: self._turn.run()
        )
        self.dispatcher = self._commands.dispatcher
        self.presses = self._commands.presses
        self.holds = self._commands.holds
        self._ingest = Ingest(
            panel,
            self.robot,
            self._commands.actions,
            self._commands.confirmations,
            self._commands.parameters,
            [
                self.robot.table_entries,
                LogListener(self.robot.log_lines),
                *([self._recorder] if self._recorder else []),
                *self._trends,
            ],
        )
        self._turn = Turn(context, self.peer, self._ingest, self._commands, self.refresher)
        self.robot.on_late_reading = self._turn.run_late_reading
        self.robot.table_entries.on_decoded = lambda key: self.refresher.refresh_values({key})
        self.frames = Frames(context, lambda: self.peer.on_graph_change(False))
        self._rosout = Rosout(
            self.robot, self.interfaces, self.link, asyncio.get_running_loop(), self._own_line
        )

    async def start(self) -> None:
        """Declares subscribers, publishers and queries. Does not wait for the robot."""
        await self._commands.start()
        self.interfaces.prepare_codecs(
            {*self.panel.subscriptions().values(), *self.panel.publications().values()}
        )
        declared = declarations(self.panel, self.interfaces, self.robot)
        ingest = self._ingest
        self.link.start(
            replace(
                declared,
                immediate=ingest.immediate,
                lossless=ingest.lossless,
                recorded=ingest.recorded,
            )
        )
        self._rosout.start()
        self.peer.start()
        self._listeners.enter_context(self._operators_log.notifying(self.show))

    async def stop(self) -> None:
        """Ends the streams, all tasks and the Zenoh session."""
        self.close()
        self.frames.close()
        self._turn.stop()
        self._listeners.close()
        self._rosout.stop()
        self.refresher.stop()
        self.press_guard.close()
        await self._renewal.stop()
        await self.peer.stop()
        await self._commands.stop()
        if self._recorder is not None:
            self._recorder.stop()
        for recorder in self._trends:
            recorder.stop()
        try:
            await asyncio.to_thread(self.link.close)
        except LinkError as error:
            self._log.warning("%s", error)

    def close(self) -> None:
        """Ends holds, while their stop messages can still be sent, presses and streams."""
        self._commands.close()
        self.publisher.close()

    def _recording(self, recordings: "Recordings | None") -> "Recorder | None":
        """The recorder, if the panel file has `[record]`."""
        if recordings is None or self.panel.record is None:
            return None
        from app.recording import Recorder

        recordings.add_listener(self.show)
        name = self.entry.id if self.entry else ""
        rules = self.panel.record
        return Recorder(self.panel, rules, self.interfaces, self.robot, name, recordings)

    def _own_line(self, payload: bytes) -> None:
        """The panel's own line in the robot's log: Zenoh does not bring it back."""
        key = self.robot.key(ROSOUT_TOPIC)
        if (lines := self.robot.log_lines.get(key)) is not None:
            lines.add(payload)
            self.refresher.refresh_values({key})

    def _trend_recorders(self) -> "list[TrendRecorder]":
        """The recorder of what trends show, if the panel has one."""
        if not trends_of(self.panel):
            return []
        from app.trends.recorder import TrendRecorder

        return [TrendRecorder(self.panel, self.interfaces, self.robot)]

    def show(self) -> None:
        """Updates holds and the view. Call it after a change of a permission or of anything shown."""
        self._turn.changed()

    @property
    def link_verdict(self) -> Verdict:
        """Whether commands can reach the robot now."""
        if self._operators_log.lock:
            return Verdict(False, "log", self._operators_log.lock)
        return link_verdict(self.robot, time.monotonic())

    async def check_readiness(self) -> Verdict:
        """`link_verdict` after a query of the bridges, which takes at most a second."""
        if not self.link_verdict.permitted or await self.peer.answers():
            return self.link_verdict
        return locked("bridge_silent") if self.link_verdict.permitted else self.link_verdict

    def read_again(self, widget_id: str) -> TextLike:
        """Queries the node of a parameter; returns why it can't be queried, else "". NotFound for other
        ids."""
        return self._commands.parameters.read_again(self.panel.widget(widget_id, Parameter))

    def reopen(self) -> None:
        """Replaces a working Zenoh session. The old one still sends the stop messages of holds."""
        self.holds.end_all("hold_by_renewal")
        self.renew()

    def renew(self) -> None:
        """Replaces the Zenoh session. Until the new one has joined, no endpoint is known."""
        self.robot.mark_link_lost()
        self._turn.on_graph_change(peer_appeared=False)
        self.show()
        self._renewal.begin()
