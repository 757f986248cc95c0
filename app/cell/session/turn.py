"""One turn of a robot's session: inbox → robot's state → control → alarms → holds → confirmations →
view.

Only this module defines the order. Holds and confirmations do not depend on the view: a slow or failing
view never delays the end of a hold.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from app.cell.alarms.engine import AlarmEngine
from app.cell.alarms.published import AlarmEntry
from app.cell.alarms.shown import AlarmRow, panel_id
from app.cell.alarms.sources import link_state
from app.cell.alarms.states import AlarmInstance
from app.cell.commands.confirmations import Confirmations
from app.cell.commands.dispatch import Dispatcher, Trackers
from app.cell.commands.goals import GoalRecovery, GoalTracker
from app.cell.commands.holds import HoldController, HoldMessages
from app.cell.commands.judge import PendingSamples, PressGuard, PressJudge
from app.cell.commands.parameters import ParameterSync
from app.cell.commands.presses import Presses
from app.cell.commands.receipts import PressRecorder, Receipt
from app.cell.commands.recipe_loads import Books, RecipeLoader
from app.cell.commands.services import OptionLists, ServiceCalls
from app.cell.link.peer import Peer, RobotContext, Signal
from app.cell.permission.control import ControlAuthority
from app.cell.permission.press_permission import combined
from app.cell.permission.verdict import Verdict, locked
from app.cell.robot.alarmed import AlarmAction, AlarmedValues, AlarmSelection
from app.cell.robot.sample_handlers import SampleHandlers
from app.cell.robot.state import Reading, RobotState
from app.cell.session.ingest import Ingest, Updates
from app.cell.view.refresh import ViewRefresher
from app.records.press_record import PressLog
from app.system.log import RobotLog
from app.system.texts import say

if TYPE_CHECKING:
    from app.cell.history.recording import Recorder


# Wires the commands of one robot: presses, holds and their trackers.


class StopReceipts:
    """Gives presses and receipts to the recorder, None for none. What the robot has aborted is a
    stop."""

    def __init__(self, recorder: PressRecorder | None, on_stop: Callable[[], None]) -> None:
        self._recorder = recorder
        self._on_stop = on_stop

    def record_press(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None:
        if self._recorder is not None:
            self._recorder.record_press(press_id, widget, who, inputs)

    def record_receipt(self, receipt: Receipt) -> None:
        if receipt.outcome == "aborted":
            self._on_stop()
        if self._recorder is not None:
            self._recorder.record_receipt(receipt)


class RobotCommands:
    """The commands of one robot, opened by `start`, ended by `close` and `stop`. Used on the event loop
    only."""

    def __init__(
        self,
        context: RobotContext,
        peer: Peer,
        press_guard: PressGuard,
        press_log: PressLog,
        recorder: "Recorder | None",
        books: Books,
    ) -> None:
        panel, interfaces, robot, link = context.panel, context.interfaces, context.robot, context.link
        changed, status_set = context.signals.changed.emit, context.signals.status_set.emit
        self.recorder = recorder
        self.calls = ServiceCalls(interfaces, robot, link, status_set)
        self.actions = GoalTracker(interfaces, robot, link, status_set)
        self.confirmations = Confirmations(robot, status_set)
        self.parameters = ParameterSync(panel, interfaces, robot, link, self.calls, changed)
        self.option_lists = OptionLists(panel, interfaces, robot, link, changed)
        self.sample_handlers = SampleHandlers()
        self.actions.register(self.sample_handlers, panel.actions())
        self.confirmations.register(self.sample_handlers, panel.confirmations())
        self.parameters.register(self.sample_handlers)
        self._recovery = GoalRecovery(panel, robot, press_log, self.actions, changed)
        self.dispatcher = Dispatcher(
            panel,
            interfaces,
            robot,
            link,
            Trackers(
                self.calls,
                self.actions,
                self.confirmations,
                self.parameters,
                RecipeLoader(interfaces, robot, self.parameters, books, status_set),
            ),
            flushed=peer.flushed,
        )
        arrivals = PendingSamples(
            context.signals.judging.emit,
            lambda: any(each.has_immediate for each in (link, *context.awaited)),
        )
        judge = PressJudge(panel, robot, press_guard, arrivals)
        observed = StopReceipts(recorder, context.signals.stopped.emit)
        self.presses = Presses(judge, self.dispatcher, press_log, robot.name, observed)
        self.holds = HoldController(
            panel,
            robot,
            judge,
            HoldMessages(interfaces, robot, link, self.dispatcher.check_inputs),
            asyncio.get_running_loop(),
            changed=changed,
            recorder=observed,
        )

    async def start(self) -> None:
        """Resumes goals that were sent before the server's start. Call it before anything arrives."""
        await self._recovery.start()

    def on_graph_change(self) -> None:
        """Call it after every change of the graph."""
        self.calls.on_graph_change()
        self.actions.on_graph_change()
        self.parameters.on_graph_change()
        self.option_lists.on_graph_change()

    def close(self) -> None:
        """Ends holds, while their stop messages can still be sent, and refuses presses."""
        self.holds.close()
        self.presses.close()

    async def stop(self) -> None:
        """Ends the tasks. Goals continue on the robot."""
        await self._recovery.stop()
        await self.actions.stop()
        await self.parameters.stop()
        await self.option_lists.stop()


