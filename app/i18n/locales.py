"""How each language writes numbers, times and dates, and its own name, by Babel (Unicode CLDR).

Babel's own formatting takes some 20 µs for a number; a panel shows thousands a second. So its signs are
read once for each language, and put in place of those that Python writes.
"""

from collections.abc import Mapping
from datetime import date
from functools import cache
from typing import TYPE_CHECKING, Final, NamedTuple

from app.i18n.catalogue import ENGLISH

if TYPE_CHECKING:
    from babel import Locale

DIGITS: Final = "latn"  # what is entered has no others
ISO_DATE: Final = "y-MM-dd"


class Symbols(NamedTuple):
    """`numbers` maps the signs that Python writes in a number to those of the language, where they
    differ; `decimal` is the decimal separator, `group` that of thousands, `time` the separator of
    hours, minutes and seconds, `date` a CLDR date pattern."""

    numbers: Mapping[int, str]
    decimal: str
    group: str
    time: str
    date: str


# The minus sign of every language: a hyphen is too short to be seen from afar, and not read aloud.
MINUS: Final = "\N{MINUS SIGN}"
PLAIN: Final = Symbols({ord("-"): MINUS}, ".", ",", ":", ISO_DATE)
WEEKDAYS: Final = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
MONTHS: Final = (
    "January", "February", "March", "April", "May", "June", "July", "August", "September", "October",
    "November", "December",
)  # fmt: skip
# What Babel says of the panel's languages. Each page names them: an English panel need not hold what
# Babel knows of all, 5 MB.
OWN_NAMES: Final = {"de": "Deutsch", "en": "English", "ja": "日本語"}


@cache
def locale_of(language: str) -> "Locale | None":
    """Babel's locale of a language; None if Babel does not know it."""
    from babel import Locale, UnknownLocaleError

    try:
        return Locale.parse(language, sep="-")
    except (UnknownLocaleError, ValueError):
        return None


@cache
def symbols(language: str) -> Symbols:
    """The symbols of a language. English dates are ISO 8601, since others confuse day and month. Times
    have 24 hours in every language."""
    locale = None if language == ENGLISH else locale_of(language)
    if locale is None:
        return PLAIN
    signs = locale.number_symbols.get(DIGITS) or locale.number_symbols
    own = {".": signs["decimal"], ",": signs["group"], "-": MINUS}
    numbers = {ord(plain): sign for plain, sign in own.items() if plain != sign}
    time = "." if "H.mm" in locale.time_formats["medium"].pattern else ":"
    day = locale.date_formats["short"].pattern
    return Symbols(numbers, own["."], own[","], time, day if "yyy" in day else day.replace("yy", "y"))


def number_in(text: str, language: str) -> str:
    """A number as Python writes it ("-1,234.5", "1e-07"), in the notation of this language."""
    return text.translate(symbols(language).numbers)


def time_in(text: str, language: str) -> str:
    """A time of day, "14:02:11" or "02:30:07 +01:00", as this language writes it."""
    at, space, offset = text.partition(" ")
    return f"{at.replace(':', symbols(language).time)}{space}{offset.replace('-', MINUS)}"


def date_in(text: str, language: str) -> str:
    """A date, "2026-11-21", as this language writes it; ValueError for none."""
    pattern = symbols(language).date
    if pattern == ISO_DATE:
        return text
    from babel.dates import format_date

    return format_date(date.fromisoformat(text), pattern, locale_of(language))


def date_time_in(text: str, language: str) -> str:
    """A date and a time, "2026-11-21 14:02:11", as this language writes them; ValueError for none."""
    day, _, time = text.partition(" ")
    return f"{date_in(day, language)} {time_in(time, language)}"


def day_in(text: str, language: str) -> str:
    """A day by its names, "Saturday 21 November 2026"; ValueError for no date."""
    day = date.fromisoformat(text)
    locale = None if language == ENGLISH else locale_of(language)
    if locale is None:
        return f"{WEEKDAYS[day.weekday()]} {day.day} {MONTHS[day.month - 1]} {day.year}"
    from babel.dates import format_date

    return format_date(day, "full", locale)


def short_day_in(text: str, language: str) -> str:
    """A day without its year, as short as it is read: "Sat 21 Nov"; ValueError for no date."""
    day = date.fromisoformat(text)
    locale = None if language == ENGLISH else locale_of(language)
    if locale is None:
        return f"{WEEKDAYS[day.weekday()][:3]} {day.day} {MONTHS[day.month - 1][:3]}"
    from babel.dates import format_skeleton

    return format_skeleton("MMMEd", day, locale=locale)


def own_name(language: str) -> str:
    """The name of a language in itself: "Deutsch"."""
    return OWN_NAMES.get(language) or babel_name(language)


@cache
def babel_name(language: str) -> str:
    """Babel's name of a language in itself; its tag if Babel does not know it."""
    locale = locale_of(language)
    name = locale.get_display_name() if locale is not None else None
    return f"{name[0].upper()}{name[1:]}" if name else language
