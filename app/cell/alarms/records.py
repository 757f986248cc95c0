"""Alarms as JSON: their status, which is restored after a restart, and their transitions."""

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final

from app.cell.alarms.history import HistoryRow, event_of, lasted
from app.cell.alarms.published import AlarmEntry
from app.cell.alarms.shown import PANEL, follows_text, limit_text, state_of, value_text
from app.cell.alarms.states import (
    AlarmInstance,
    AlarmRules,
    AlarmStatus,
    Leader,
    Moment,
    State,
    TakenOut,
    Transition,
)
from app.system.clock import iso_time
from app.system.texts import Text, TextLike, text_in

# The status of an alarm as JSON, and back after a restart of the server.

# What reading a record may raise that is not one: also of nested or huge JSON.
UNREADABLE: Final = (
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    RecursionError,
)


def record_of(alarm: AlarmInstance, now: Moment) -> str:
    """The JSON of an alarm: its status with times of the wall clock, and what the robot published."""
    status, entry, described = alarm.status, alarm.entry, alarm.definition.alarm
    record: dict[str, Any] = {
        "state": status.state,
        "level": status.level,
        "raised_level": status.raised_level,
        "occurrence": status.occurrence,
        "raised_at": _wall(status.raised_at),
        "unknown_since": _wall(status.unknown_since),
        "shelf": _taken_out(status.shelf, now),
        "out_of_service": _taken_out(status.out_of_service, now),
        "suppressed_since": _wall(status.suppressed_since),
        "value": alarm.value if alarm.value is not None and abs(alarm.value) < 1e300 else None,
        "limit": alarm.limit,
        "source": described.source or PANEL,
        "about": {
            "text": _as_json(alarm.text),
            "action": _as_json(alarm.action),
            "group": _as_json(described.group or ""),
            "priority": alarm.priority,
            "unit": _as_json(described.unit),
            **({"format": described.format} if described.format else {}),
        },
    }
    if (leader := alarm.leader) is not None:
        record["leader"] = {
            "id": leader.id,
            "text": _as_json(leader.text),
            "after_s": round(leader.after_s, 3),
        }
    if entry is not None:
        record["entry"] = {
            "name": entry.name,
            "level": entry.level,
            "text": _as_json(entry.text),
            "priorities": entry.priorities,
            "cause": _as_json(entry.cause),
            "consequence": _as_json(entry.consequence),
            "action": _as_json(entry.action),
        }
    return json.dumps(record, ensure_ascii=False)


def history_row(alarm: AlarmInstance, transition: Transition) -> HistoryRow:
    """The row of a transition, with the record of the alarm after it."""
    before, after, definition = transition.before, transition.after, alarm.definition
    return HistoryRow(
        transition.at.wall,
        transition.id,
        state_of(after),
        after.occurrence,
        transition.act,
        transition.actor,
        record_of(alarm, transition.at),
        event_of(before, after, transition.act),
        alarm.priority,
        definition.robot,
        str(definition.alarm.group or ""),
        lasted(before, after, transition.at),
    )


def _as_json(text: TextLike) -> Any:
    return text.as_json() if isinstance(text, Text) else text


def text_of(value: Any) -> TextLike:
    """A text in a record; ValueError if it is not one."""
    return text_in(json.dumps(value)) if isinstance(value, dict) else str(value)


def written_value(record: Mapping[str, Any]) -> TextLike:
    """The value in a record as it was shown, "" for none."""
    return value_text(record.get("value"), *_unit_and_format(record))


def written_limit(record: Mapping[str, Any]) -> TextLike:
    """The limit in a record as it was shown, "" for none."""
    return limit_text(record.get("limit"), *_unit_and_format(record))


def _unit_and_format(record: Mapping[str, Any]) -> tuple[TextLike, str | None]:
    """Those of its value; records of earlier versions have no format."""
    about = record.get("about", {})
    return text_of(about.get("unit", "")), about.get("format")


def status_in(record: str, rules: AlarmRules, now: Moment) -> AlarmStatus:
    """The status in a record of an earlier run, whose source is unknown now. A clock that was set back
    or forward makes no shelf longer. One of `UNREADABLE` if it is not a record."""
    values = json.loads(record)
    state, unknown_since = State(values["state"]), _moment(values["unknown_since"], now)
    if unknown_since is None and state is not State.NORMAL:  # else it may be raised as unknown
        unknown_since = now
    return AlarmStatus(
        state,
        _level(values["level"], rules),
        _level(values["raised_level"], rules),
        int(values["occurrence"]),
        _moment(values["raised_at"], now),
        unknown_since,
        _restored(values["shelf"], now),
        _restored(values["out_of_service"], now),
    )


