"""The alarms of all robots of a panel: evaluates their sources and applies acts.

An evaluation looks only at alarms of which a topic has changed or a time has come, and at a bounded
number of them. Used on the event loop only.
"""

import heapq
import logging
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

from app.cell.alarms.entry_room import EntryRoom
from app.cell.alarms.published import AlarmEntry, entry_name
from app.cell.alarms.records import UNREADABLE, entry_in, leader_in, status_in
from app.cell.alarms.sources import UNKNOWN, SourceReading, read_source, read_suppression
from app.cell.alarms.states import (
    NEVER_STEADY,
    NORMAL,
    ActResult,
    AlarmInstance,
    AlarmStatus,
    Definition,
    DelayedCondition,
    Leader,
    Moment,
    Transition,
    define,
    expire,
    merge,
    update_level,
    update_suppression,
)
from app.cell.robot.state import RobotState
from app.panel.model import Panel
from app.panel.shared_keys import stale_at
from app.system.texts import TextLike, say

# From what an alarm's source says to the levels of its condition. Pure functions.


def read_alarm(
    alarm: AlarmInstance, robot: RobotState | None, now: float, began_at: float
) -> SourceReading:
    """What the source of an alarm says: a field or the graph of its robot, or what was published of it.
    `robot` is None for an alarm of the panel itself."""
    described, entry = alarm.definition.alarm, alarm.entry
    if robot is None:
        return UNKNOWN if entry is None else SourceReading(met=entry.level > 0)
    if entry is None:
        return read_source(described, robot, now, began_at)
    if not robot.link_up or not robot.graph.peers or alarm.heard_at == -math.inf:
        return UNKNOWN
    until = stale_at(alarm.heard_at, described.entry_max_age_s)
    if now >= until:
        return UNKNOWN
    return SourceReading(met=entry.level > 0, until=until)


def steady_range(alarm: AlarmInstance) -> tuple[float, float]:
    """The lowest and the highest value that change nothing of an alarm whose source is known."""
    low, high = -math.inf, math.inf
    for limit, condition in zip(alarm.definition.thresholds, alarm.conditions, strict=True):
        if limit is None or condition.met != condition.active:
            return NEVER_STEADY
        lowest, highest = limit.range_as(condition.met)
        low, high = max(low, lowest), min(high, highest)
    return low, high


def levels_of(
    alarm: AlarmInstance, reading: SourceReading, now: float
) -> tuple[tuple[int | None, ...], tuple[DelayedCondition, ...]]:
    """The levels that the condition has in turn, None for unknown, and its conditions after them. From
    one end of the range to the other it returns in between."""
    if not reading.is_known:
        return (None,), alarm.conditions
    definition = alarm.definition
    pairs = tuple(zip(definition.thresholds, alarm.conditions, strict=True))
    conditions = tuple(
        condition.observe(reading.exceeds(limit, condition.met), now, definition.delays)
        for limit, condition in pairs
    )
    before = {limit for limit, condition in pairs if condition.active}
    after = {
        limit
        for limit, condition in zip(definition.thresholds, conditions, strict=True)
        if condition.active
    }
    level = max((alarm.level_of(limit) for limit in after), default=0)
    sides = {limit.is_high for limit in (*before, *after) if limit is not None}
    crossed = before and after and not before & after and len(sides) > 1
    return ((0, level) if crossed else (level,)), conditions


# Which alarms a message of a topic may change. An alarm with limits is not evaluated while the value
# stays in the range in which none of its limits changes: thousands of them may listen to one topic.

# What decides the value of an alarm with limits, beside its topic: the field, scale, offset and age.
ValueKey = tuple[str, float, float, float | None]


