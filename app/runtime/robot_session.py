"""A running kiosk: one robot with its link, board and presses, and how they are wired.

Down: the inbox wakes the loop (by values: for a frame) → `_take` → robot → showing → board → streams.
"""

import asyncio
import logging
import time
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Final

from app.audit.press_record import Log, Logbook
from app.commands.actions.goals import Actions
from app.commands.actions.recovery import Resuming
from app.commands.confirmations import Confirmations
from app.commands.dispatch import Sending
from app.commands.holds.controller import Holds
from app.commands.parameters.sync import Parameters
from app.commands.press_context import Doubts
from app.commands.presses import Presses
from app.commands.service_calls import Calls
from app.errors import LinkError, NotFound
from app.interfaces import interfaces_of
from app.interfaces.names import ROSOUT_TOPIC
from app.panel.model import Panel, RobotEntry
from app.panel.widgets.parameter import Parameter
from app.permission.control_authority import Control
from app.permission.interlocks import Verdict, locked, way
from app.robot.slices import Slices
from app.robot.state import Reading, Robot
from app.ros_logging import RobotLog
from app.runtime.ingest import Intake
from app.transport.bridge_liveness import Pulse
from app.transport.graph_join import Joining
from app.transport.readiness import WITHIN_S, Asked
from app.transport.rosout import Rosout
from app.transport.zenoh_session import Config, Link
from app.view.refresh import Alone, Others, Showing

if TYPE_CHECKING:
    from app.recording import Recorder, Recordings

log = logging.getLogger("kiosk")

RENEW_AGAIN_S: Final = 1.0
ALONE: Final = Alone()


