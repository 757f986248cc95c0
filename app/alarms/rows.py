"""An alarm as pages, events and programs get it: JSON values, and texts where a person reads."""

from collections.abc import Iterator, Mapping
from typing import Final, Literal, TypedDict, get_args

from app.alarms.instance import AlarmInstance, Leader
from app.alarms.states import State
from app.alarms.status import HIGH, AlarmStatus, Moment, TakenOut
from app.clock import format_time, iso_time
from app.i18n import TextLike, number, say
from app.panel.number_range import decimal_text

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
DIGITS: Final = 6  # of a value
PANEL: Final = "panel"  # the source of the panel's own alarms


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
    details: str
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
        value_text=_number(alarm, alarm.value),
        limit=limit,
        limit_text=_number(alarm, limit),
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


def _number(alarm: AlarmInstance, value: float | None) -> TextLike:
    if value is None:
        return ""
    return number(decimal_text(float(f"{value:.{DIGITS}g}")), alarm.definition.alarm.unit)


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