# The alarms as a robot's session has them: what its turn tells them, and which controls they lock.


class RobotAlarms:
    """The alarms of one robot. Used on the event loop only."""

    def __init__(
        self,
        engine: AlarmEngine,
        robot_id: str,
        robot: RobotState,
        evaluate: Callable[[], None],
        nodes: Sequence[str] = (),
    ) -> None:
        """`evaluate` is called when alarms may be due; `nodes` are those whose loss is an alarm."""
        self.evaluation_began = Signal[[]]()  # alarms are evaluated from now on
        self.rows_changed = Signal[[]]()  # the alarms that pages show have changed
        self.stopped = Signal[[]]()  # an alarm was raised that has a story of a stop
        self.locks_changed = Signal[[]]()  # alarms lock other controls than before
        self.marks_changed = Signal[[Collection[str]]]()  # of values of topics with these keys
        self.robot_id = robot_id
        self._engine = engine
        self._robot = robot
        self._evaluate = evaluate
        self._nodes = nodes
        self._link: tuple[Any, ...] = ()
        self._locks: Mapping[str, Verdict] = {}
        self._locks_version = -1

    def update(self, topics: Collection[str]) -> None:
        """Messages arrived on topics with these keys, or something else has changed."""
        self._engine.topics_changed(self.robot_id, topics)
        link = link_state(self._robot, time.monotonic(), self._nodes)
        if link != self._link:
            self._link = link
            self._engine.robot_changed(self.robot_id)
        self._evaluate()

    def entries_received(
        self,
        alarm_id: str,
        entries: Sequence[AlarmEntry],
        at: float,
        is_last: bool,
        earlier: Collection[str],
        unread: int = 0,
    ) -> None:
        """The robot published alarms itself: see the engine's function of this name."""
        self._engine.entries_received(self.robot_id, alarm_id, entries, at, is_last, earlier, unread)
        self._evaluate()

    def has_begun(self) -> bool:
        """Whether alarms are evaluated: those of before were read."""
        return self._engine.has_begun

    def show(self, rows: Iterable[AlarmRow], selections: Mapping[str, AlarmSelection]) -> None:
        """The rows of all robots' alarms have changed, the most urgent first. `selections` are those
        that widgets show."""
        self._robot.alarm_selections = selections
        own = (row for row in rows if row["robot"] == self.robot_id and _stands(row))
        self._robot.alarm_actions = tuple(
            AlarmAction(panel_id(row["id"]), row["action"], row["picture"]) for row in own
        )
        self.rows_changed.emit()

    def show_marks(self, marks: AlarmedValues, topics: Collection[str]) -> None:
        """The values of topics have other marks than before."""
        self._robot.alarmed = marks
        self.marks_changed.emit({key for topic in topics for key in self._robot.possible_keys(topic)})

    def inhibited(self) -> Mapping[str, Verdict]:
        """The locks by alarms, by the widgets' ids."""
        if self._locks_version != self._engine.lock_changes:
            self._locks_version = self._engine.lock_changes
            inhibited = self._engine.inhibited(self.robot_id)
            self._locks = {
                widget: combined([self._lock(alarm) for alarm in alarms])
                for widget, alarms in inhibited.items()
            }
        return self._locks

    def _lock(self, alarm: AlarmInstance) -> Verdict:
        """The lock with the alarm's text and what to do; of another robot's alarm with its robot."""
        name, action, robot = alarm.text, alarm.action, alarm.definition.robot
        if robot != self.robot_id:
            name = say("alarm_of_robot", name=name, robot=self._engine.robots[robot].title)
        _, is_unknown, _ = alarm.lock
        if is_unknown:
            return locked("alarm_inhibits_unknown", name=name)
        if not action:
            return locked("alarm_inhibits", name=name)
        reason = say("alarm_inhibits_action", name=name, action=action)
        return Verdict(False, "alarm_inhibits", reason)


