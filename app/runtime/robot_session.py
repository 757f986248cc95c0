"""A session with one robot: its link, view and presses, and how they are wired.

Down: the inbox wakes the loop (by values: for a frame) → `_take` → robot → showing → board → streams.
"""

import asyncio
import logging
import time
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Final

from app.audit.press_record import Log, PressLog
from app.commands.actions.goals import GoalTracker
from app.commands.actions.recovery import GoalRecovery
from app.commands.confirmations import Confirmations
from app.commands.dispatch import Dispatcher
from app.commands.holds.controller import HoldController
from app.commands.parameters.sync import ParameterSync
from app.commands.press_context import PressGuard
from app.commands.presses import Presses
from app.commands.service_calls import ServiceCalls
from app.errors import LinkError, NotFound
from app.i18n import TextLike
from app.interfaces import load_interfaces
from app.interfaces.names import ROSOUT_TOPIC
from app.panel.model import Panel, RobotEntry
from app.panel.widgets.parameter import Parameter
from app.permission.control_authority import ControlAuthority
from app.permission.interlocks import Verdict, link_verdict, locked
from app.robot.slices import Slices
from app.robot.state import Reading, RobotState
from app.ros_logging import RobotLog
from app.runtime.ingest import Ingest
from app.transport.bridge_liveness import BridgeLiveness
from app.transport.graph_join import GraphMembership
from app.transport.readiness import WITHIN_S, CoalescedQuery
from app.transport.rosout import Rosout
from app.transport.zenoh_session import Config, ZenohSession
from app.view.refresh import NoOtherRobots, OtherRobots, ViewRefresher

if TYPE_CHECKING:
    from app.recording import Recorder, Recordings

log = logging.getLogger("kiosk")

RENEW_AGAIN_S: Final = 1.0
ALONE: Final = NoOtherRobots()