class TopicAlarms:
    """The alarms of all robots by the topics that they listen to."""

    def __init__(self) -> None:
        self._ids: dict[tuple[str, str], list[str]] = {}  # by (robot, topic's key)
        self._limited: dict[tuple[str, str], dict[ValueKey, list[AlarmInstance]]] = {}  # by the same
        self._changed: dict[tuple[str, str], None] = {}  # the same, of messages that arrived

    def listen(self, alarm: AlarmInstance, keys: Iterable[str]) -> None:
        """Adds an alarm to the topics with these keys."""
        definition = alarm.definition
        described = definition.alarm
        for key in keys:
            place = definition.robot, key
            if described.source == "limits" and not described.conditions:
                scaling = described.scale, described.offset
                value = described.field, *scaling, described.max_age_s
                self._limited.setdefault(place, {}).setdefault(value, []).append(alarm)
            else:
                self._ids.setdefault(place, []).append(definition.id)

    def remove(self, alarm: AlarmInstance) -> None:
        """Removes an alarm that the robot published."""
        condition, definition = alarm.definition.alarm.suppressed_while, alarm.definition
        for ids in self._ids.values() if condition is not None else ():
            if definition.id in ids:
                ids.remove(definition.id)

    def note(self, robot: str, keys: Iterable[str]) -> None:
        """Messages arrived on topics of a robot."""
        self._changed.update(dict.fromkeys((robot, key) for key in keys))

    @property
    def has_changed(self) -> bool:
        """Whether messages arrived since `take` was called."""
        return bool(self._changed)

    def take(self, robots: Mapping[str, RobotState], now: float) -> Iterator[str]:
        """The ids of the alarms that these messages may change; `now` in monotonic seconds."""
        while self._changed:
            place, _ = self._changed.popitem()
            yield from self._ids.get(place, ())
            for alarms in self._limited.get(place, {}).values():
                yield from _unsteady(alarms, robots[place[0]], now)


def _unsteady(alarms: Sequence[AlarmInstance], robot: RobotState, now: float) -> Iterator[str]:
    """The ids of those of which the value leaves the range that changes nothing."""
    value = read_source(alarms[0].definition.alarm, robot, now, now).value
    for alarm in alarms:
        low, high = alarm.steady
        if value is not None and low <= value <= high:
            alarm.value = value
        else:
            yield alarm.definition.id


# Whether the robot still publishes the alarms of a source, diagnostics or a list: before the first
# message, and after the last one has become too old, it is not known whether one of them is active.


class SourceWatch:
    """An instance for each source. One that is not evaluated locks controls as not known. `changes`
    counts how often that has changed."""

    def __init__(self) -> None:
        self._sources: dict[tuple[str, str], AlarmInstance] = {}  # by (robot, alarm's id)
        # When a source of diagnostics has been heard for a whole period, by the same.
        self._whole_at: dict[tuple[str, str], float] = {}
        self.changes = 0

    def add(self, definition: Definition) -> AlarmInstance:
        """The instance of a source from which nothing was heard."""
        source = self._sources[definition.robot, definition.alarm.id] = AlarmInstance(definition)
        return source

    def record_message(self, robot: str, alarm_id: str, at: float) -> None:
        """A message of a source arrived; `at` in monotonic seconds."""
        source = self._sources[robot, alarm_id]
        max_age_s = source.definition.alarm.entry_max_age_s
        if not source.is_evaluated and source.definition.alarm.diagnostics and max_age_s is not None:
            self._whole_at[robot, alarm_id] = at + max_age_s
        source.heard_at = at
        self._set(source, True)

    def expire(self, robots: Mapping[str, RobotState], now: float) -> None:
        """Marks the sources of which the last message is too old, or whose robot can't be reached."""
        for (name, alarm_id), source in self._sources.items():
            robot = robots[name]
            if now >= _stale_at(source) or not robot.link_up or not robot.graph.peers:
                self._set(source, False)
                self._whole_at.pop((name, alarm_id), None)

    def take_whole_periods(self, now: float) -> Iterator[Definition]:
        """The sources of diagnostics that have been heard for a whole period since the start or the
        last cut: each once."""
        for place in [place for place, at in self._whole_at.items() if now >= at]:
            del self._whole_at[place]
            yield self._sources[place].definition

    @property
    def due(self) -> float:
        """When the next source becomes too old (monotonic seconds)."""
        heard = (_stale_at(source) for source in self._sources.values() if source.is_evaluated)
        return min((*heard, *self._whole_at.values()), default=math.inf)

    def _set(self, source: AlarmInstance, is_known: bool) -> None:
        self.changes += source.is_evaluated != is_known
        source.is_evaluated = is_known


