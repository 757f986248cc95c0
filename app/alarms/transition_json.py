"""A transition of an alarm as programs get it: JSON values, and texts that are not rendered yet."""

import json
import math
from collections.abc import Mapping
from typing import Any

from app.alarms.history import HistoryRow
from app.alarms.records import leader_in, text_of
from app.alarms.rows import follows_text
from app.clock import iso_time


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
