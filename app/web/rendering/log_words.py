"""The texts of an entry on the page of the operator's log, in the reader's language."""

import json
import re
from collections.abc import Iterable, Iterator
from datetime import date, datetime, timedelta
from functools import cache
from itertools import groupby
from typing import Any, Final

from app.audit import Row
from app.clock import offset_if_twice
from app.i18n import Param, Text, TextLike, named_day, render, say
from app.i18n.locales import number_in, time_in
from app.printable import printable

OUTCOMES: Final = (
    "published", "confirmed", "accepted", "succeeded", "rejected", "canceled", "aborted", "timed_out",
    "refused", "unknown", "pressed", "control", "alarm", "diagnostics", "recipe", "access", "began",
    "changed", "signed", "resumed", "removed",
)  # fmt: skip
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


def by_day(rows: Iterable[Row]) -> Iterator[tuple[Text, list[Row]]]:
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
    return say(f"log_outcome_{outcome}") if outcome in OUTCOMES else outcome


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