def _stale_at(source: AlarmInstance) -> float:
    return stale_at(source.heard_at, source.definition.alarm.entry_max_age_s)


# First-out: which alarm of a group was raised first, and which ones followed it.


class _Raise(NamedTuple):
    """A raise that others may follow, at `at` (monotonic seconds)."""

    id: str
    text: TextLike
    at: float


class FirstOut:
    """The first raise in each group of a robot. Alarms that are raised within `within_s` seconds after
    it follow it while it stands."""

    def __init__(self, within_s: float) -> None:
        self._within_s = within_s
        self._first: dict[tuple[str, str], _Raise] = {}  # by (robot, group)

    def update(
        self,
        alarm: AlarmInstance,
        before: AlarmStatus,
        now: Moment,
        alarms: Mapping[str, AlarmInstance],
    ) -> None:
        """Sets which of `alarms` an alarm follows, if it is raised now; None if it is the first."""
        if alarm.status.occurrence != before.occurrence:
            alarm.leader = self._leader(alarm, now.monotonic, alarms)

    def _leader(
        self, alarm: AlarmInstance, now: float, alarms: Mapping[str, AlarmInstance]
    ) -> Leader | None:
        definition = alarm.definition
        group = definition.robot, str(definition.alarm.group or "")
        if not group[1]:
            return None
        first = self._first.get(group)
        if first and first.id != definition.id and now - first.at <= self._within_s:
            leading = alarms.get(first.id)
            if leading is not None and not leading.status.is_normal:
                return Leader(first.id, first.text, now - first.at)
        self._first[group] = _Raise(definition.id, alarm.text, now)
        return None


log = logging.getLogger("kiosk.alarms")

MAX_EVALUATED: Final = 2_000  # in one evaluation

Act = Callable[[AlarmStatus, Definition], ActResult]


class Restored(NamedTuple):
    """The ids of the records that `AlarmEngine.restore` could not use: of alarms that the panel no
    longer has, and those that can't be read."""

    missing: Sequence[str] = ()
    unreadable: Sequence[str] = ()


