"""The alarms that pages show: their rows, the order of the rows, counts and selections."""

import math
import re
from bisect import bisect_left, insort
from collections import Counter, defaultdict, deque
from collections.abc import Collection, Iterator, Mapping
from itertools import islice
from typing import Final, Literal, NamedTuple, TypedDict, get_args

from app.cell.alarms.states import (
    HIGH,
    AlarmInstance,
    AlarmRules,
    AlarmStatus,
    Leader,
    Moment,
    State,
    TakenOut,
    Transition,
)
from app.cell.robot.alarmed import AlarmedValues, AlarmSelection, ValueAlarm
from app.panel.model import Panel
from app.panel.numbers import DIGITS, brief, decimal_text, formatted
from app.panel.widgets.alarm_views import MOST_LINES, AlarmView
from app.system.clock import format_time, iso_time
from app.system.texts import TextLike, number, say

# An alarm as pages, events and programs get it: JSON values, and texts where a person reads.

RowState = Literal[
    "active", "returned", "latched", "shelved", "suppressed", "out_of_service", "unknown", "normal"
]
LISTED_STATES: Final = tuple(state for state in get_args(RowState) if state != "normal")
STATES: Final[Mapping[State, RowState]] = {
    State.NORMAL: "normal",
    State.UNACKNOWLEDGED: "active",
    State.ACKNOWLEDGED: "active",
    State.RETURNED_UNACKNOWLEDGED: "returned",
    State.LATCHED_UNACKNOWLEDGED: "latched",
    State.LATCHED_ACKNOWLEDGED: "latched",
}
# The code of the word for each state: of an acknowledged alarm, and of one that is not.
STATE_WORDS: Final[Mapping[RowState, tuple[str, str]]] = {
    "active": ("alarm_state_active", "alarm_state_active_unacknowledged"),
    "returned": ("alarm_state_normal", "alarm_state_returned_unacknowledged"),
    "latched": ("alarm_state_latched", "alarm_state_latched_unacknowledged"),
    "unknown": ("alarm_state_unknown", "alarm_state_unknown_unacknowledged"),
    "shelved": ("alarm_state_shelved", "alarm_state_shelved"),
    "suppressed": ("alarm_state_suppressed", "alarm_state_suppressed"),
    "out_of_service": ("alarm_state_out_of_service", "alarm_state_out_of_service"),
    "normal": ("alarm_state_normal", "alarm_state_normal"),
}
PRIORITY_WORDS: Final = (
    "",
    "alarm_priority_1",
    "alarm_priority_2",
    "alarm_priority_3",
    "alarm_priority_4",
)
PANEL: Final = "panel"  # the source of the panel's own alarms


def panel_id(alarm_id: str) -> str:
    """The id in the panel file of an alarm of a robot, or of one that the robot publishes."""
    return alarm_id.partition(":")[0].partition("@")[0]


class TakenOutRow(TypedDict):
    """A shelf, or out of service: `who` did it, `since` and `until` are RFC 3339; "" for no end."""

    since: str
    since_text: TextLike
    until: str
    until_text: TextLike
    reason: str
    who: str


class AlarmRow(TypedDict):
    """An alarm at its last change. `state` is that of the public contract, `before_unknown` the same as
    if its source were known. `since` (RFC 3339) is when it was raised, "" if it was not. `value` is
    that of its last change, null without one; `limit` the limit that it exceeds. `details` are key
    values of a diagnostic status. `acts` are the acts that are possible now. `follows` is the id of the
    alarm of its group that was raised first, "" for none, and `follows_text` says how long before.
    `order` sorts rows: the most urgent first.
    Keys that end with `_text` are for people."""

    id: str
    robot: str
    source: str
    group: TextLike
    priority: int
    priority_text: TextLike
    state: RowState
    before_unknown: RowState
    state_text: TextLike
    acknowledged: bool
    known: bool
    occurrence: int
    since: str
    since_text: TextLike
    text: TextLike
    cause: TextLike
    consequence: TextLike
    action: TextLike
    details: TextLike
    picture: str
    topic: str
    field: str
    value: float | None
    value_text: TextLike
    limit: float | None
    limit_text: TextLike
    shelf: TakenOutRow | None
    out_of_service: TakenOutRow | None
    acts: list[str]
    follows: str
    follows_text: TextLike
    order: list[float]