def _stands(row: AlarmRow) -> bool:
    """Whether something is to be done about an alarm now."""
    return row["state"] in ("active", "latched")


log = logging.getLogger("kiosk")

IDLE_S: Final = 1.0  # until data of topics that no one looks at is ingested
LATEST_S: Final = 0.04  # until data that waits for a frame is ingested, also where frames are rare


class Turn:
    """The turns of one robot. Used on the event loop only, except `wake`."""

    def __init__(
        self,
        context: RobotContext,
        peer: Peer,
        control: ControlAuthority,
        ingest: Ingest,
        commands: RobotCommands,
        refresher: ViewRefresher,
        alarms: RobotAlarms,
    ) -> None:
        self._link = context.link
        self._robot = context.robot
        self._link_lost, self._ran = context.signals.link_lost, context.signals.ran
        self._stepped = context.signals.stepped
        self._peer = peer
        self._control = control
        self._ingest = ingest
        self._commands = commands
        self._refresher = refresher
        self._alarms = alarms
        self._log = RobotLog(log, self._robot.name)
        self._loop = asyncio.get_running_loop()
        self._frame: asyncio.TimerHandle | None = None  # the turn that is scheduled for the next frame
        self._idle: asyncio.TimerHandle | None = None
        self._control_timer: asyncio.TimerHandle | None = None
        self._control_due = math.inf  # when the turn of `_control_timer` runs, in monotonic seconds
        self._running = False
        self._again = False  # something changed that no step of a turn may have shown
        self._stopped = False

    def stop(self) -> None:
        """Runs no further turns."""
        self._stopped = True
        self._cancel_frame()
        for timer in (self._idle, self._control_timer):
            if timer is not None:
                timer.cancel()

    def wake(self, immediate: bool) -> None:
        """Called on Zenoh's threads. Data that is not `immediate` waits for the next frame."""
        with suppress(RuntimeError):  # the loop is closed: the process ends
            self._loop.call_soon_threadsafe(self.run if immediate else self._run_by_frame)

    def _run_by_frame(self) -> None:
        if self._refresher.due <= self._loop.time():
            self.run()
        elif self._frame is None:
            latest = self._loop.time() + LATEST_S
            self._frame = self._loop.call_at(min(self._refresher.due, latest), self.run)

    def watch(self, idle: Collection[str]) -> None:
        """From now on no one looks at the topics with these keys. What has arrived of the others is
        ingested first."""
        if self._stopped:
            return
        self._link.set_idle(idle)
        if not self._running:
            self.run()
        if idle and self._idle is None:
            self._idle = self._loop.call_later(IDLE_S, self._run_for_idle)

    def _run_for_idle(self) -> None:
        """Keeps rates and ages of what no one looks at."""
        self._idle = self._loop.call_later(IDLE_S, self._run_for_idle)
        if self._link.has_idle:
            self.run(whole=True)

    def run(self, whole: bool = False) -> None:
        """Runs a turn with everything that has arrived so far; what no one looks at waits, unless
        `whole`."""
        self._cancel_frame()
        if self._stopped:
            return
        self._peer.check_stall()
        changes = self._link.drain(whole)
        came_up = not self._robot.link_up and changes.link_up
        if self._robot.link_up and not changes.link_up:
            self._log.warning("Zenoh link lost")
            self._link_lost.emit()
            return
        if changes.reopen:  # what it waited for is there
            self._link_lost.emit()
            return
        if came_up:
            self._robot.link_up = True
            self._again = True  # the first step shows it
            self._log.info("Zenoh link up")
        self._run_steps(self._ingest.steps(changes))

    def run_late_reading(self, key: str, reading: Reading) -> None:
        """Runs a turn for a message that took more than one turn to decode."""
        if not self._stopped:
            self._run_steps([self._ingest.late_reading(key, reading)])

    def changed(self) -> None:
        """Runs a turn after a change that no data caused: of the peer, a command, or control."""
        if self._running:
            self._again = True
            return
        self._run_steps([Updates(urgent=True)])

    def status_set(self, widget: str) -> None:
        """Runs a turn after the status of a command was set: of the view only its widget is built."""
        if self._running:
            self._again = True
            return
        self._run_steps([Updates(commands={widget})])

    def on_graph_change(self, peer_appeared: bool) -> None:
        """Updates everything after a change of the graph; `peer_appeared`: there was no peer before."""
        self._robot.update_publishers()
        self._commands.on_graph_change()
        self._peer.on_graph_change(peer_appeared)

    def on_graph_read(self) -> None:
        """Updates everything after the nodes of the graph were read: what they are may be known now."""
        self._robot.starting_until = -math.inf
        self._robot.update_nodes()
        self._commands.on_graph_change()
        self.changed()

    def _run_steps(self, steps: Iterable[Updates]) -> None:
        """Runs the steps of a turn. Changes during it are shown at its end, or in one more turn."""
        running, self._running = self._running, True
        try:
            self._control.advance()
            for updates in steps:
                self._apply(updates)
        finally:
            self._running = running
            self._ran.emit()
            if self._again and not running:
                self._again = False
                self._loop.call_soon(self.changed)
            self._schedule_control()

    def _apply(self, updates: Updates) -> None:
        """Updates alarms, holds, confirmations, then the view, from the robot's current state."""
        if updates.graph:
            self._peer.lost(updates.peers_lost)
            self._peer.appeared(updates.peers_found)
            self.on_graph_change(updates.peer_appeared)
        self._alarms.update(updates.topics)
        self._commands.holds.judge()
        self._stepped.emit(updates.topics, updates.graph or not updates.topics)
        for key, reading in updates.readings:
            self._confirm(key, reading)
        if updates.urgent or self._again:
            self._again = False
            self._refresher.refresh_now()
        elif updates.commands:
            self._refresher.refresh_commands(updates.commands)
        elif updates.other:
            self._refresher.refresh_next_frame()
        elif updates.values:
            self._refresher.refresh_values(updates.values)

    def _schedule_control(self) -> None:
        """Plans the turn that records the next change of control by time: no data may arrive until
        then."""
        due = self._control.until
        if self._stopped or due == math.inf or (self._control_timer and self._control_due <= due):
            return
        if self._control_timer:
            self._control_timer.cancel()
        self._control_due = due
        self._control_timer = self._loop.call_at(due, self._run_for_control)

    def _run_for_control(self) -> None:
        self._control_timer = None
        self.run()

    def _confirm(self, key: str, reading: Reading) -> None:
        try:
            self._commands.confirmations.update(key, reading)
        except Exception:
            self._log.exception("checking %s for confirmations failed", key)

    def _cancel_frame(self) -> None:
        if self._frame is not None:
            self._frame.cancel()
            self._frame = None
