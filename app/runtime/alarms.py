"""Runs the alarms of all robots: evaluates them in each turn and when their time has come, writes each
change to the disk, and shows it when it is there."""

import asyncio
import logging
import math
import time
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from app.alarms.counts import AlarmCounts
from app.alarms.disk import NAME, AlarmDisk, Change, DiskEvents
from app.alarms.engine import AlarmEngine
from app.alarms.history import HistoryRow
from app.alarms.history_reader import HistoryReader
from app.alarms.instance import Transition
from app.alarms.marks import AlarmMarks
from app.alarms.own import is_kept
from app.alarms.records import history_row, record_of
from app.alarms.rows import AlarmRow, row_of
from app.alarms.shown import MAX_ROWS, NO_ALARMS, AlarmsView, PendingRow, ShownAlarms, outdated
from app.alarms.status import now
from app.audit.press_record import Log
from app.certificates.served import NO_FILES, UsedCertificates
from app.i18n import TextLike
from app.panel.model import Panel
from app.robot.state import RobotState
from app.runtime.alarm_curves import AlarmCurves
from app.runtime.alarm_mqtt import AlarmMqtt
from app.runtime.own_alarms import OwnAlarms
from app.runtime.robot_alarms import RobotAlarms

log = logging.getLogger("kiosk.alarms")

AT_ONCE: Final = 10  # alarms that are evaluated in one turn: 1 ms if all are raised
REFRESH_EVERY_S: Final = 1.0  # what robots say of alarms that stand
SHOW_EVERY_S: Final = 0.05
ROWS_AT_ONCE: Final = 100  # that have changed: 10 ms to render
ROW_S: Final = 0.001  # the pause is so much longer for each: in a flood, presses go first
# A change is shown when it is on the disk, or after this time: no slow disk hides an alarm.
SHOWN_WITHIN_S: Final = 0.5
LOAD_TIMEOUT_S: Final = 5.0  # the panel starts without earlier alarms if the disk takes longer