def _level(value: Any, rules: AlarmRules) -> int:
    """A level; the highest one if the panel file has fewer than before."""
    if (level := int(value)) < 0:
        raise ValueError(f"{level} is not a level")
    return min(level, len(rules.priorities))


def entry_in(record: str) -> AlarmEntry | None:
    """What the robot had published; None for an alarm of the panel file."""
    values = json.loads(record).get("entry")
    if values is None:
        return None
    keys = ("text", "cause", "consequence", "action")
    text, cause, consequence, action = (text_of(values.get(key, "")) for key in keys)
    name, priorities = values["name"], tuple(values["priorities"])
    return AlarmEntry(name, int(values["level"]), text, priorities, cause, consequence, action)


def leader_in(record: str) -> Leader | None:
    """The alarm that it followed; None if it followed none."""
    values = json.loads(record).get("leader")
    return values and Leader(values["id"], text_of(values["text"]), float(values["after_s"]))


def _wall(moment: Moment | None) -> float | None:
    return None if moment is None else moment.wall


def _moment(wall: float | None, now: Moment) -> Moment | None:
    """A moment of an earlier run: never after now."""
    return None if wall is None else Moment(now.monotonic - max(0.0, now.wall - _time(wall)), wall)


def _time(value: Any) -> float:
    """Seconds that a record has; ValueError if they are no number."""
    if not math.isfinite(value):
        raise ValueError(f"{value} is not a time")
    return float(value)


def _taken_out(taken: TakenOut | None, now: Moment) -> Mapping[str, Any] | None:
    if taken is None:
        return None
    whole_s = taken.until - taken.since.monotonic
    limits = {"for_s": whole_s, "left_s": taken.until - now.monotonic} if whole_s < 1e9 else {}
    return {
        "since": taken.since.wall,
        "reason": taken.reason,
        "actor": taken.actor,
        "recorded_at": now.wall,
        **limits,
    }


def _restored(values: Mapping[str, Any] | None, now: Moment) -> TakenOut | None:
    if values is None:
        return None
    since = _moment(values["since"], now) or now
    taken = TakenOut(since, str(values["reason"]), str(values["actor"]))
    if "for_s" not in values:
        return taken
    passed_s = max(0.0, now.wall - _time(values["recorded_at"]))
    left_s = max(0.0, _time(values["left_s"]) - passed_s)
    # Its length stays what was asked for, also if the clock was set back.
    since = Moment(now.monotonic + left_s - _time(values["for_s"]), since.wall)
    return replace(taken, since=since, until=now.monotonic + left_s)


# A transition of an alarm as programs get it: JSON values, and texts that are not rendered yet.


def finite(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row with null for numbers that JSON does not have."""
    return {
        name: None if isinstance(value, float) and not math.isfinite(value) else value
        for name, value in row.items()
    }


def transition(row: HistoryRow) -> dict[str, Any]:
    """A row of the history, with texts that are not rendered yet."""
    record = json.loads(row.record)
    about, leader, raised_at = record.get("about", {}), leader_in(row.record), record.get("raised_at")
    return {
        "seq": row.seq,
        "at": iso_time(row.at),
        "clock_back_s": row.clock_back_s,
        "id": row.id,
        "robot": row.robot,
        "source": record.get("source", ""),
        "event": row.event,
        "state": row.state,
        "acknowledged": record.get("state", "") in ("normal", "acknowledged", "latched_acknowledged"),
        "known": record.get("unknown_since") is None,
        "occurrence": row.occurrence,
        "since": "" if raised_at is None else iso_time(raised_at),
        "lasted_s": row.lasted_s,
        "act": row.act,
        "who": row.actor,
        "text": text_of(about.get("text", row.id)),
        "action": text_of(about.get("action", "")),
        "group": text_of(about.get("group", "")),
        "priority": about.get("priority", 0),
        "value": record.get("value"),
        "limit": record.get("limit"),
        "follows": leader.id if leader else "",
        "follows_text": follows_text(leader) if leader else "",
    }