def row_of(alarm: AlarmInstance, now: Moment) -> AlarmRow:
    """The row of an alarm as it is now."""
    status, definition = alarm.status, alarm.definition
    described, entry, raised_at = definition.alarm, alarm.entry, status.raised_at
    limit, leader = alarm.limit, alarm.leader
    return AlarmRow(
        id=definition.id,
        robot=definition.robot,
        source=described.source or PANEL,
        group=described.group or "",
        priority=alarm.priority,
        priority_text=say(PRIORITY_WORDS[alarm.priority]),
        state=state_of(status),
        before_unknown=status.override.value if status.override else STATES[status.state],
        state_text=state_text(status),
        acknowledged=status.is_acknowledged,
        known=status.unknown_since is None,
        occurrence=status.occurrence,
        since=iso_time(raised_at.wall) if raised_at else "",
        since_text=format_time(raised_at.wall) if raised_at else "",
        text=alarm.text,
        cause=(entry and entry.cause) or described.cause or "",
        consequence=(entry and entry.consequence) or described.consequence or "",
        action=alarm.action,
        details=entry.details if entry else "",
        picture=described.picture or "",
        topic=described.topic_name or "",
        field=described.field if described.source == "limits" else "",
        value=alarm.value,
        value_text=value_text(alarm.value, described.unit, described.format),
        limit=limit,
        limit_text=limit_text(limit, described.unit, described.format),
        shelf=_taken_out(status.shelf, now),
        out_of_service=_taken_out(status.out_of_service, now),
        acts=list(_acts(alarm)),
        follows=leader.id if leader else "",
        follows_text=follows_text(leader) if leader else "",
        order=_order(alarm),
    )


def state_of(status: AlarmStatus) -> RowState:
    """The state by its name in the public contract; `normal` for one that is not listed."""
    if status.override:
        return status.override.value
    if status.unknown_since and not status.is_normal:
        return "unknown"
    return STATES[status.state]


def state_text(status: AlarmStatus) -> TextLike:
    """The word for the state."""
    acknowledged, unacknowledged = STATE_WORDS[state_of(status)]
    return say(acknowledged if status.is_acknowledged else unacknowledged)


def _acts(alarm: AlarmInstance) -> Iterator[str]:
    """The acts that are possible."""
    status = alarm.status
    if not status.is_acknowledged and not status.override:
        yield "acknowledge"
    if status.state is State.LATCHED_ACKNOWLEDGED and not status.override and not status.unknown_since:
        yield "reset"
    if status.shelf:
        yield "unshelve"
    elif alarm.priority != HIGH and not status.out_of_service:
        yield "shelve"
    yield "in_service" if status.out_of_service else "out_of_service"


def _order(alarm: AlarmInstance) -> list[float]:
    """Those that stand before those that are shelved, suppressed or out of service, the unacknowledged
    first, by priority, then the newest."""
    acknowledged, priority, raised = alarm.order
    return [int(alarm.status.override is not None), int(acknowledged), priority, raised]


def follows_text(leader: Leader) -> TextLike:
    """How long after which alarm."""
    return say("alarms_follows_after", seconds=number(f"{leader.after_s:.1f}", "s"), name=leader.text)


def value_text(value: float | None, unit: TextLike, style: str | None = None) -> TextLike:
    """A value of an alarm in a format of the panel file, "" for none."""
    if value is None:
        return ""
    if style is None or not math.isfinite(value):
        return number(decimal_text(brief(value)), unit)
    return number(formatted(value, style), unit)


def limit_text(limit: float | None, unit: TextLike, style: str | None = None) -> TextLike:
    """A limit as the panel file has it, with all its digits; in percent where the value is."""
    if limit is None:
        return ""
    if style is not None and style.endswith("%"):
        return number(f"{decimal_text(float(f'{limit * 100:.{DIGITS}g}'))}%", unit)
    return number(decimal_text(limit), unit)


def _taken_out(taken: TakenOut | None, now: Moment) -> TakenOutRow | None:
    if taken is None:
        return None
    since, left_s = taken.since.wall, taken.until - now.monotonic
    until = now.wall + left_s if left_s < 1e9 else None
    return TakenOutRow(
        since=iso_time(since),
        since_text=format_time(since),
        until=iso_time(until) if until else "",
        until_text=format_time(until) if until else "",
        reason=taken.reason,
        who=taken.actor,
    )


# Rows of alarms in their order, and how many there are of each kind: a change costs no walk over all of
# them.


