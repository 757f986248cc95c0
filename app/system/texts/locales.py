"""How each language writes numbers, times and dates, and how it reads a number that a person enters."""

import re
from collections.abc import Callable, Mapping
from datetime import date
from decimal import Decimal
from functools import cache
from math import isfinite
from typing import TYPE_CHECKING, Final, NamedTuple

from app.system.texts.catalogue import ENGLISH

if TYPE_CHECKING:
    from babel import Locale


# How each language writes numbers, times and dates, and its own name, by Babel (Unicode CLDR).
#
# Babel's own formatting takes some 20 µs for a number; a panel shows thousands a second. So its signs
# are read once for each language, and put in place of those that Python writes.

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


# Numbers that a person typed, pasted or scanned, in the notation of the reader's language.
#
# One rule: a text is a number only if it is what the panel writes for that number, up to thousands
# separators, trailing zeros, a plus sign and the width of its characters. Anything else is refused:
# nothing is left out and nothing is guessed. A lone group of three digits, "1.000", is one number with
# a decimal point and another with a decimal comma: where an input permits both, it is refused too.
# `static/js/number-text.js` has the same rules.

Permits = Callable[[float], bool]  # whether an input permits a number
LONGEST: Final = 40  # characters
MAX_EXACT: Final = 2**53  # whole numbers up to here are exact in a browser
AROUND: Final = " \t\r\n\N{NO-BREAK SPACE}\N{IDEOGRAPHIC SPACE}"
# Separators of thousands that look alike: a keyboard has only one of each.
ALIKE: Final = ("\N{NARROW NO-BREAK SPACE}\N{NO-BREAK SPACE} ", "\N{RIGHT SINGLE QUOTATION MARK}'")
_PLAIN: Final = re.compile(
    r"([-+]?)((?:0|[1-9][0-9]*|[1-9][0-9]{0,2}(?:,[0-9]{3})+)(?:\.[0-9]+)?(?:e[-+][0-9]{2,3})?)",
    re.ASCII,
)
# Three digits behind one sign, which may be decimals or thousands.
_LONE: Final = re.compile(r"[-+]?[1-9][0-9]{0,2}[.,][0-9]{3}", re.ASCII)
_CLOSE: Final = re.compile(r"-?[1-9][0-9]{0,2}\.[0-9]{3}", re.ASCII)
_WHOLE: Final = re.compile(r"(-?[0-9]+)(?:\.0+)?", re.ASCII)
# A comma that may separate thousands or values: "1,234".
_UNCLEAR: Final = re.compile(r"[0-9],[0-9]{3}(?![0-9])", re.ASCII)


def read_number(text: str, language: str, *, whole: bool = False) -> int | float | None:
    """The number that the text is in this language, None if it is not one; `whole`: a whole number, of
    any size. Otherwise an int is exact in a browser too."""
    plain = _plain(text, language)
    if plain is None:
        return None
    if whole:
        match = _WHOLE.fullmatch(plain)
        return int(match[1]) if match else None
    value = float(plain)
    if not isfinite(value) or not _is_shown_as(value, plain):
        return None
    return int(value) if value.is_integer() and abs(value) <= MAX_EXACT else value


def lone_group(text: str) -> tuple[float, float] | None:
    """The numbers that a lone group of three digits is with a decimal sign and with one of thousands;
    None for any other text."""
    narrow = {ord(sign) + 0xFEE0: sign for sign in "0123456789.,+-"} | {ord(MINUS): "-"}
    plain = text.strip(AROUND).translate(narrow)
    if not _LONE.fullmatch(plain):
        return None
    return float(plain.replace(",", ".")), float(plain.replace(",", "").replace(".", ""))


def is_unclear(text: str, permits: Permits) -> bool:
    """Whether a text is a lone group of three digits that is permitted as either number."""
    both = lone_group(text)
    return both is not None and all(map(permits, both))


def clear_text(plain: str) -> str:
    """A number in Python's notation as an entry shows it: it can't be taken for thousands."""
    return f"{plain}0" if _CLOSE.fullmatch(plain) else plain


def read_numbers(
    text: str, language: str, *, whole: bool = False, permits: Permits = lambda _: False
) -> list[int | float | str]:
    """The numbers of a list; an element that is not a number, or is unclear, is its text."""
    separator = list_separator(language)
    if not text.strip(AROUND):
        return []
    if separator == "," and _UNCLEAR.search(text):
        return [text]
    elements = (element.strip(AROUND) for element in text.split(separator))
    read = ((element, read_number(element, language, whole=whole)) for element in elements)
    return [
        element if number is None or is_unclear(element, permits) else number
        for element, number in read
    ]


def list_separator(language: str) -> str:
    """What separates the numbers of a list: a semicolon where the comma is the decimal sign."""
    return ";" if symbols(language).decimal == "," else ","


def _is_shown_as(value: float, plain: str) -> bool:
    shown = repr(value)
    return plain == shown if "e" in plain else Decimal(plain) == Decimal(shown)


def _plain(text: str, language: str) -> str | None:
    """The text in Python's notation, with all of its digits."""
    text = text.strip(AROUND)
    if len(text) > LONGEST:
        return None
    match = _PLAIN.fullmatch(text.translate(_signs(language)))
    if match is None:
        return None
    return match[1].replace("+", "") + match[2].replace(",", "")


@cache
def _signs(language: str) -> Mapping[int, str]:
    """What each character stands for; a separator of another language stands for none."""
    own = symbols(language)
    plain = {own.decimal: ".", MINUS: "-"}
    for sign in next((signs for signs in ALIKE if own.group in signs), own.group):
        plain.setdefault(sign, ",")
    signs = {sign: plain.get(sign, "?") for sign in ".,"} | plain
    digits = {sign: sign for sign in "0123456789+-"}
    wide = {chr(ord(sign) + 0xFEE0): read for sign, read in (signs | digits).items() if sign < "~"}
    return {ord(sign): read for sign, read in (wide | signs).items()}
