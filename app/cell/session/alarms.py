"""Runs the alarms of all robots: evaluates them in each turn and when their time has come, writes each
change to the disk, and shows it when it is there."""

import asyncio
import logging
import math
import shutil
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Final, Protocol

from app.cell.alarms.engine import AlarmEngine
from app.cell.alarms.export import HistoryReader
from app.cell.alarms.history import HistoryRow
from app.cell.alarms.published import AlarmEntry
from app.cell.alarms.records import history_row, record_of
from app.cell.alarms.shown import (
    MAX_ROWS,
    NO_ALARMS,
    AlarmCounts,
    AlarmMarks,
    AlarmRow,
    AlarmsView,
    AlarmTable,
    AskedReason,
    PendingRow,
    outdated,
    row_of,
)
from app.cell.alarms.sources import (
    OwnAlarm,
    broker_entry,
    certificate_entry,
    clock_entry,
    disk_entry,
    forward_entry,
    full_entry,
    is_kept,
    log_entry,
    lost_entry,
    own_definitions,
    sign_in_entry,
    site_entry,
    unreadable_records,
    unused_certificate_entry,
    users_entry,
)
from app.cell.alarms.states import Transition, now
from app.cell.alarms.store import NAME, AlarmDisk, DiskEvents, RecordChange
from app.cell.robot.state import RobotState
from app.cell.session.alarm_curves import AlarmCurves
from app.cell.session.alarm_mqtt import AlarmMqtt
from app.cell.session.turn import RobotAlarms
from app.panel.alarm import STOPPING_PRIORITY, AlarmRules
from app.panel.model import Panel
from app.records.press_record import Log
from app.system.texts import TextLike, joined, say
from app.system.used_certificates import NO_FILES, UsedCertificates, readable

# What the server sees of itself, for the panel's own alarms: its log, its disk, its clock, the
# certificates that it uses, its connections to the broker of MQTT and to the central database, its
# users, their sign-ins and its alarms.

log = logging.getLogger("kiosk.alarms")

CHECK_S: Final = 1.0
DISK_EVERY: Final = 10  # checks
CERTIFICATES_EVERY: Final = 3600  # checks
CLOCKS_APART_S: Final = 0.05  # two clocks that are read further apart say nothing
MEGABYTE: Final = 1e6
FAR: Final = datetime.max.replace(tzinfo=UTC)  # the end of what never ends


class Usage(Protocol):
    """The free bytes of a disk."""

    @property
    def free(self) -> int: ...


class Broker(Protocol):
    """Where alarms are published: `address` is "" for nowhere, `state` why there is no connection."""

    is_connected: bool
    state: str

    @property
    def address(self) -> str: ...


class SignIns(Protocol):
    """Users and their sign-ins: `fault` says why no one can sign in, `guessed` whose secret, and from
    which addresses, is tried on other machines."""

    @property
    def fault(self) -> TextLike: ...
    @property
    def guessed(self) -> tuple[str, Sequence[str]] | None: ...


class ForwardStatus(Protocol):
    """How the forwarding to the central database goes; `fault` is "" if it does."""

    @property
    def address(self) -> str: ...
    @property
    def connected(self) -> bool: ...
    @property
    def fault(self) -> TextLike: ...


class Forwarding(Protocol):
    """What sends to the central database."""

    @property
    def status(self) -> ForwardStatus: ...


class Site(Protocol):
    """What the cell publishes of itself: `twin` is another panel with its name, "" for none."""

    name: str
    twin: str

    @property
    def is_connected(self) -> bool: ...