class SortedRows:
    """The rows by their ids, and the most urgent first."""

    def __init__(self) -> None:
        self.by_id: dict[str, AlarmRow] = {}
        self.counts: Counter[str] = Counter()
        self._order: list[tuple[tuple[float, ...], str]] = []

    def update(self, alarm_id: str, row: AlarmRow | None) -> AlarmRow | None:
        """Puts a row in place of the alarm's last one, which it returns; None is no row."""
        before = self.by_id.pop(alarm_id, None)
        if before is not None:
            del self._order[bisect_left(self._order, _key(before))]
            self.counts.subtract(_counted(before))
        if row is not None:
            self.by_id[alarm_id] = row
            insort(self._order, _key(row))
            self.counts.update(_counted(row))
        return before

    def listed(self) -> Iterator[AlarmRow]:
        """All rows, the most urgent first."""
        return (self.by_id[alarm_id] for _, alarm_id in self._order)

    @property
    def line(self) -> AlarmRow | None:
        """The newest unacknowledged alarm of the highest priority that stands."""
        first = next(self.listed(), None)
        return first if first and not (first["acknowledged"] or first["order"][0]) else None


def _key(row: AlarmRow) -> tuple[tuple[float, ...], str]:
    return tuple(row["order"]), row["id"]


def _counted(row: AlarmRow) -> Iterator[str]:
    """The names under which a row is counted."""
    if row["order"][0]:
        yield row["state"]
        return
    names = ["standing", *([] if row["acknowledged"] else ["unacknowledged"])]
    for name in names:
        yield name
        yield f"{name} {row['priority']}"
    if row["before_unknown"] == "active":
        yield "active"
    if row["state"] == "unknown":
        yield "unknown"


# The alarms that widgets of the pages show: those of a group, of priorities, of a robot.


class _Filter(NamedTuple):
    """`robot` None and the others empty are all."""

    robot: str | None
    groups: frozenset[str]
    priorities: frozenset[int]

    def takes(self, row: AlarmRow) -> bool:
        return (
            self.robot in (None, row["robot"])
            and (not self.groups or str(row["group"]) in self.groups)
            and (not self.priorities or row["priority"] in self.priorities)
        )


class AlarmSelections:
    """The selections of all robots' pages. A panel without such widgets pays nothing. Widgets with the
    same filter share one."""

    def __init__(self) -> None:
        self._rows: dict[_Filter, SortedRows] = {}
        self._filters: dict[str, dict[str, _Filter]] = {}  # by robot and widget id
        self._made: dict[_Filter, AlarmSelection] = {}

    def add_robot(self, robot: str, panel: Panel) -> None:
        """Before the first row."""
        shown = (widget for widget in panel.displays if isinstance(widget, AlarmView))
        filters = {widget.id: _filter(widget, robot) for widget in shown}
        self._filters[robot] = filters
        for wanted in filters.values():
            self._rows.setdefault(wanted, SortedRows())

    def update(self, before: AlarmRow | None, after: AlarmRow | None) -> None:
        """A row is shown in place of another; None for an alarm that is not listed."""
        row = after or before
        if row is None:
            return
        for wanted, rows in self._rows.items():
            shown = after if after is not None and wanted.takes(after) else None
            if shown is not None or row["id"] in rows.by_id:
                rows.update(row["id"], shown)
                self._made.pop(wanted, None)

    def of_robot(self, robot: str) -> Mapping[str, AlarmSelection]:
        """What the widgets of a robot's pages show now, by their ids."""
        return {name: self._selection(wanted) for name, wanted in self._filters[robot].items()}

    def _selection(self, wanted: _Filter) -> AlarmSelection:
        made = self._made.get(wanted)
        if made is None:
            rows = self._rows[wanted]
            shown = tuple(islice(rows.listed(), MOST_LINES))
            made = self._made[wanted] = AlarmSelection(
                rows.line,
                shown,
                len(rows.by_id) - len(shown),
                rows.counts["standing"],
                rows.counts["active"],
                rows.counts["unacknowledged"],
            )
        return made


def _filter(widget: AlarmView, robot: str) -> _Filter:
    return _Filter(
        robot if widget.robots == "this" else None,
        frozenset(widget.group),
        frozenset(widget.priorities),
    )


# Which values of the robots have an active alarm, from the rows that pages show.

Value = tuple[str, str]  # topic and field
BEHIND_ID: Final = re.compile("[@:]")  # the robot, or the name of what it published


