"""The alarms of all robots of a panel: evaluates their sources and applies acts.

An evaluation looks only at alarms of which a topic has changed or a time has come, and at a bounded
number of them. Used on the event loop only.
"""

import heapq
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from app.alarms.delays import DelayedCondition
from app.alarms.entries import AlarmEntry
from app.alarms.instance import AlarmInstance, Definition, define
from app.alarms.records import entry_in, status_in
from app.alarms.sources import UNKNOWN, SourceReading, read_source
from app.alarms.status import ActResult, AlarmStatus, Moment, expire, update_level
from app.panel.model import Panel
from app.robot.state import RobotState

MAX_EVALUATED: Final = 2_000  # in one evaluation
MAX_ENTRIES: Final = 10_000  # alarms that the robots publish themselves


class Transition(NamedTuple):
    """A change of an alarm: `seq` gives the order. `act` is the act that caused it, "" for none, and
    `actor` its actor. `value` is that of the source."""

    seq: int
    at: Moment
    id: str
    before: AlarmStatus
    after: AlarmStatus
    act: str = ""
    actor: str = ""
    value: float | None = None


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
        self._robots: dict[str, RobotState] = {}
        self._clock = clock
        self._on_transitions = on_transitions
        self._began_at = clock().monotonic
        self._seq = 0
        self._waiting: dict[str, None] = {}  # ids of alarms to be evaluated, in order
        self._timers: list[tuple[float, str]] = []  # a heap; an alarm's own `due` is what counts
        self._by_topic: dict[tuple[str, str], list[str]] = {}
        self._by_robot: dict[str, list[str]] = {}
        self._sources: dict[tuple[str, str], Definition] = {}  # (robot, alarm's id) → of its entries
        self._entries: dict[tuple[str, str], list[AlarmInstance]] = {}  # by the same
        self._inhibitors: dict[tuple[str, str], list[AlarmInstance]] = {}  # by (robot, widget)
        self._refused = 0  # entries beyond `MAX_ENTRIES`
        self.alarms: dict[str, AlarmInstance] = {}

    def add_robot(self, robot_id: str, robot: RobotState) -> None:
        """Adds the alarms of a robot by its id, "" for the only one without an id."""
        self._robots[robot_id], self._by_robot[robot_id] = robot, []
        for definition in define(self._panel, robot_id):
            self._add(definition)

    def _add(self, definition: Definition) -> None:
        alarm, robot = definition.alarm, definition.robot
        if alarm.source in ("diagnostics", "list"):
            self._sources[robot, alarm.id] = definition
            self._entries[robot, alarm.id] = []
            return
        self._keep(definition)
        if alarm.topic is not None:
            for key in self._robots[robot].possible_keys(alarm.topic):
                self._by_topic.setdefault((robot, key), []).append(definition.id)

    def _keep(self, definition: Definition) -> AlarmInstance:
        alarm = self.alarms[definition.id] = AlarmInstance(definition)
        self._by_robot[definition.robot].append(definition.id)
        self._waiting[definition.id] = None
        for widget in definition.alarm.inhibits:
            self._inhibitors.setdefault((definition.robot, widget), []).append(alarm)
        return alarm

    @property
    def due(self) -> float:
        """When the next evaluation is due (monotonic seconds): 0 if alarms wait for it."""
        if self._waiting:
            return 0.0
        return self._timers[0][0] if self._timers else math.inf

    @property
    def refused_entries(self) -> int:
        """How many entries of robots were not kept, as there were too many."""
        return self._refused

    def now(self) -> Moment:
        return self._clock()

    def topics_changed(self, robot: str, keys: Iterable[str]) -> None:
        """Messages arrived on topics of a robot."""
        for key in keys:
            self._waiting.update(dict.fromkeys(self._by_topic.get((robot, key), ())))

    def robot_changed(self, robot: str) -> None:
        """The link to a robot, or its graph, has changed."""
        self._waiting.update(dict.fromkeys(self._by_robot[robot]))

    def evaluate(self, most: int = MAX_EVALUATED) -> None:
        """Evaluates the alarms that wait, and those whose time has come: `most` of them."""
        now = self._clock()
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
        self, robot: str, alarm_id: str, entries: Iterable[AlarmEntry], at: float
    ) -> None:
        """A robot published entries of an alarm with `diagnostics` or a list; `at` in monotonic
        seconds. A list without `active` has all of its active entries."""
        source = self._sources[robot, alarm_id]
        named = {entry.name: entry for entry in entries}
        for entry in named.values():
            definition = source.of_entry(entry)
            alarm = self.alarms.get(definition.id)
            if alarm is None and entry.level:
                alarm = self._new_entry(definition)
            if alarm is not None:
                alarm.definition, alarm.entry, alarm.heard_at = definition, entry, at
                self._waiting[definition.id] = None
        listed = source.alarm.listed
        if listed is not None and listed.active is None:
            self._end_missing(source, named)

    def _new_entry(self, definition: Definition) -> AlarmInstance | None:
        if sum(map(len, self._entries.values())) >= MAX_ENTRIES:
            self._refused += 1
            return None
        alarm = self._keep(definition)
        self._entries[definition.robot, definition.alarm.id].append(alarm)
        return alarm

    def _end_missing(self, source: Definition, named: Mapping[str, AlarmEntry]) -> None:
        for alarm in self._entries[source.robot, source.alarm.id]:
            entry = alarm.entry
            if entry is not None and entry.name not in named and entry.level:
                alarm.entry = entry._replace(level=0)
                self._waiting[alarm.definition.id] = None

    def _evaluated(self, alarm: AlarmInstance, now: Moment) -> Iterator[Transition]:
        """Evaluates one alarm; returns its transitions."""
        definition, before = alarm.definition, alarm.status
        reading = self._read(alarm, now.monotonic)
        status = expire(before, definition.rules, now)
        levels, conditions = _levels(alarm, reading, now.monotonic)
        alarm.set_conditions(conditions)
        for level in levels:
            status = update_level(status, definition.rules, level, now)
        alarm.status, alarm.value = status, reading.value if reading.is_known else alarm.value
        self._set_due(alarm, reading.until)
        if not status.is_same_to_operators(before):
            yield self._transition(alarm, before, now)

    def _read(self, alarm: AlarmInstance, now: float) -> SourceReading:
        definition, robot = alarm.definition, self._robots[alarm.definition.robot]
        if alarm.entry is None:
            return read_source(definition.alarm, robot, now, self._began_at)
        if not robot.link_up or not robot.graph.peers or alarm.heard_at == -math.inf:
            return UNKNOWN
        max_age_s = definition.alarm.max_age_s
        stale_at = math.inf if max_age_s is None else alarm.heard_at + max_age_s
        if now >= stale_at:
            return UNKNOWN
        return SourceReading(met=alarm.entry.level > 0, until=stale_at)

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
        before = alarm.status
        result = apply(before, alarm.definition)
        alarm.status = result.status
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
                self._waiting[alarm_id] = None
        return missing

    def _restored_entry(self, alarm_id: str, record: str) -> AlarmInstance | None:
        entry = entry_in(record)
        candidates = self._sources.values()
        source = next((s for s in candidates if alarm_id.startswith(f"{s.id}:")), None)
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

    def inhibiting(self, robot: str, widget: str) -> Iterator[AlarmInstance]:
        """The alarms of a robot that lock a control now."""
        alarms = self._inhibitors.get((robot, widget), ())
        yield from (alarm for alarm in alarms if alarm.inhibits)

    def _transition(
        self, alarm: AlarmInstance, before: AlarmStatus, now: Moment, act: str = "", actor: str = ""
    ) -> Transition:
        self._seq += 1
        return Transition(
            self._seq, now, alarm.definition.id, before, alarm.status, act, actor, alarm.value
        )

    def _emit(self, transitions: Sequence[Transition]) -> None:
        if transitions:
            self._on_transitions(transitions)


def _levels(
    alarm: AlarmInstance, reading: SourceReading, now: float
) -> tuple[tuple[int | None, ...], tuple[DelayedCondition, ...]]:
    """The levels that the condition has in turn, None for unknown, and its conditions after them. From
    one end of the range to the other it returns in between."""
    if not reading.is_known:
        return (None,), alarm.conditions
    definition = alarm.definition
    pairs = tuple(zip(definition.thresholds, alarm.conditions, strict=True))
    conditions = tuple(
        condition.heard(reading.exceeds(limit, condition.met), now, definition.delays)
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