class OwnAlarms:
    """The panel's own alarms, from `start` to `stop`. Used on the event loop only."""

    def __init__(
        self,
        rules: AlarmRules,
        folder: Path,
        operators_log: Log,
        engine: AlarmEngine,
        evaluate: Callable[[], None],
        certificates: UsedCertificates = NO_FILES,
        forwarding: Forwarding | None = None,
    ) -> None:
        self._certificates = certificates
        self._forwarding = forwarding
        self._forwarded_at = 0.0  # the last time that it did, in monotonic seconds
        self._certificate_fault = ""
        self._rules = rules
        self._folder = folder
        self._log = operators_log
        self._engine = engine
        self._evaluate = evaluate
        for _, definition in own_definitions():
            engine.add_own(definition)
        self._listening = ExitStack()
        self._ahead_s = time.time() - time.monotonic()  # of the wall clock
        self._losses: list[TextLike] = []  # that stand
        self._new_losses: list[TextLike] = []  # that are not raised yet
        self._disk_is_low = False
        self._checks = 0
        self._broker: Broker | None = None
        self._sign_ins: SignIns | None = None
        self._site: Site | None = None
        self._site_connected_at = 0.0  # the last time, in monotonic seconds
        self._connected_at = 0.0  # the last time, in monotonic seconds
        self._timer: asyncio.TimerHandle | None = None
        self._measuring: asyncio.Task[None] | None = None
        self._reading: asyncio.Task[None] | None = None

    def start(self, broker: Broker) -> None:
        """Looks at what the alarms are about from now on."""
        self._broker, self._connected_at = broker, time.monotonic()
        self._set("panel_disk", disk_entry(self._rules.disk_free_mb, self._rules.disk_free_mb, False))
        self._set("panel_clock", clock_entry(0.0, 0.0))
        if not broker.address:
            self._set("panel_mqtt", broker_entry("", "", 0.0))
        self._forwarded_at = time.monotonic()
        if self._forwarding is None:
            self._set("panel_forward", forward_entry("", "", 0.0))
        self._set("panel_site", site_entry("", "", 0.0))
        if not self._certificates.all_files:
            self._set("panel_certificate", certificate_entry("", FAR, datetime.now(UTC)))
        self._check_log()
        self._listening.enter_context(self._log.notifying(self._log_changed))
        self._check()

    def watch_sign_ins(self, sign_ins: SignIns) -> None:
        """Looks at these users from now on."""
        self._sign_ins = sign_ins
        self._check_sign_ins(sign_ins)
        self._evaluate()

    def watch_site(self, site: Site) -> None:
        """Looks at this summary from now on."""
        self._site, self._site_connected_at = site, time.monotonic()

    def _check_site(self, site: Site) -> None:
        now = time.monotonic()
        if site.is_connected:
            self._site_connected_at = now
        self._set("panel_site", site_entry(site.name, site.twin, now - self._site_connected_at))

    def _check_sign_ins(self, sign_ins: SignIns) -> None:
        self._set("panel_users", users_entry(sign_ins.fault))
        self._set("panel_sign_in", sign_in_entry(*(sign_ins.guessed or ("", ()))))

    def stop(self) -> None:
        self._listening.close()
        for work in (self._timer, self._measuring, self._reading):
            if work is not None:
                work.cancel()

    def _set(self, name: OwnAlarm, entry: AlarmEntry) -> None:
        self._engine.own_changed(name, entry)

    def lost(self, cause: TextLike) -> None:
        """Alarms that stood, or their history, were lost."""
        self._new_losses.append(cause)
        self._check_lost()

    def _check_lost(self) -> None:
        """A loss stands until it is acknowledged. It is raised when alarms are evaluated: one of an
        earlier run may stand."""
        if not self._engine.has_begun:
            return
        alarm = self._engine.alarms["panel_alarms_lost"]
        is_done = alarm.status.is_acknowledged and not alarm.status.is_normal
        if alarm.entry is None or is_done:
            self._losses.clear()
            self._set("panel_alarms_lost", lost_entry(""))
            self._evaluate()
        if self._new_losses:
            self._losses += self._new_losses
            self._new_losses.clear()
            self._set("panel_alarms_lost", lost_entry(joined(self._losses)))
            self._evaluate()

    def _log_changed(self) -> None:
        self._check_log()
        self._evaluate()

    def _check_log(self) -> None:
        self._set("panel_log", log_entry(self._log.fault, bool(self._log.lock)))

    def _check(self) -> None:
        self._timer = asyncio.get_running_loop().call_later(CHECK_S, self._check)
        self._check_clock()
        self._check_broker()
        self._check_forwarding()
        if self._sign_ins is not None:
            self._check_sign_ins(self._sign_ins)
        if self._site is not None:
            self._check_site(self._site)
        self._check_lost()
        self._set("panel_alarms_full", full_entry(self._engine.room.left_out))
        if self._checks % DISK_EVERY == 0 and self._measuring is None:
            self._measuring = asyncio.create_task(self._check_disk())
        fault = self._certificates.fault
        is_new, self._certificate_fault = fault != self._certificate_fault, fault
        if self._certificates.all_files and (is_new or self._checks % CERTIFICATES_EVERY == 0):
            self._reading = asyncio.create_task(self._check_certificates())
        self._checks += 1
        self._evaluate()

    def _check_clock(self) -> None:
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        if after - before > CLOCKS_APART_S:
            return
        ahead_s = wall - before
        by_s, shown = ahead_s - self._ahead_s, before + self._ahead_s
        self._ahead_s = ahead_s
        self._set("panel_clock", clock_entry(by_s, shown))

    def _check_broker(self) -> None:
        broker, now = self._broker, time.monotonic()
        if broker is None or not broker.address:
            return
        if broker.is_connected:
            self._connected_at = now
        self._set("panel_mqtt", broker_entry(broker.address, broker.state, now - self._connected_at))

    def _check_forwarding(self) -> None:
        if self._forwarding is None:
            return
        status, now = self._forwarding.status, time.monotonic()
        if status.connected:
            self._forwarded_at = now
        entry = forward_entry(status.address, status.fault, now - self._forwarded_at)
        self._set("panel_forward", entry)

    async def _check_disk(self) -> None:
        """Measures on a thread: a disk may not answer."""
        try:
            usage = await asyncio.to_thread(_usage, self._folder)
        except OSError as error:
            log.warning("the free space of %s is not known: %s", self._folder, error)
        else:
            entry = disk_entry(usage.free / MEGABYTE, self._rules.disk_free_mb, self._disk_is_low)
            self._disk_is_low = entry.level > 0
            self._set("panel_disk", entry)
            self._evaluate()
        finally:
            self._measuring = None

    async def _check_certificates(self) -> None:
        """Reads them on a thread: a renewed one is another file, or the same with other content."""
        if self._certificates.fault:
            file = str(self._certificates.all_files[0])
            self._set("panel_certificate", unused_certificate_entry(file))
            self._evaluate()
            return
        listed = await asyncio.to_thread(readable, self._certificates.all_files)
        if listed:
            first = min(listed, key=lambda certificate: certificate.until)
            entry = certificate_entry(str(first.file), first.until, datetime.now(UTC))
            self._set("panel_certificate", entry)
            self._evaluate()