class AlarmMarks:
    """The marks of all robots. Alarms that are about no value cost nothing."""

    def __init__(self, panel: Panel) -> None:
        self._alarms = {
            alarm.id: alarm for alarm in panel.alarms if alarm.state is not None or alarm.marked_values
        }
        self._unmarked: dict[str, Mapping[Value, int]] = {}  # robot → 0 of each value
        self._state_topic = panel.state.topic if panel.state else None
        self._active: dict[str, dict[str, AlarmRow]] = {}  # robot → id → row
        self._changed: dict[str, set[str]] = {}  # robot → topics

    def update(self, before: AlarmRow | None, after: AlarmRow | None) -> None:
        """A row is shown in place of another; None for an alarm that is not listed."""
        row = after or before
        alarm = row and self._alarms.get(_alarm_id(row))
        if row is None or alarm is None:
            return
        active = self._active.setdefault(row["robot"], {})
        was_active = active.pop(row["id"], None) is not None
        if after is not None and after["state"] == "active":
            active[row["id"]] = after
        elif not was_active:
            return
        changed = self._changed.setdefault(row["robot"], set())
        changed.update(topic for topic, _ in alarm.marked_values)
        if alarm.state is not None and self._state_topic is not None:
            changed.add(self._state_topic)

    def take_changes(self) -> Mapping[str, Collection[str]]:
        """The topics of which the marks have changed since the last call, by robot."""
        changed, self._changed = self._changed, {}
        return changed

    def of_robot(self, robot: str) -> AlarmedValues:
        """The marks of a robot as they are now."""
        if robot not in self._unmarked:
            marked = (alarm for alarm in self._alarms.values() if alarm.is_for(robot or None))
            values = (value for alarm in marked for value in alarm.marked_values)
            self._unmarked[robot] = dict.fromkeys(values, 0)
        priorities = dict(self._unmarked[robot])
        state: ValueAlarm | None = None
        for row in sorted(self._active.get(robot, {}).values(), key=lambda row: row["order"]):
            alarm = self._alarms[_alarm_id(row)]
            for value in alarm.marked_values:
                priorities[value] = min(row["priority"], priorities[value] or row["priority"])
            if state is None and alarm.state is not None:
                state = ValueAlarm(alarm.state, -row["order"][-1])
        return AlarmedValues(state, priorities)


def _alarm_id(row: AlarmRow) -> str:
    """The id of the alarm in the panel file."""
    return BEHIND_ID.split(row["id"], 1)[0]


# The alarms that pages show: the rows in their order, and how many there are of each kind.

MAX_ROWS: Final = 500  # that are listed; the others are counted
PRIORITIES: Final = (1, 2, 3, 4)
# EEMUA 191: more than so many raises in so many seconds is a flood.
FLOOD_RAISES: Final = 10
FLOOD_S: Final = 600.0


class PriorityCount(TypedDict):
    standing: int
    unacknowledged: int
    raised: int


class OpenStop(TypedDict):
    """A stop without a reason: that of a robot ("" for the only one) which began at `began` (seconds
    since the epoch)."""

    robot: str
    began: float


class AskedReason(TypedDict):
    """The question why robots stood still. Of one stop `text` says for how long, `times` from when to
    when. `shift_ends` (seconds since the epoch) is the end of the shift shortly before which it is
    asked, 0 for one that is asked earlier."""

    stops: list[OpenStop]
    text: TextLike
    times: TextLike
    shift_ends: float


class AlarmsView(TypedDict):
    """The section `alarms` of a view. `line` is the newest unacknowledged alarm of the highest
    priority. `standing` counts the alarms that are not normal; `active`, `unacknowledged` and `unknown`
    are of these: also those are active whose source is not known since they were. `raised` counts the
    raises since the server's start that are to be acknowledged. The shelved, suppressed and those out
    of service are counted apart. `rows` has the first `MAX_ROWS` by their ids, and `more` is how many
    follow, `more_text` the same as a sentence, "" for none. `fault`: why they are not kept on the disk,
    "" if they are. `asked` is the question for the reasons of stops, None for none."""

    line: AlarmRow | None
    standing: int
    active: int
    unacknowledged: int
    unknown: int
    priorities: Mapping[str, PriorityCount]
    shelved: int
    suppressed: int
    out_of_service: int
    flood: bool
    fault: TextLike
    more: int
    more_text: TextLike
    rows: Mapping[str, AlarmRow]
    asked: AskedReason | None


NO_ALARMS: Final = AlarmsView(
    line=None,
    standing=0,
    active=0,
    unacknowledged=0,
    unknown=0,
    priorities={
        str(priority): PriorityCount(standing=0, unacknowledged=0, raised=0) for priority in PRIORITIES
    },
    shelved=0,
    suppressed=0,
    out_of_service=0,
    flood=False,
    fault="",
    more=0,
    more_text="",
    rows={},
    asked=None,
)


class PendingRow(NamedTuple):
    """A change that is not on the disk yet: `since` in monotonic seconds."""

    seq: int
    id: str
    row: AlarmRow | None
    since: float


