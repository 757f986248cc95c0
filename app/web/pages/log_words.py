"""The texts of an entry on the page of the operator's log, in the reader's language."""

import json
import re
from collections.abc import Iterable, Iterator
from datetime import date, datetime, timedelta
from functools import cache
from itertools import groupby
from typing import Any, Final

from app.records import LogRow
from app.system.clock import offset_if_twice
from app.system.printable import printable
from app.system.texts import Param, Text, TextLike, named_day, render, say
from app.system.texts.locales import number_in, time_in

# Acts, and changes of control without an act, by the action of their entries.
ACTION_WORDS: Final = {
    "control_take": "log_page_control_take",
    "control_ask": "log_page_control_ask",
    "control_give": "log_page_control_give",
    "control_keep": "log_page_control_keep",
    "control_release": "log_page_control_release",
    "control_lost": "log_page_control_lost",
    "control_idle": "log_page_control_idle",
    "control_first_page": "log_page_control_first_page",
    "control_request_lost": "log_page_control_request_lost",
    "alarm_acknowledge": "log_page_alarm_acknowledge",
    "alarm_shelve": "log_page_alarm_shelve",
    "alarm_unshelve": "log_page_alarm_unshelve",
    "alarm_out_of_service": "log_page_alarm_out_of_service",
    "alarm_in_service": "log_page_alarm_in_service",
    "alarm_reset": "log_page_alarm_reset",
    "alarm_message": "log_page_alarm_message",
    "diagnostics_check": "log_page_diagnostics_check",
    "diagnostics_bundle": "log_page_diagnostics_bundle",
    "diagnostics_foxglove": "log_page_diagnostics_foxglove",
    "recipe_create": "log_page_recipe_create",
    "recipe_copy": "log_page_recipe_copy",
    "recipe_save": "log_page_recipe_save",
    "recipe_rename": "log_page_recipe_rename",
    "recipe_restore": "log_page_recipe_restore",
    "recipe_delete": "log_page_recipe_delete",
    "recipe_import": "log_page_recipe_import",
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
    "access": "log_outcome_access",
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
