"""Rows of the history of alarms as a page shows them."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from itertools import groupby
from typing import Any, Final, NamedTuple

from app.alarms.history import HistoryRow
from app.alarms.records import text_of
from app.alarms.rows import DIGITS, STATE_WORDS
from app.clock import format_time, iso_time
from app.i18n import Text, TextLike, joined, number, say
from app.panel.number_range import decimal_text
from app.printable import printable
from app.view.time_values import duration_text
from app.web.rendering.log_words import day_name, who_of

EARLIER_S: Final = 1.0  # by so much a row before another is out of the order of times
AFTER: Final = frozenset({"returned", "acknowledged"})  # their sentences say how long it lasted


class ShownEvent(NamedTuple):
    """A transition: `event` is what happened, `back` that the clock was set back before it, "" if it
    was not."""

    seq: int
    at: float
    time: Text
    iso: str
    id: str
    robot: str
    priority: int
    text: TextLike
    group: TextLike
    name: str
    event: TextLike
    back: TextLike


def shown_events(rows: Sequence[HistoryRow]) -> list[ShownEvent]:
    """Transitions, the newest first, in their order."""
    return [_shown(row, older) for row, older in zip(rows, [*rows[1:], None], strict=False)]


def events_by_day(events: Iterable[ShownEvent]) -> Iterator[tuple[Text, list[ShownEvent]]]:
    """The events of each day in turn, below its name."""
    for day, of_day in groupby(events, key=lambda event: datetime.fromtimestamp(event.at).date()):
        yield day_name(day), list(of_day)


def _shown(row: HistoryRow, older: HistoryRow | None) -> ShownEvent:
    record = json.loads(row.record)
    about = record.get("about", {})
    return ShownEvent(
        row.seq,
        row.at,
        format_time(row.at),
        iso_time(row.at),
        row.id,
        row.robot,
        row.priority,
        text_of(about.get("text", row.id)),
        text_of(about.get("group", "")),
        row.event,
        event_text(row, record),
        _back(row, older),
    )


def _back(row: HistoryRow, older: HistoryRow | None) -> TextLike:
    """That the clock was set back right before a row, or between it and the older one beside it."""
    back = row.clock_back_s or (older.at - row.at if older else 0.0)
    return say("alarms_clock_back", duration=duration_text(back)) if back >= EARLIER_S else ""


def event_text(row: HistoryRow, record: Mapping[str, Any]) -> TextLike:
    """What happened, with the value and the limit, who did it and why."""
    parts = [_event_word(row)]
    if row.event in ("raised", "changed"):
        unit = text_of(record.get("about", {}).get("unit", ""))
        value, limit = (_number(record.get(name), unit) for name in ("value", "limit"))
        parts += [value, say("alarms_event_limit", limit=limit) if limit else ""]
    if row.act:
        taken = record.get("out_of_service") or record.get("shelf") or {}
        parts += [who_of(printable(row.actor)), printable(taken.get("reason", ""))]
    return joined(parts, "between_names")


def _event_word(row: HistoryRow) -> TextLike:
    if row.event in AFTER and row.lasted_s is not None:
        return say(f"alarms_event_{row.event}_after", duration=duration_text(row.lasted_s))
    if row.event in ("", "changed"):
        words = {str(state): word for state, (word, _) in STATE_WORDS.items()}
        return say(words[row.state]) if row.state in words else row.state
    return say(f"alarms_event_{row.event}")


def _number(value: float | None, unit: TextLike) -> TextLike:
    if value is None:
        return ""
    return number(decimal_text(float(f"{value:.{DIGITS}g}")), unit)
