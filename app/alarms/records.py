"""The status of an alarm as JSON, and back after a restart of the server."""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.alarms.entries import AlarmEntry
from app.alarms.event_names import event_of, lasted
from app.alarms.history import HistoryRow
from app.alarms.instance import AlarmInstance, Leader, Transition
from app.alarms.rows import PANEL, state_of
from app.alarms.states import State
from app.alarms.status import AlarmStatus, Moment, TakenOut
from app.i18n import Text, TextLike, text_in


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


def status_in(record: str, now: Moment) -> AlarmStatus:
    """The status in a record of an earlier run, whose source is unknown now. A clock that was set back
    or forward makes no shelf longer. ValueError if it is not a record."""
    values = json.loads(record)
    unknown_since = _moment(values["unknown_since"], now)
    return AlarmStatus(
        State(values["state"]),
        int(values["level"]),
        int(values["raised_level"]),
        int(values["occurrence"]),
        _moment(values["raised_at"], now),
        unknown_since or now,
        _restored(values["shelf"], now),
        _restored(values["out_of_service"], now),
    )


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
    return None if wall is None else Moment(now.monotonic - max(0.0, now.wall - wall), wall)


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
    taken = TakenOut(since, values["reason"], values["actor"])
    if "for_s" not in values:
        return taken
    passed_s = max(0.0, now.wall - values["recorded_at"])
    left_s = max(0.0, values["left_s"] - passed_s)
    # Its length stays what was asked for, also if the clock was set back.
    since = Moment(now.monotonic + left_s - values["for_s"], since.wall)
    return replace(taken, since=since, until=now.monotonic + left_s)