class Alarms:
    """The alarms of one server, from `start` to `stop`; before it, none is raised. Used on the event
    loop only."""

    def __init__(self, panel: Panel) -> None:
        self._panel = panel
        self.engine = AlarmEngine(panel, now, self._receive)
        self.history = HistoryReader(None)
        self.counts = AlarmCounts()
        self.curves = AlarmCurves(self.engine.robots, now)
        self._loop = asyncio.get_running_loop()
        self._disk: AlarmDisk | None = None
        self._loaded: asyncio.Future[None] = self._loop.create_future()
        self._pending: deque[PendingRow] = deque()
        self._shown_to = 0.0  # the last change that may be shown
        self._written_to = 0  # the number of the last change that is on the disk
        self._seq = 0
        self._overrun: dict[str, None] = {}  # ids of alarms of which a change found no room
        self._fault: TextLike = ""
        self._shown = ShownAlarms(AlarmMarks(panel))
        self._view: AlarmsView | None = NO_ALARMS  # None: to be made
        self._robots: list[RobotAlarms] = []
        self._lock_changes = 0
        self._show_timer: asyncio.TimerHandle | None = None
        self._shown_at = -math.inf
        self._pause_s = SHOW_EVERY_S  # until the views are notified again
        self._changed_rows = 0  # since they were
        self._slow_timer: asyncio.TimerHandle | None = None
        self._due_timer: asyncio.TimerHandle | None = None
        self._due = math.inf
        self._refreshed_at = -math.inf
        self._waiters: list[tuple[int, asyncio.Future[None]]] = []
        self._stopped = False
        self._own: OwnAlarms | None = None
        self.mqtt = AlarmMqtt(panel.alarm_rules.mqtt, panel.language)

    def add_robot(self, robot_id: str, robot: RobotState) -> RobotAlarms:
        self.engine.add_robot(robot_id, robot)
        robot_alarms = RobotAlarms(self.engine, robot_id, robot, self.evaluate)
        self._robots.append(robot_alarms)
        robot.alarmed = self._shown.marks.of_robot(robot_id)
        self._shown.selections.add_robot(robot_id, self._panel)
        return robot_alarms

    async def start(self, folder: Path, operators_log: Log, used: UsedCertificates = NO_FILES) -> None:
        """Loads the alarms that stood when the server ended; nothing for a panel without alarms."""
        if not self._panel.may_raise:
            return
        if (rules := self._panel.alarm_rules).panel:
            self._own = OwnAlarms(rules, folder, operators_log, self.engine, self.evaluate, used)
            self._own.start(self.mqtt)
        self.mqtt.start()
        events = DiskEvents(self._restore, self._on_disk, self._set_fault, self._write_standing)
        self._disk = AlarmDisk(folder, self._panel.alarm_rules, events)
        self.history = HistoryReader(folder / NAME)
        if not self._panel.has_alarms and not self._disk.exists:
            self._restore({})  # there is no file before the panel's own first alarm
            return
        self._disk.start()
        try:
            async with asyncio.timeout(LOAD_TIMEOUT_S):
                await asyncio.shield(self._loaded)
        except TimeoutError:
            log.error("the disk takes too long: the alarms of before are shown when they are read")
        self.evaluate()

    async def stop(self) -> None:
        """Evaluates no longer, and writes what is queued."""
        self._stopped = True
        if self._own is not None:
            self._own.stop()
        for timer in (self._show_timer, self._slow_timer, self._due_timer):
            if timer is not None:
                timer.cancel()
        await asyncio.to_thread(self.mqtt.stop)
        self.history.close()
        if self._disk is not None:
            await self._disk.stop()

    def view(self) -> AlarmsView:
        """The section of the view: what is on the disk."""
        if self._view is None:
            self._view = self._shown.view(time.monotonic(), self._fault)
        return self._view

    def rows(self) -> list[AlarmRow]:
        """All rows that are shown, the most urgent first."""
        return list(self._shown.listed())

    async def written(self, within_s: float) -> bool:
        """Waits until all changes up to now are on the disk; False if that takes longer."""
        if self._written_to >= self._seq:
            return True
        done: asyncio.Future[None] = self._loop.create_future()
        self._waiters.append((self._seq, done))
        try:
            async with asyncio.timeout(within_s):
                await done
        except TimeoutError:
            return False
        return True

    # Evaluation.

    def evaluate(self) -> None:
        """Evaluates some of the alarms that are due now, and plans the rest."""
        if self._stopped or self._disk is None:
            return
        try:
            self.engine.evaluate(AT_ONCE)
        except Exception:
            log.exception("alarms were not evaluated")
        if (at := time.monotonic()) >= self._refreshed_at + REFRESH_EVERY_S:
            self._refreshed_at = at
            self._write_records(outdated(self.engine.alarms, self._shown.rows, AT_ONCE))
        self._plan()
        if self.engine.lock_changes != self._lock_changes:
            self._lock_changes = self.engine.lock_changes
            for robot in self._robots:
                robot.locks_changed.emit()

    def _plan(self) -> None:
        due = self.engine.due or time.monotonic()
        if due >= self._due:
            return
        if self._due_timer is not None:
            self._due_timer.cancel()
        self._due = due
        self._due_timer = self._loop.call_at(due, self._run_due)

    def _run_due(self) -> None:
        self._due_timer, self._due = None, math.inf
        self.evaluate()

    # From a transition to the disk, and from there to the pages.

    def _receive(self, transitions: Sequence[Transition]) -> None:
        for transition in transitions:
            alarm = self.engine.alarms[transition.id]
            if self.counts.count(transition, alarm.definition.rules):
                self._shown.count_raise(alarm, transition.at.monotonic)
                self.curves.plan(alarm)
            row = history_row(alarm, transition)
            self.mqtt.put(row)
            shown = None if alarm.is_unlisted else row_of(alarm, transition.at)
            if not is_kept(alarm.definition):
                self._shown.update(transition.id, shown)
                self._show()
                continue
            self._put(transition.id, row, None if shown is None else row.record, shown)

    def _put(
        self, alarm_id: str, row: HistoryRow | None, record: str | None, shown: AlarmRow | None
    ) -> None:
        self._seq += 1
        assert self._disk is not None  # nothing changes before the start
        if not self._disk.put(Change(self._seq, alarm_id, row, record)):
            self._overrun[alarm_id] = None
        self._pending.append(PendingRow(self._seq, alarm_id, shown, time.monotonic()))
        if self._fault:
            self._show_until(math.inf)
        elif self._slow_timer is None:
            self._slow_timer = self._loop.call_later(SHOWN_WITHIN_S, self._show_slow)

    def _on_disk(self, seq: int) -> None:
        self._written_to = seq
        self._show_until(seq)
        waiters, self._waiters = self._waiters, []
        for upto, done in waiters:
            if upto > seq:
                self._waiters.append((upto, done))
            elif not done.done():
                done.set_result(None)
        if self._overrun and self._disk and not self._disk.waiting:
            overrun, self._overrun = self._overrun, {}
            self._write_records(overrun)

    def _show_slow(self) -> None:
        """Shows the changes that wait too long for the disk."""
        self._slow_timer = None
        since = time.monotonic() - SHOWN_WITHIN_S
        self._show_until(max((row.seq for row in self._pending if row.since <= since), default=0))
        if self._pending:
            wait_s = self._pending[0].since + SHOWN_WITHIN_S - time.monotonic()
            self._slow_timer = self._loop.call_later(max(SHOW_EVERY_S, wait_s), self._show_slow)

    def _show_until(self, seq: float) -> None:
        """Shows changes up to this number, as many as readers get at once; the others follow."""
        self._shown_to = max(self._shown_to, min(seq, self._seq))
        room = ROWS_AT_ONCE - self._changed_rows
        while room > 0 and self._pending and self._pending[0].seq <= self._shown_to:
            change = self._pending.popleft()
            self._shown.update(change.id, change.row)
            self._changed_rows, room = self._changed_rows + 1, room - 1
        if self._changed_rows:
            self._show()

    def _set_fault(self, fault: TextLike) -> None:
        self._fault = fault
        if fault and not self._loaded.done():
            self._loaded.set_result(None)
        self._show_until(math.inf)
        self._show()

    def _show(self) -> None:
        """Notifies the views, at most once in `SHOW_EVERY_S`, and less often after many rows."""
        if self._show_timer is None and not self._stopped:
            wait_s = self._shown_at + self._pause_s - time.monotonic()
            self._show_timer = self._loop.call_later(max(0.0, wait_s), self._notify)

    def _notify(self) -> None:
        self._show_timer, self._view, self._shown_at = None, None, time.monotonic()
        self._pause_s = SHOW_EVERY_S + ROW_S * self._changed_rows
        self._changed_rows = 0
        self.mqtt.put_standing(self._shown.listed())
        marked = self._shown.marks.take_changes()
        for robot in self._robots:
            if topics := marked.get(robot.robot_id):
                robot.show_marks(self._shown.marks.of_robot(robot.robot_id), topics)
            selections = self._shown.selections.of_robot(robot.robot_id)
            robot.show(islice(self._shown.listed(), MAX_ROWS), selections)
        self._show_until(0)

    # Restart, and a new file.

    def _restore(self, records: Mapping[str, str]) -> None:
        try:
            missing = self.engine.restore(records)
        except (ValueError, KeyError, TypeError):
            log.exception("the alarms of before could not be restored")
            missing = []
        at = now()
        for alarm in self.engine.standing():
            self._shown.update(alarm.definition.id, row_of(alarm, at))
        for alarm_id in missing:
            log.warning('the panel no longer has the alarm "%s", which stood', alarm_id)
            self._put(alarm_id, None, None, None)
        if not self._loaded.done():
            self._loaded.set_result(None)
        self._show()
        self.evaluate()

    def _write_standing(self) -> None:
        """Writes all alarms that stand to a new file."""
        self._write_records([alarm.definition.id for alarm in self.engine.standing()])

    def _write_records(self, alarm_ids: Collection[str]) -> None:
        at = now()
        for alarm_id in alarm_ids:
            alarm = self.engine.alarms.get(alarm_id)
            stands = alarm is not None and not alarm.is_unlisted
            record = record_of(alarm, at) if alarm and stands else None
            self._put(alarm_id, None, record, row_of(alarm, at) if alarm and stands else None)