class AlarmTable:
    """The rows of all alarms, and what else follows them."""

    def __init__(self, marks: AlarmMarks) -> None:
        self.marks = marks
        self.selections = AlarmSelections()
        self._sorted = SortedRows()
        self._raised_to_acknowledge: Counter[int] = Counter()  # by priority
        self._raised: deque[float] = deque(maxlen=FLOOD_RAISES + 1)

    def update(self, alarm_id: str, row: AlarmRow | None) -> None:
        """Shows a row in place of the alarm's last one; None for an alarm that is not listed."""
        before = self._sorted.update(alarm_id, row)
        self.selections.update(before, row)
        self.marks.update(before, row)

    def count_raise(self, alarm: AlarmInstance, now: float) -> None:
        """An alarm was raised at `now` (monotonic seconds)."""
        self._raised.append(now)
        if not (alarm.status.is_acknowledged or alarm.status.override):
            self._raised_to_acknowledge[alarm.priority] += 1

    def flood_ends_at(self) -> float:
        """Until when there are more raises than an operator can follow; -inf if there are not."""
        return self._raised[0] + FLOOD_S if len(self._raised) > FLOOD_RAISES else -math.inf

    def listed(self) -> Iterator[AlarmRow]:
        """All rows, the most urgent first."""
        return self._sorted.listed()

    @property
    def rows(self) -> Mapping[str, AlarmRow]:
        """The rows by their ids."""
        return self._sorted.by_id

    def view(self, now: float, fault: TextLike = "", asked: AskedReason | None = None) -> AlarmsView:
        """The section at `now` (monotonic seconds)."""
        rows = {row["id"]: row for row in islice(self.listed(), MAX_ROWS)}
        counts, more = self._sorted.counts, len(self.rows) - len(rows)
        return AlarmsView(
            line=self._sorted.line,
            standing=counts["standing"],
            active=counts["active"],
            unacknowledged=counts["unacknowledged"],
            unknown=counts["unknown"],
            priorities={
                str(priority): PriorityCount(
                    standing=counts[f"standing {priority}"],
                    unacknowledged=counts[f"unacknowledged {priority}"],
                    raised=self._raised_to_acknowledge[priority],
                )
                for priority in PRIORITIES
            },
            shelved=counts["shelved"],
            suppressed=counts["suppressed"],
            out_of_service=counts["out_of_service"],
            flood=now < self.flood_ends_at(),
            fault=fault,
            more=more,
            more_text=more_text(more),
            rows=rows,
            asked=asked,
        )


def more_text(more: int) -> TextLike:
    """How many alarms are counted and not listed; "" for none."""
    return say("alarms_more", count=number(str(more))) if more else ""


def outdated(alarms: Mapping[str, AlarmInstance], rows: Mapping[str, AlarmRow], most: int) -> list[str]:
    """The ids of rows of which the robot, or the panel itself, says something else now, without a
    change of state: such as the values of a diagnostic status. At most so many."""
    changed = (
        alarm_id
        for alarm_id, row in rows.items()
        if (alarm := alarms.get(alarm_id)) is not None
        and (entry := alarm.entry) is not None
        and entry.level
        and (
            (entry.details, alarm.text) != (row["details"], row["text"])
            or (entry.cause and entry.cause != row["cause"])
            or (entry.consequence and entry.consequence != row["consequence"])
        )
    )
    return list(islice(changed, most))


# How often alarms were raised and acknowledged since the start of the server.


class AlarmCounts:
    """By priority: how many alarms were raised and acknowledged, and the seconds from the raises to the
    acknowledgements together."""

    def __init__(self) -> None:
        self.raised: Counter[int] = Counter()
        self.acknowledged: Counter[int] = Counter()
        self.acknowledge_s: defaultdict[int, float] = defaultdict(float)

    def count(self, transition: Transition, rules: AlarmRules) -> bool:
        """Counts a transition of an alarm with such rules; whether it raised it."""
        before, after = transition.before, transition.after
        is_raised = after.occurrence != before.occurrence
        if is_raised:
            self.raised[_priority(after, rules)] += 1
        if before.raised_at and after.is_acknowledged and transition.act == "acknowledge":
            priority = _priority(before, rules)
            self.acknowledged[priority] += 1
            self.acknowledge_s[priority] += transition.at.monotonic - before.raised_at.monotonic
        return is_raised


def _priority(status: AlarmStatus, rules: AlarmRules) -> int:
    return rules.priority(max(status.level, status.raised_level))
