"""The texts of an entry on the page of the operator's log, in the reader's language."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import date, datetime, timedelta
from functools import cache
from itertools import groupby
from typing import Any, Final

from app.cell.commands.acts import Act
from app.cell.commands.alarm_acts import ALARM_ACTS
from app.cell.commands.control_acts import CONTROL_ACTS, HAND_OVERS
from app.cell.commands.diagnostic_acts import DIAGNOSTIC_ACTS
from app.cell.commands.machine_acts import MACHINE_ACTS
from app.cell.commands.panel_acts import PANEL_ACTS
from app.cell.commands.place_acts import PLACE_ACTS
from app.cell.commands.recipe_acts import RECIPE_ACTS
from app.cell.commands.shift_acts import SHIFT_ACTS
from app.records import LogRow
from app.records.entry import Kind
from app.system.clock import offset_if_twice
from app.system.printable import printable
from app.system.texts import Param, Text, TextLike, named_day, render, say
from app.system.texts.locales import number_in, time_in

TABLES: Final[Sequence[tuple[Kind, Mapping[str, Act[Any, Any]]]]] = (
    ("control", CONTROL_ACTS),
    ("alarm", {**ALARM_ACTS, **SHIFT_ACTS}),
    ("diagnostics", {**DIAGNOSTIC_ACTS, **MACHINE_ACTS}),
    ("recipe", RECIPE_ACTS),
    ("place", PLACE_ACTS),
    ("panel", PANEL_ACTS),
)
# Acts, and changes of control without an act, by the action of their entries.
ACTION_WORDS: Final = {
    **{f"{kind}_{name}": act.word for kind, acts in TABLES for name, act in acts.items()},
    **{action: word for action, _, word in HAND_OVERS.values()},
    "panel_kept": "log_page_panel_kept",
    "panel_restored": "log_page_panel_restored",
    "diagnostics_vex": "diagnostics_vex",
    "diagnostics_release": "diagnostics_release",
    "diagnostics_log_room": "diagnostics_log_room",
}
OUTCOME_WORDS: Final = {
    "published": "log_outcome_published",
    "confirmed": "log_outcome_confirmed",
    "accepted": "log_outcome_accepted",
    "succeeded": "log_outcome_succeeded",
    "rejected": "log_outcome_rejected",
    "canceled": "log_outcome_canceled",
    "aborted": "log_outcome_aborted",
    "timed_out": "log_outcome_timed_out",
    "refused": "log_outcome_refused",
    "unknown": "log_outcome_unknown",
    "pressed": "log_outcome_pressed",
    "control": "log_outcome_control",
    "alarm": "log_outcome_alarm",
    "diagnostics": "log_outcome_diagnostics",
    "recipe": "log_outcome_recipe",
    "place": "log_outcome_place",
    "access": "log_outcome_access",
    "panel": "log_outcome_panel",
    "clock": "log_outcome_clock",
    "began": "log_outcome_began",
    "changed": "log_outcome_changed",
    "signed": "log_outcome_signed",
    "resumed": "log_outcome_resumed",
    "removed": "log_outcome_removed",
}
HASH: Final = re.compile(r"[0-9a-f]{64}")
HASH_SHOWN: Final = 12  # characters; the CSV has all
NAMES: Final = ("browser", "browser_local", "browser_more", "browser_unknown", "others", "unknown")


def _time(ms: int) -> datetime:
    return datetime.fromtimestamp(ms // 1000).replace(microsecond=ms % 1000 * 1000).astimezone()


def time_of(ms: int, language: str) -> str:
    """The time of day in the language's notation, and its offset where the clock shows this time
    twice."""
    return time_in(f"{_time(ms).strftime('%H:%M:%S')} {offset_if_twice(ms // 1000)}", language).rstrip()


def iso_of(ms: int) -> str:
    """The time in ISO 8601, for programs."""
    return _time(ms).isoformat(timespec="milliseconds")


def by_day(rows: Iterable[LogRow]) -> Iterator[tuple[Text, list[LogRow]]]:
    """The rows of each day in turn, below its name."""
    for day, entries in groupby(rows, key=lambda row: _time(row.entry.at).date()):
        yield day_name(day), list(entries)


def day_name(day: date) -> Text:
    """The name of a day, with "today" or "yesterday"."""
    name, now = named_day(day.isoformat()), datetime.now().astimezone().date()
    if day in (now, now - timedelta(days=1)):
        return word("today" if day == now else "yesterday", date=name)
    return name


def word(name: str, **about: Param) -> Text:
    return say(f"log_page_{name}", **about)


def outcome_of(outcome: str) -> TextLike:
    """An outcome, or a kind of entries, as a word; one of another version as it is."""
    return say(OUTCOME_WORDS[outcome]) if outcome in OUTCOME_WORDS else outcome


def who_of(who: str) -> TextLike:
    """The name of a client in the reader's language; entries have it in English."""
    for name, code in _names():
        if match := name.fullmatch(who):
            return say(code, **match.groupdict())
    return who


@cache
def _names() -> list[tuple[re.Pattern[str], str]]:
    """Patterns of the English names of clients without users, with their codes."""
    written = [(re.escape(render(say(code, number="0"))), code) for code in NAMES]
    return [(re.compile(text.replace("0", "(?P<number>[0-9]+)")), code) for text, code in written]


def values_of(text: str, language: str) -> list[tuple[str, str]]:
    """The values of an entry that are not empty, as (name, text)."""
    values = json.loads(text).items()
    return [(printable(name), _value_of(value, language)) for name, value in values if value != ""]


def _value_of(value: Any, language: str) -> str:
    if isinstance(value, str):
        return f"{value[:HASH_SHOWN]}…" if HASH.fullmatch(value) else printable(value)
    text = json.dumps(value, ensure_ascii=False)
    return number_in(text, language) if isinstance(value, float) else printable(text)