class AlarmEngine:
    """Its robots are added one by one. `on_transitions` is called with the transitions of an evaluation
    or an act, `on_removed` with the ids of alarms that made room for more urgent ones. Nothing is
    evaluated before `restore` or `begin`."""

    def __init__(
        self,
        panel: Panel,
        clock: Callable[[], Moment],
        on_transitions: Callable[[Sequence[Transition]], None],
        on_removed: Callable[[Sequence[str]], None] = lambda _: None,
    ) -> None:
        self._panel = panel
        self.robots: dict[str, RobotState] = {}
        self._clock = clock
        self._on_transitions = on_transitions
        self._on_removed = on_removed
        self._began_at = clock().monotonic
        self._seq = 0
        self._waiting: dict[str, None] = {}  # ids of alarms to be evaluated, in order
        self._timers: list[tuple[float, str]] = []  # a heap; an alarm's own `due` is what counts
        self._topics = TopicAlarms()
        self._by_robot: dict[str, dict[str, None]] = {}
        self._sources: dict[tuple[str, str], Definition] = {}  # (robot, alarm's id) → of its entries
        self._entries: dict[tuple[str, str], dict[str, AlarmInstance]] = {}  # by the same, then by id
        # By (robot, control), then by id.
        self._inhibitors: dict[tuple[str, str], dict[str, AlarmInstance]] = {}
        self._watch = SourceWatch()
        self._first_out = FirstOut(panel.alarm_rules.first_out_s)
        self.room = EntryRoom()
        self.alarms: dict[str, AlarmInstance] = {}
        self._lock_changes = 0
        self.has_begun = self._is_restored = False
        self._clear: set[str] = set()  # ids of alarms that were not active before the records were read
        self._occurrences = 0  # those of alarms that are not known here were not above it

    def add_robot(self, robot_id: str, robot: RobotState) -> None:
        """Adds the alarms of a robot by its id, "" for the only one without an id."""
        self.robots[robot_id], self._by_robot[robot_id] = robot, {}
        for definition in define(self._panel, robot_id):
            self._add(definition)

    def _add(self, definition: Definition) -> None:
        alarm, robot = definition.alarm, definition.robot
        if alarm.source in ("diagnostics", "list"):
            self._sources[robot, alarm.id] = definition
            self._entries[robot, alarm.id] = {}
            self._inhibit(self._watch.add(definition))
            return
        instance = self._keep(definition)
        for topic in alarm.evaluated_topics:
            self._topics.listen(instance, self.robots[robot].possible_keys(topic))

    def _keep(self, definition: Definition) -> AlarmInstance:
        status = replace(NORMAL, occurrence=self._occurrences)
        alarm = self.alarms[definition.id] = AlarmInstance(definition, status)
        self._by_robot.setdefault(definition.robot, {})[definition.id] = None
        self._waiting[definition.id] = None
        self._inhibit(alarm)
        return alarm

    def _inhibit(self, alarm: AlarmInstance) -> None:
        for control in alarm.definition.inhibits:
            self._inhibitors.setdefault(control, {})[alarm.definition.id] = alarm

    @property
    def due(self) -> float:
        """When the next evaluation is due (monotonic seconds): 0 if alarms wait for it."""
        if not self.has_begun:
            return math.inf
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

    def add_own(self, definition: Definition) -> None:
        """Adds an alarm of the panel itself, which is of no robot."""
        self._keep(definition)

    def own_changed(self, alarm_id: str, entry: AlarmEntry) -> None:
        """What the server sees of an alarm of the panel itself."""
        alarm = self.alarms[alarm_id]
        alarm.entry = _last_cause(entry, alarm.entry)
        self._waiting[alarm_id] = None

    def evaluate(self, most: int = MAX_EVALUATED) -> None:
        """Evaluates the alarms that wait, and those whose time has come: `most` of them."""
        if not self.has_begun:
            return
        now = self._clock()
        self._watch.expire(self.robots, now.monotonic)
        for source in self._watch.take_whole_periods(now.monotonic):
            self._end_unheard(source)
        self._waiting.update(dict.fromkeys(self._topics.take(self.robots, now.monotonic)))
        while self._timers and self._timers[0][0] <= now.monotonic:
            at, alarm_id = heapq.heappop(self._timers)
            alarm = self.alarms.get(alarm_id)
            if alarm is None:
                continue
            if at == alarm.timer:
                alarm.timer = math.inf
            if alarm.due <= now.monotonic:
                self._waiting[alarm_id] = None
            else:
                self._set_timer(alarm)
        turn = [alarm_id for alarm_id, _ in zip(self._waiting, range(most), strict=False)]
        for alarm_id in turn:
            del self._waiting[alarm_id]
        transitions: list[Transition] = []
        for alarm_id in turn:
            try:
                transitions += self._evaluated(self.alarms[alarm_id], now)
            except Exception:  # the others must not be hidden by it
                log.exception('the alarm "%s" was not evaluated', alarm_id)
        self._emit(transitions)

    def entries_received(
        self,
        robot: str,
        alarm_id: str,
        entries: Iterable[AlarmEntry],
        at: float,
        is_last: bool = True,
        earlier: Collection[str] = (),
        unread: int = 0,
    ) -> None:
        """A robot published entries of an alarm with `diagnostics` or a list, each name once; `at` in
        monotonic seconds. They are the last of their message, or not; `earlier` are those before them,
        and `unread` of the message were not read. A list without `active` has all of its active
        entries, if it was read as a whole."""
        self._watch.record_message(robot, alarm_id, at)
        source = self._sources[robot, alarm_id]
        named = {entry.name: entry for entry in entries}
        for entry in named.values():
            entry_id = f"{source.id}:{entry.name}"
            alarm = self.alarms.get(entry_id)
            if alarm is None and entry.level:
                alarm = self._new_entry(source.of_entry(entry), entry)
            if alarm is not None:
                self._receive_entry(alarm, source, entry, at)
            elif not entry.level:
                self.room.ended(entry_id)
        if not is_last:
            return
        self.room.set_unread(source.id, unread)
        listed = source.alarm.listed
        if listed is not None and listed.active is None and not unread:
            names = {*named, *earlier}
            self.room.keep_only(source.id, {f"{source.id}:{name}" for name in names})
            self._end_missing(source, names, at)

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

    def _new_entry(self, definition: Definition, entry: AlarmEntry) -> AlarmInstance | None:
        """The alarm of an entry that was not there before; None if there is no room for it."""
        entry_id = definition.id
        if not self.room.is_free:
            leaving = self.room.find_less_urgent(entry, self._entry_alarms(), self._waiting, self.now())
            if leaving is None:
                self.room.leave_out(entry_id)
                return None
            self._remove_entry(leaving)
        self.room.take(entry_id)
        alarm = self._keep(definition)
        if definition.alarm.suppressed_while is not None:
            topic = definition.alarm.suppressed_while.topic
            self._topics.listen(alarm, self.robots[definition.robot].possible_keys(topic))
        self._entries[definition.robot, definition.alarm.id][entry_id] = alarm
        return alarm

    def _entry_alarms(self) -> Iterator[AlarmInstance]:
        return (alarm for alarms in self._entries.values() for alarm in alarms.values())

    def _remove_entry(self, alarm: AlarmInstance) -> None:
        """Removes an alarm that makes room for another one."""
        definition, alarm_id = alarm.definition, alarm.definition.id
        self._occurrences = max(self._occurrences, alarm.status.occurrence)
        del self.alarms[alarm_id]
        del self._entries[definition.robot, definition.alarm.id][alarm_id]
        self._by_robot[definition.robot].pop(alarm_id, None)
        self._waiting.pop(alarm_id, None)
        self._topics.remove(alarm)
        for control in definition.inhibits:
            self._inhibitors[control].pop(alarm_id, None)
            self._lock_changes += 1
        self.room.free(alarm_id)
        if alarm.entry is not None and alarm.entry.level:
            self.room.leave_out(alarm_id)
        if not alarm.is_unlisted:
            log.warning('too many alarms: "%s" made room for a more urgent one', alarm_id)
            self._on_removed([alarm_id])

    def _end_missing(self, source: Definition, named: Collection[str], at: float) -> None:
        """Ends the entries of a source that are not among those of a whole list or period."""
        for alarm in self._entries[source.robot, source.alarm.id].values():
            entry = alarm.entry
            if entry is None or entry.name in named:
                continue
            if entry.level or alarm.status.unknown_since:
                self._waiting[alarm.definition.id] = None
            alarm.entry, alarm.heard_at = entry._replace(level=0), at

    def _end_unheard(self, source: Definition) -> None:
        """Ends the entries that the robot has not published again for a whole period after a cut or a
        restart. They stay ended however old that is."""
        known = self._entries[source.robot, source.alarm.id].values()
        heard = {a.entry.name for a in known if a.entry is not None and a.heard_at > -math.inf}
        self._end_missing(source, heard, math.inf)

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
        if not self._is_restored and 0 in levels:
            self._clear.add(definition.id)
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
        """Applies an act to an alarm: `apply` calls a function of `app/cell/alarms/states.py`. None if
        there is no such alarm."""
        alarm = self.alarms.get(alarm_id)
        if alarm is None:
            return None
        before, lock = alarm.status, alarm.lock
        if not self.has_begun:
            return ActResult(before, say("alarms_not_read_yet"))
        result = apply(before, alarm.definition)
        alarm.status = result.status
        self._note_lock(alarm, lock)
        if result.status.shelf and result.status.shelf != before.shelf:
            self._waiting[alarm_id] = None  # its end is a time
        if result.status != before:
            self._emit([self._transition(alarm, before, self._clock(), act, actor)])
        return result

    def begin(self, occurrences: int = 0) -> None:
        """Begins to evaluate. The next occurrence of each alarm is above `occurrences`."""
        self.has_begun, self._occurrences = True, max(self._occurrences, occurrences)
        for alarm in self.alarms.values():
            if alarm.status.occurrence < self._occurrences and alarm.is_unlisted:
                alarm.status = replace(alarm.status, occurrence=self._occurrences)

    def restore(self, records: Mapping[str, str], occurrences: int = 0) -> Restored:
        """Restores the alarms of an earlier run from their records, each by itself: their sources are
        unknown until they are heard. One that has changed since the start of this run is merged with
        its record. Begins to evaluate."""
        now = self._clock()
        missing: list[str] = []
        unreadable: list[str] = []
        self._occurrences = max(self._occurrences, occurrences)
        for alarm_id, record in records.items():
            try:
                alarm = self.alarms.get(alarm_id) or self._restored_entry(alarm_id, record)
                if alarm is None or alarm.definition.id != alarm_id:
                    missing.append(alarm_id)
                if alarm is not None:
                    self._restore(alarm, record, now)
            except UNREADABLE as error:
                log.error(
                    'the record of the alarm "%s" can\'t be read (%s): %s', alarm_id, error, record
                )
                unreadable.append(alarm_id)
        self.begin()
        self._is_restored, self._clear = True, set()
        return Restored(tuple(missing), tuple(unreadable))

    def _restore(self, alarm: AlarmInstance, record: str, now: Moment) -> None:
        rules, lock = alarm.definition.rules, alarm.lock
        known, leader, entry = status_in(record, rules, now), leader_in(record), entry_in(record)
        if not alarm.is_unlisted:
            was_clear = alarm.definition.id in self._clear
            known = merge(known, alarm.status, rules, now, was_clear)
        alarm.restore(known)
        alarm.leader = alarm.leader or leader
        if entry is not None and not alarm.definition.is_of_robot:
            alarm.entry = entry if alarm.entry is None else _last_cause(alarm.entry, entry)
        self._waiting[alarm.definition.id] = None
        self._note_lock(alarm, lock)

    def _restored_entry(self, alarm_id: str, record: str) -> AlarmInstance | None:
        entry = entry_in(record)
        source = next((s for s in self._sources.values() if alarm_id.startswith(f"{s.id}:")), None)
        if entry is None or source is None:
            return None
        entry = entry._replace(name=entry_name(entry.name))  # an earlier version named it otherwise
        definition = source.of_entry(entry)
        alarm = self.alarms.get(definition.id) or self._new_entry(definition, entry)
        if alarm is not None and alarm.entry is None:
            alarm.entry = entry
        return alarm

    def standing(self) -> list[AlarmInstance]:
        """The alarms that are not normal, or that are shelved, suppressed or out of service: the most
        urgent first, then the newest."""
        listed = [alarm for alarm in self.alarms.values() if not alarm.is_unlisted]
        return sorted(listed, key=lambda alarm: alarm.order)

    def inhibited(self, robot: str) -> Mapping[str, list[AlarmInstance]]:
        """The controls of a robot that alarms lock now, each with these alarms, also of other robots:
        those that are known first, of these the most urgent."""
        locks: dict[str, list[AlarmInstance]] = {}
        for (known, widget), alarms in self._inhibitors.items():
            inhibiting = [a for a in alarms.values() if a.inhibits] if known == robot else []
            if inhibiting:
                locks[widget] = sorted(inhibiting, key=lambda alarm: (alarm.lock[1], alarm.order))
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


def _last_cause(entry: AlarmEntry, before: AlarmEntry | None) -> AlarmEntry:
    """The entry of one of the panel's own alarms: one that returns still says what its cause was."""
    return entry if entry.level or before is None else before._replace(level=0)
