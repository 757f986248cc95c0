"""The alarms of all robots of a panel: evaluates their sources and applies acts.

An evaluation looks only at alarms of which a topic has changed or a time has come, and at a bounded
number of them. Used on the event loop only.
"""

import heapq
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Final

from app.alarms.entries import AlarmEntry
from app.alarms.evaluation import levels_of, read_alarm, steady_range
from app.alarms.first_out import FirstOut
from app.alarms.instance import NEVER_STEADY, AlarmInstance, Definition, Transition, define
from app.alarms.records import entry_in, leader_in, status_in
from app.alarms.source_watch import SourceWatch
from app.alarms.sources import read_suppression
from app.alarms.status import ActResult, AlarmStatus, Moment, expire, update_level, update_suppression
from app.alarms.topic_alarms import TopicAlarms
from app.i18n import TextLike
from app.panel.model import Panel
from app.robot.state import RobotState

MAX_EVALUATED: Final = 2_000  # in one evaluation
MAX_ENTRIES: Final = 10_000  # alarms that the robots publish themselves

Act = Callable[[AlarmStatus, Definition], ActResult]


class AlarmEngine:
    """Its robots are added one by one. `on_transitions` is called with the transitions of an evaluation
    or an act."""

    def __init__(
        self,
        panel: Panel,
        clock: Callable[[], Moment],
        on_transitions: Callable[[Sequence[Transition]], None],
    ) -> None:
        self._panel = panel
        self.robots: dict[str, RobotState] = {}
        self._clock = clock
        self._on_transitions = on_transitions
        self._began_at = clock().monotonic
        self._seq = 0
        self._waiting: dict[str, None] = {}  # ids of alarms to be evaluated, in order
        self._timers: list[tuple[float, str]] = []  # a heap; an alarm's own `due` is what counts
        self._topics = TopicAlarms()
        self._by_robot: dict[str, list[str]] = {}
        self._sources: dict[tuple[str, str], Definition] = {}  # (robot, alarm's id) → of its entries
        self._entries: dict[tuple[str, str], list[AlarmInstance]] = {}  # by the same
        self._inhibitors: dict[tuple[str, str], list[AlarmInstance]] = {}  # by (robot, control)
        self._watch = SourceWatch()
        self._first_out = FirstOut(panel.alarm_rules.first_out_s)
        self._entry_count = 0
        self.refused_entries = 0  # that were not kept, as there were too many
        self.alarms: dict[str, AlarmInstance] = {}
        self._lock_changes = 0

    def add_robot(self, robot_id: str, robot: RobotState) -> None:
        """Adds the alarms of a robot by its id, "" for the only one without an id."""
        self.robots[robot_id], self._by_robot[robot_id] = robot, []
        for definition in define(self._panel, robot_id):
            self._add(definition)

    def _add(self, definition: Definition) -> None:
        alarm, robot = definition.alarm, definition.robot
        if alarm.source in ("diagnostics", "list"):
            self._sources[robot, alarm.id] = definition
            self._entries[robot, alarm.id] = []
            self._inhibit(self._watch.add(definition))
            return
        instance = self._keep(definition)
        for topic in alarm.evaluated_topics:
            self._topics.listen(instance, self.robots[robot].possible_keys(topic))

    def _keep(self, definition: Definition) -> AlarmInstance:
        alarm = self.alarms[definition.id] = AlarmInstance(definition)
        self._by_robot.setdefault(definition.robot, []).append(definition.id)
        self._waiting[definition.id] = None
        self._inhibit(alarm)
        return alarm

    def _inhibit(self, alarm: AlarmInstance) -> None:
        for control in alarm.definition.inhibits:
            self._inhibitors.setdefault(control, []).append(alarm)

    @property
    def due(self) -> float:
        """When the next evaluation is due (monotonic seconds): 0 if alarms wait for it."""
        if self._waiting or self._topics.has_changed:
            return 0.0
        return min(self._timers[0][0] if self._timers else math.inf, self._watch.due)

    @property
    def lock_changes(self) -> int:
        """How often a lock of controls by alarms has changed."""
        return self._lock_changes + self._watch.changes

    def now(self) -> Moment:
        return self._clock()

    def topics_changed(self, robot: str, keys: Iterable[str]) -> None:
        """Messages arrived on topics of a robot."""
        self._topics.note(robot, keys)

    def robot_changed(self, robot: str) -> None:
        """The link to a robot, or its graph, has changed."""
        self._waiting.update(dict.fromkeys(self._by_robot[robot]))

    def own_changed(self, definition: Definition, entry: AlarmEntry) -> None:
        """What the server sees of an alarm of the panel itself, which is of no robot."""
        alarm = self.alarms.get(definition.id) or self._keep(definition)
        alarm.entry = entry
        self._waiting[definition.id] = None

    def evaluate(self, most: int = MAX_EVALUATED) -> None:
        """Evaluates the alarms that wait, and those whose time has come: `most` of them."""
        now = self._clock()
        self._watch.expire(self.robots, now.monotonic)
        self._waiting.update(dict.fromkeys(self._topics.take(self.robots, now.monotonic)))
        while self._timers and self._timers[0][0] <= now.monotonic:
            at, alarm_id = heapq.heappop(self._timers)
            alarm = self.alarms[alarm_id]
            if at == alarm.timer:
                alarm.timer = math.inf
            if alarm.due <= now.monotonic:
                self._waiting[alarm_id] = None
            else:
                self._set_timer(alarm)
        turn = [alarm_id for alarm_id, _ in zip(self._waiting, range(most), strict=False)]
        for alarm_id in turn:
            del self._waiting[alarm_id]
        self._emit([t for alarm_id in turn for t in self._evaluated(self.alarms[alarm_id], now)])

    def entries_received(
        self,
        robot: str,
        alarm_id: str,
        entries: Iterable[AlarmEntry],
        at: float,
        is_whole: bool = True,
        earlier: Collection[str] = (),
    ) -> None:
        """A robot published entries of an alarm with `diagnostics` or a list; `at` in monotonic
        seconds. A list without `active` has all of its active entries, if it was read as a whole;
        `earlier` are those of the same message before."""
        self._watch.heard(robot, alarm_id, at)
        source = self._sources[robot, alarm_id]
        named = {entry.name: entry for entry in entries}
        for entry in named.values():
            alarm = self.alarms.get(f"{source.id}:{entry.name}")
            if alarm is None and entry.level:
                alarm = self._new_entry(source.of_entry(entry))
            if alarm is not None:
                self._receive_entry(alarm, source, entry, at)
        listed = source.alarm.listed
        if listed is not None and listed.active is None and is_whole:
            self._end_missing(source, {*named, *earlier})

    def _receive_entry(
        self, alarm: AlarmInstance, source: Definition, entry: AlarmEntry, at: float
    ) -> None:
        if not entry.level and alarm.entry is not None:
            entry = entry._replace(text=alarm.entry.text)  # what it was, not what is well now
        is_new = alarm.entry != entry or alarm.status.unknown_since or not alarm.is_evaluated
        alarm.heard_at = at
        if is_new:
            if alarm.entry is None or alarm.entry.priorities != entry.priorities:
                alarm.definition = source.of_entry(entry)
            alarm.entry = entry
            self._waiting[alarm.definition.id] = None

    def _new_entry(self, definition: Definition) -> AlarmInstance | None:
        if self._entry_count >= MAX_ENTRIES:
            self.refused_entries += 1
            return None
        self._entry_count += 1
        alarm = self._keep(definition)
        if definition.alarm.suppressed_while is not None:
            topic = definition.alarm.suppressed_while.topic
            self._topics.listen(alarm, self.robots[definition.robot].possible_keys(topic))
        self._entries[definition.robot, definition.alarm.id].append(alarm)
        return alarm

    def _end_missing(self, source: Definition, named: Collection[str]) -> None:
        for alarm in self._entries[source.robot, source.alarm.id]:
            entry = alarm.entry
            if entry is not None and entry.name not in named and entry.level:
                alarm.entry = entry._replace(level=0)
                self._waiting[alarm.definition.id] = None

    def _evaluated(self, alarm: AlarmInstance, now: Moment) -> Iterator[Transition]:
        """Evaluates one alarm; returns its transitions."""
        definition, before = alarm.definition, alarm.status
        lock, robot = alarm.lock, self.robots[definition.robot] if definition.is_of_robot else None
        if robot is not None and not (robot.link_up and robot.graph.peers):
            alarm.heard_at = -math.inf  # what was published before a cut does not count after it
        reading = read_alarm(alarm, robot, now.monotonic, self._began_at)
        status = expire(before, definition.rules, now)
        levels, conditions = levels_of(alarm, reading, now.monotonic)
        alarm.set_conditions(conditions)
        for level in levels:
            status = update_level(status, definition.rules, level, now)
        suppression = read_suppression(definition.alarm, robot, now.monotonic)
        status = update_suppression(status, definition.rules, suppression.met is True, now)
        alarm.status, alarm.is_evaluated = status, True
        alarm.value = reading.value if reading.is_known else alarm.value
        alarm.steady = NEVER_STEADY if reading.value is None else steady_range(alarm)
        self._set_due(alarm, min(reading.until, suppression.until))
        self._note_lock(alarm, lock)
        if not status.is_same_to_operators(before):
            yield self._transition(alarm, before, now)

    def _set_due(self, alarm: AlarmInstance, until: float) -> None:
        delays = alarm.definition.delays
        times = [until, *(condition.due(delays) for condition in alarm.conditions)]
        if alarm.status.shelf:
            times.append(alarm.status.shelf.until)
        alarm.due = min(times)
        self._set_timer(alarm)

    def _set_timer(self, alarm: AlarmInstance) -> None:
        """One timer for an alarm: a later time is looked up when the earlier one has come."""
        if alarm.due < alarm.timer:
            alarm.timer = alarm.due
            heapq.heappush(self._timers, (alarm.due, alarm.definition.id))

    def act(self, alarm_id: str, act: str, apply: Act, actor: str) -> ActResult | None:
        """Applies an act to an alarm: `apply` calls a function of `app/alarms/status.py`. None if there
        is no such alarm."""
        alarm = self.alarms.get(alarm_id)
        if alarm is None:
            return None
        before, lock = alarm.status, alarm.lock
        result = apply(before, alarm.definition)
        alarm.status = result.status
        self._note_lock(alarm, lock)
        if result.status.shelf and result.status.shelf != before.shelf:
            self._waiting[alarm_id] = None  # its end is a time
        if result.status != before:
            self._emit([self._transition(alarm, before, self._clock(), act, actor)])
        return result

    def restore(self, records: Mapping[str, str]) -> list[str]:
        """Restores the alarms of an earlier run from their records: their sources are unknown until
        they are heard. Returns the ids of those that the panel no longer has."""
        now, missing = self._clock(), []
        for alarm_id, record in records.items():
            alarm = self.alarms.get(alarm_id) or self._restored_entry(alarm_id, record)
            if alarm is None:
                missing.append(alarm_id)
            elif not alarm.status.occurrence:  # else it was raised before the disk was read
                alarm.restore(status_in(record, now))
                alarm.leader = leader_in(record)
                self._waiting[alarm_id] = None
        return missing

    def _restored_entry(self, alarm_id: str, record: str) -> AlarmInstance | None:
        entry = entry_in(record)
        source = next((s for s in self._sources.values() if alarm_id.startswith(f"{s.id}:")), None)
        if entry is None or source is None:
            return None
        alarm = self._new_entry(source.of_entry(entry))
        if alarm is not None:
            alarm.entry = entry
        return alarm

    def standing(self) -> list[AlarmInstance]:
        """The alarms that are not normal, or that are shelved, suppressed or out of service: the most
        urgent first, then the newest."""
        listed = [alarm for alarm in self.alarms.values() if not alarm.is_unlisted]
        return sorted(listed, key=lambda alarm: alarm.order)

    def inhibited(self, robot: str) -> Mapping[str, AlarmInstance]:
        """The controls of a robot that alarms lock now, each with the most urgent of them: also alarms
        of other robots."""
        locks: dict[str, AlarmInstance] = {}
        for (known, widget), alarms in self._inhibitors.items():
            inhibiting = [alarm for alarm in alarms if alarm.inhibits] if known == robot else []
            if inhibiting:
                locks[widget] = min(inhibiting, key=lambda alarm: alarm.order)
        return locks

    def _note_lock(self, alarm: AlarmInstance, before: tuple[bool, bool, TextLike]) -> None:
        if alarm.definition.inhibits and alarm.lock != before:
            self._lock_changes += 1

    def _transition(
        self, alarm: AlarmInstance, before: AlarmStatus, now: Moment, act: str = "", actor: str = ""
    ) -> Transition:
        self._seq += 1
        self._first_out.update(alarm, before, now, self.alarms)
        name, after = alarm.definition.id, alarm.status
        return Transition(self._seq, now, name, before, after, act, actor, alarm.value)

    def _emit(self, transitions: Sequence[Transition]) -> None:
        if transitions:
            self._on_transitions(transitions)