class RobotSession:
    """Opened by `start`, closed by `stop`; between them everything is on the event loop."""

    def __init__(
        self,
        panel: Panel,
        config: Config,
        revision: str,
        operators_log: Log,
        *,
        entry: RobotEntry | None = None,
        others: OtherRobots = ALONE,
        recordings: "Recordings | None" = None,
        slices: Slices | None = None,
        simulated: bool = False,
    ) -> None:
        """`entry` is which of the panel's robots this is for, where it has several, `others` are
        then all of them. `revision` is of all that a page loads."""
        self.panel = panel
        self.entry = entry
        self.base = f"/robots/{entry.id}" if entry else ""
        self._operators_log = operators_log
        self._following = ExitStack()
        self.interfaces = load_interfaces(panel.distro, panel.interfaces)
        self._loop = asyncio.get_running_loop()
        self.link = ZenohSession(config, self._wake)
        self.robot = RobotState(panel, self.interfaces, self.link.zid, entry, slices)
        self.robot.endpoints = self.link.endpoints
        self.robot.on_late_reading = self._read_later
        self._log = RobotLog(log, self.robot.name)
        self.control = ControlAuthority(panel.control, self.robot.name, tell=self._log.info)
        self.refresher = ViewRefresher(
            panel,
            self.robot,
            revision,
            self.control,
            operators_log,
            others,
            before=lambda: self.holds.judge(),
            recordings_fault=lambda: recordings.fault if recordings else "",
            simulated=simulated,
        )
        self.show = self.refresher.now
        self.publisher = self.refresher.publisher
        self._recorder = self._recording(recordings)
        self._calls = ServiceCalls(self.interfaces, self.robot, self.link, self.show)
        self._actions = GoalTracker(self.interfaces, self.robot, self.link, self.show)
        self._confirmations = Confirmations(self.robot, self.show)
        self._parameters = ParameterSync(
            panel, self.interfaces, self.robot, self.link, self._calls, self.show
        )
        self.press_guard = PressGuard(
            self.publisher, self.control, operators_log, panel.press_expires_s, others.boots
        )
        self.press_log = PressLog(operators_log, self.robot.name, lambda: self.publisher.id)
        self._recovery = GoalRecovery(panel, self.robot, self.press_log, self._actions, self.show)
        self._liveness = BridgeLiveness(self.robot, self.link, self.show)
        self.reached = self._liveness.flushed
        self.dispatcher = Dispatcher(
            panel,
            self.interfaces,
            self.robot,
            self.link,
            self._calls,
            self._actions,
            self._confirmations,
            self._parameters,
            reached=self._liveness.flushed,
        )
        self.presses = Presses(
            panel,
            self.robot,
            self.dispatcher,
            self.press_log,
            catch_up=self._take,
            news=lambda: self.link.hurried,
            witness=self._recorder,
        )
        self.holds = HoldController(
            panel,
            self.interfaces,
            self.robot,
            self.link,
            self._loop,
            checked=self.dispatcher.checked,
            take=self._take,
            news=lambda: self.link.hurried,
            changed=self.show,
            witness=self._recorder,
        )
        self._ingest = Ingest(
            panel,
            self.robot,
            self._actions,
            self._confirmations,
            self._parameters,
            self._recorder,
            self._log,
        )
        self._membership = GraphMembership(
            panel, self.interfaces, self.robot, self.link, self.show, self._heal
        )
        self._readiness = CoalescedQuery(lambda: self._membership.answered(WITHIN_S))
        self._rosout = Rosout(self.robot, self.interfaces, self.link, self._loop)
        self._renewing: asyncio.Task[None] | None = None
        self._frame: asyncio.TimerHandle | None = None  # when what waits is taken
        self._lost = False
        self._stopped = False

    async def start(self) -> None:
        """Declares everything; whether anybody is there shows later."""
        await self._recovery.start()
        self.interfaces.prepare_codecs(
            {*self.panel.subscriptions().values(), *self.panel.publications().values()}
        )
        publish = [self.robot.key(topic) for topic in (*self.panel.publications(), ROSOUT_TOPIC)]
        listened = self._ingest
        self.link.start(
            listened.keys,
            publish,
            prompt=listened.prompt,
            watched=listened.watched,
            whole=listened.whole,
        )
        self._rosout.start()
        self._membership.start()
        self._liveness.start()
        self._following.enter_context(self._operators_log.notifying(self.show))

    async def stop(self) -> None:
        """Ends the streams, takes the session down; leaves no task behind."""
        self.close()
        self._stopped = True
        if self._frame is not None:
            self._frame.cancel()
        self._following.close()
        self._rosout.stop()
        self.refresher.stop()
        self.press_guard.end()
        if self._renewing is not None:
            await asyncio.gather(self._renewing, return_exceptions=True)
        await self._readiness.stop()
        await self._liveness.stop()
        await self._membership.stop()
        await self._recovery.stop()
        await self._actions.stop()
        await self._parameters.stop()
        if self._recorder is not None:
            self._recorder.stop()
        try:
            await asyncio.to_thread(self.link.close)
        except LinkError as error:
            self._log.warning("%s", error)

    def close(self) -> None:
        """Ends holds, while there is a way to say so to the robot, presses and streams."""
        self.holds.close()
        self.presses.close()
        self.publisher.close()

    def _recording(self, recordings: "Recordings | None") -> "Recorder | None":
        """What records around presses, where the panel asks for it."""
        if recordings is None or self.panel.record is None:
            return None
        from app.recording import Recorder

        recordings.add_listener(self.show)
        name = self.entry.id if self.entry else ""
        rules = self.panel.record
        return Recorder(self.panel, rules, self.interfaces, self.robot, name, recordings)

    @property
    def link_verdict(self) -> Verdict:
        """Whether commands can reach the robot now."""
        if self._operators_log.lock:
            return Verdict(False, "log", self._operators_log.lock)
        return link_verdict(self.robot, time.monotonic())

    async def way_asked(self) -> Verdict:
        """The same, when the bridges have been asked whether they run: a second at most."""
        if not self.link_verdict.permitted or await self._readiness.answers():
            return self.link_verdict
        return locked("bridge_silent") if self.link_verdict.permitted else self.link_verdict

    def read_again(self, widget_id: str) -> TextLike:
        """Asks the node of a parameter for it; why it can't be asked, or "". NotFound for other ids."""
        widget = self.dispatcher.widget(widget_id)
        if not isinstance(widget, Parameter):
            raise NotFound(f'"{widget_id}" is not a parameter: there is nothing to read')
        return self._parameters.read_again(widget)

    def _heal(self) -> None:
        """A new session though there is a way: what is held gets its last message by the old one."""
        self.holds.end_all("hold_by_renewal")
        self.renew()

    def renew(self) -> None:
        """A new Zenoh session: until it is joined, nobody is known to be there."""
        self.robot.mark_link_lost()
        self._follow(came=False)
        self.show()
        self._lost = True
        if self._renewing is None:
            self._renewing = self._loop.create_task(self._renew())

    async def _renew(self) -> None:
        """Until there is a session that was not lost while it was opened."""
        while self._lost and not self._stopped:
            self._lost = False
            try:
                await asyncio.to_thread(self.link.renew)
            except Exception as error:  # whatever Zenoh makes of it: without a session all is locked
                self._log.error("%s", error)
                self._lost = True
                await asyncio.sleep(RENEW_AGAIN_S)
        self.robot.graph.own_zid = self.link.zid
        self._renewing = None

    # Down.

    def _wake(self, prompt: bool) -> None:
        """On a thread of Zenoh's; what is not prompt waits for the next frame."""
        with suppress(RuntimeError):  # the loop is closed: the process ends
            self._loop.call_soon_threadsafe(self._take if prompt else self._take_in_time)

    def _take_in_time(self) -> None:
        if self.refresher.due <= self._loop.time():
            self._take()
        elif self._frame is None:
            self._frame = self._loop.call_at(self.refresher.due, self._take)

    def _take(self) -> None:
        if self._frame is not None:
            self._frame.cancel()
            self._frame = None
        if self._stopped:
            return
        self._liveness.look()
        changes = self.link.drain()
        if self.robot.link_up and not changes.link_up:
            self._log.warning("Zenoh link lost")
            self.renew()
            return
        came_up = not self.robot.link_up and changes.link_up
        if came_up:
            self.robot.link_up = True
            self._log.info("Zenoh link up")
        news = self._ingest.take(changes, lambda: self.publisher.view["interlocks"], self.show)
        if changes.tokens:
            self._follow(news.came)
        if news.urgent or came_up:
            self.show()
        elif news.more:
            self.refresher.soon()
        elif news.values:
            self.refresher.values(news.values)

    def _read_later(self, key: str, reading: Reading) -> None:
        """What was too large for one turn is read."""
        if self._stopped:
            return
        match self._ingest.read(key, reading, self.publisher.view["interlocks"]):
            case "now":
                self.show()
            case "soon":
                self.refresher.soon()
            case _:
                self.refresher.values({key})

    def _follow(self, came: bool) -> None:
        """After every change of the graph; `came`: there is a bridge where there was none."""
        self.robot.update_publishers()
        self._calls.follow()
        self._actions.follow()
        self._parameters.follow()
        self._membership.follow(came)