def _usage(folder: Path) -> Usage:
    """Of the disk of a folder, which may not be there yet."""
    return shutil.disk_usage(next(path for path in (folder, *folder.parents) if path.exists()))


AT_ONCE: Final = 10  # alarms that are evaluated in one turn: 1 ms if all are raised
REFRESH_EVERY_S: Final = 1.0  # what robots say of alarms that stand
SHOW_EVERY_S: Final = 0.05
ROWS_AT_ONCE: Final = 100  # that have changed: 10 ms to render
ROW_S: Final = 0.001  # the pause is so much longer for each: in a flood, presses go first
# A change is shown when it is on the disk, or after this time: no slow disk hides an alarm.
SHOWN_WITHIN_S: Final = 0.5
LOAD_TIMEOUT_S: Final = 5.0  # the server starts then; no alarm is evaluated before the disk is read


class Alarms:
    """The alarms of one server, from `start` to `stop`; before it, none is raised. Used on the event
    loop only."""

    def __init__(self, panel: Panel) -> None:
        self._panel = panel
        self.engine = AlarmEngine(panel, now, self._receive, self._remove)
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
        self.asked: AskedReason | None = None  # the question for reasons of stops
        self._shown = AlarmTable(AlarmMarks(panel))
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
        self._is_reading = False  # what stood, for longer than the start waits
        self.mqtt = AlarmMqtt(panel.alarm_rules.mqtt, panel.language)

    def add_robot(self, robot_id: str, robot: RobotState) -> RobotAlarms:
        self.engine.add_robot(robot_id, robot)
        own = (alarm for alarm in self._panel.alarms if alarm.is_for(robot_id or None))
        nodes = sorted({alarm.node for alarm in own if alarm.node is not None})
        robot_alarms = RobotAlarms(self.engine, robot_id, robot, self.evaluate, nodes)
        self._robots.append(robot_alarms)
        robot.alarmed = self._shown.marks.of_robot(robot_id)
        self._shown.selections.add_robot(robot_id, self._panel)
        return robot_alarms

    async def start(
        self,
        folder: Path,
        operators_log: Log,
        used: UsedCertificates = NO_FILES,
        forwarding: Forwarding | None = None,
    ) -> None:
        """Loads the alarms that stood when the server ended; nothing for a panel without alarms."""
        if not self._panel.may_raise:
            return
        if (rules := self._panel.alarm_rules).panel:
            self._own = OwnAlarms(
                rules, folder, operators_log, self.engine, self.evaluate, used, forwarding
            )
            self._own.start(self.mqtt)
        self.mqtt.start()
        events = DiskEvents(
            self._restore, self._on_disk, self._fail, self._write_standing, self._report_lost
        )
        self._disk = AlarmDisk(folder, self._panel.alarm_rules, events)
        self.history = HistoryReader(folder / NAME)
        if not self._panel.has_alarms and not self._disk.exists:
            self._restore({}, 0)  # there is no file before the panel's own first alarm
            return
        self._disk.start()
        try:
            async with asyncio.timeout(LOAD_TIMEOUT_S):
                await asyncio.shield(self._loaded)
        except TimeoutError:
            log.error("the disk takes too long: alarms are evaluated when those of before are read")
            self._is_reading = True
            self._set_fault(say("alarms_not_read_yet"))
        self.evaluate()

    def watch_sign_ins(self, sign_ins: SignIns) -> None:
        """Raises the panel's own alarms of its users and of their sign-ins."""
        if self._own is not None:
            self._own.watch_sign_ins(sign_ins)

    def watch_site(self, site: Site) -> None:
        """Raises the panel's own alarm of its summary."""
        if self._own is not None:
            self._own.watch_site(site)

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
            self._view = self._shown.view(time.monotonic(), self._fault, self.asked)
        return self._view

    def ask(self, asked: AskedReason | None) -> None:
        """Asks for the reason of a stop in the line of alarms, in place of the question before; None:
        it is answered, or left for later."""
        self.asked = asked
        self._show()

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
            if row.event == "raised" and row.priority <= STOPPING_PRIORITY:
                self._report_stop(row.robot)
            shown = None if alarm.is_unlisted else row_of(alarm, transition.at)
            if not is_kept(alarm.definition):
                self._shown.update(transition.id, shown)
                self._show()
                continue
            self._put(transition.id, row, None if shown is None else row.record, shown)

    def _report_stop(self, robot_id: str) -> None:
        """To the robot of an alarm; of one of the panel itself ("") to all."""
        for robot in self._robots:
            if robot_id in ("", robot.robot_id):
                robot.stopped.emit()

    def _put(
        self, alarm_id: str, row: HistoryRow | None, record: str | None, shown: AlarmRow | None
    ) -> None:
        self._seq += 1
        assert self._disk is not None  # nothing changes before the start
        if not self._disk.put(RecordChange(self._seq, alarm_id, row, record)):
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

    def _fail(self, fault: TextLike) -> None:
        """The disk refuses changes, or takes them again. If what stood can't be read, alarms are
        evaluated without it: it is merged when it is read."""
        self._is_reading = False
        self._set_fault(fault)
        if fault and not self._loaded.done():
            self.engine.begin(int(time.time()))  # above all occurrences of before
            self._finish_loading()

    def _finish_loading(self) -> None:
        if not self._loaded.done():
            self._loaded.set_result(None)
        for robot in self._robots:
            robot.evaluation_began.emit()
        self.evaluate()

    def _set_fault(self, fault: TextLike) -> None:
        self._fault = fault
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

    def _restore(self, records: Mapping[str, str], occurrences: int) -> None:
        """What stood is read."""
        is_late = self.engine.has_begun
        restored = self.engine.restore(records, occurrences)
        assert self._disk is not None  # it was read
        self._disk.replace_records(self._seq)
        if restored.unreadable:
            self._report_lost(unreadable_records(restored.unreadable))
        at = now()
        standing = [alarm.definition.id for alarm in self.engine.standing()]
        for alarm_id in standing:
            self._shown.update(alarm_id, row_of(self.engine.alarms[alarm_id], at))
        for alarm_id in restored.missing:
            log.warning('the panel no longer has the alarm "%s", which stood', alarm_id)
        changed = {*restored.missing, *restored.unreadable, *(standing if is_late else ())}
        changed |= {alarm_id for alarm_id in standing if alarm_id not in records}
        self._write_records(changed)
        if self._is_reading:
            self._is_reading = False
            self._set_fault("")
        self._finish_loading()
        self._show()

    def _remove(self, alarm_ids: Sequence[str]) -> None:
        """Alarms made room for more urgent ones."""
        for alarm_id in alarm_ids:
            self._put(alarm_id, None, None, None)

    def _report_lost(self, cause: TextLike) -> None:
        """Alarms that stood before, or their history, were lost."""
        log.error("alarms were lost: %s", cause)
        if self._own is not None:
            self._own.lost(cause)

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