class Kiosk:
    """Opened by `start`, closed by `stop`; between them everything is on the event loop."""

    def __init__(
        self,
        panel: Panel,
        config: Config,
        revision: str,
        operators_log: Log,
        *,
        entry: RobotEntry | None = None,
        others: Others = ALONE,
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
        self.interfaces = interfaces_of(panel.distro, panel.interfaces)
        self._loop = asyncio.get_running_loop()
        self.link = Link(config, self._wake)
        self.robot = Robot(panel, self.interfaces, self.link.zid, entry, slices)
        self.robot.endpoints = self.link.endpoints
        self.robot.read_later = self._read_later
        self._log = RobotLog(log, self.robot.name)
        self.control = Control(panel.control, self.robot.name, tell=self._log.info)
        self.showing = Showing(
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
        self.show = self.showing.now
        self.board = self.showing.board
        self._recorder = self._recording(recordings)
        self._calls = Calls(self.interfaces, self.robot, self.link, self.show)
        self._actions = Actions(self.interfaces, self.robot, self.link, self.show)
        self._confirmations = Confirmations(self.robot, self.show)
        self._parameters = Parameters(
            panel, self.interfaces, self.robot, self.link, self._calls, self.show
        )
        self.doubts = Doubts(
            self.board, self.control, operators_log, panel.press_expires_s, others.boots
        )
        self.logbook = Logbook(operators_log, self.robot.name, lambda: self.board.id)
        self._resuming = Resuming(panel, self.robot, self.logbook, self._actions, self.show)
        self._pulse = Pulse(self.robot, self.link, self.show)
        self.reached = self._pulse.reached
        self.sending = Sending(
            panel,
            self.interfaces,
            self.robot,
            self.link,
            self._calls,
            self._actions,
            self._confirmations,
            self._parameters,
            reached=self._pulse.reached,
        )
        self.presses = Presses(
            panel,
            self.robot,
            self.sending,
            self.logbook,
            catch_up=self._take,
            news=lambda: self.link.hurried,
            witness=self._recorder,
        )
        self.holds = Holds(
            panel,
            self.interfaces,
            self.robot,
            self.link,
            self._loop,
            checked=self.sending.checked,
            take=self._take,
            news=lambda: self.link.hurried,
            changed=self.show,
            witness=self._recorder,
        )
        self._intake = Intake(
            panel,
            self.robot,
            self._actions,
            self._confirmations,
            self._parameters,
            self._recorder,
            self._log,
        )
        self._joining = Joining(panel, self.interfaces, self.robot, self.link, self.show, self._heal)
        self._asked = Asked(lambda: self._joining.answered(WITHIN_S))
        self._rosout = Rosout(self.robot, self.interfaces, self.link, self._loop)
        self._renewing: asyncio.Task[None] | None = None
        self._frame: asyncio.TimerHandle | None = None  # when what waits is taken
        self._lost = False
        self._stopped = False

    async def start(self) -> None:
        """Declares everything; whether anybody is there shows later."""
        await self._resuming.start()
        self.interfaces.prepare(
            {*self.panel.subscriptions().values(), *self.panel.publications().values()}
        )
        publish = [self.robot.key(topic) for topic in (*self.panel.publications(), ROSOUT_TOPIC)]
        listened = self._intake
        self.link.start(
            listened.keys,
            publish,
            prompt=listened.prompt,
            watched=listened.watched,
            whole=listened.whole,
        )
        self._rosout.start()
        self._joining.start()
        self._pulse.start()
        self._following.enter_context(self._operators_log.followed(self.show))

    async def stop(self) -> None:
        """Ends the streams, takes the session down; leaves no task behind."""
        self.close()
        self._stopped = True
        if self._frame is not None:
            self._frame.cancel()
        self._following.close()
        self._rosout.stop()
        self.showing.stop()
        self.doubts.end()
        if self._renewing is not None:
            await asyncio.gather(self._renewing, return_exceptions=True)
        await self._asked.stop()
        await self._pulse.stop()
        await self._joining.stop()
        await self._resuming.stop()
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
        self.board.close()

    def _recording(self, recordings: "Recordings | None") -> "Recorder | None":
        """What records around presses, where the panel asks for it."""
        if recordings is None or self.panel.record is None:
            return None
        from app.recording import Recorder

        recordings.follow(self.show)
        name = self.entry.id if self.entry else ""
        rules = self.panel.record
        return Recorder(self.panel, rules, self.interfaces, self.robot, name, recordings)

    @property
    def way(self) -> Verdict:
        """Whether commands can reach the robot now."""
        if self._operators_log.lock:
            return Verdict(False, "log", self._operators_log.lock)
        return way(self.robot, time.monotonic())

    async def way_asked(self) -> Verdict:
        """The same, when the bridges have been asked whether they run: a second at most."""
        if not self.way.permitted or await self._asked.answers():
            return self.way
        return locked("bridge_silent") if self.way.permitted else self.way

    def read_again(self, widget_id: str) -> str:
        """Asks the node of a parameter for it; why it can't be asked, or "". NotFound for other ids."""
        widget = self.sending.widget(widget_id)
        if not isinstance(widget, Parameter):
            raise NotFound(f'"{widget_id}" is not a parameter: there is nothing to read')
        return self._parameters.read_again(widget)

    def _heal(self) -> None:
        """A new session though there is a way: what is held gets its last message by the old one."""
        self.holds.end_all("hold_by_renewal")
        self.renew()

    def renew(self) -> None:
        """A new Zenoh session: until it is joined, nobody is known to be there."""
        self.robot.lose()
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
        if self.showing.due <= self._loop.time():
            self._take()
        elif self._frame is None:
            self._frame = self._loop.call_at(self.showing.due, self._take)

    def _take(self) -> None:
        if self._frame is not None:
            self._frame.cancel()
            self._frame = None
        if self._stopped:
            return
        self._pulse.look()
        changes = self.link.drain()
        if self.robot.link_up and not changes.link_up:
            self._log.warning("Zenoh link lost")
            self.renew()
            return
        came_up = not self.robot.link_up and changes.link_up
        if came_up:
            self.robot.link_up = True
            self._log.info("Zenoh link up")
        news = self._intake.take(changes, lambda: self.board.view["interlocks"], self.show)
        if changes.tokens:
            self._follow(news.came)
        if news.urgent or came_up:
            self.show()
        elif news.more:
            self.showing.soon()
        elif news.values:
            self.showing.values(news.values)

    def _read_later(self, key: str, reading: Reading) -> None:
        """What was too large for one turn is read."""
        if self._stopped:
            return
        match self._intake.read(key, reading, self.board.view["interlocks"]):
            case "now":
                self.show()
            case "soon":
                self.showing.soon()
            case _:
                self.showing.values({key})

    def _follow(self, came: bool) -> None:
        """After every change of the graph; `came`: there is a bridge where there was none."""
        self.robot.follow_publishers()
        self._calls.follow()
        self._actions.follow()
        self._parameters.follow()
        self._joining.follow(came)
