"""Texts about a response: `{field}` in `answer`, `feedback` and `result`, `{field:.1f}` with a format,
and `{field*1000:.0f}` with a factor before it is written."""

import math
import re
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, Final, NamedTuple

from app.panel.numbers import FORMAT, NUMBERS, formatted
from app.system.errors import FieldError
from app.system.texts import TextLike
from app.system.texts.text import each_language

DIGITS: Final = 4  # significant digits of a number without a format
SMALLEST: Final = 1e-4  # nearer to 0 it is written with an exponent
_PLACEHOLDER: Final = re.compile(r"\{([^{}]*)\}")
# A path may have * and : within quotes.
_PARTS: Final = re.compile(
    r"""(?P<path>(?:[^'"*:]|'[^']*'|"[^"]*")+)(?:\*(?P<scale>-?[0-9.]+(?:e-?[0-9]+)?))?(?::(?P<style>.*))?"""
)
RIGHT: Final = "write {field}, {field:.1f} or {field*1000:.0f}"


class ResponseField(NamedTuple):
    """A field that a text names: its path, and how its number is written."""

    path: str
    scale: float = 1.0
    style: str | None = None

    @property
    def is_written(self) -> bool:
        """Whether the text says how the number is written."""
        return self.scale != 1.0 or self.style is not None

    def text(self, value: float) -> str:
        """A number of the field, as Python writes it."""
        scaled = value * self.scale if self.scale != 1.0 else value
        if isinstance(scaled, int) and self.style is None:
            return str(scaled)
        if not math.isfinite(scaled):
            return "NaN" if math.isnan(scaled) else "Infinity" if scaled > 0 else "-Infinity"
        return formatted(scaled, self.style) if self.style is not None else _rounded(float(scaled))

    def fault(self, kind: str) -> str:
        """Why a field of this type can't be written so, "" if it can."""
        if self.is_written and kind not in NUMBERS:
            return f'"{self.path}" is {kind}: a format and a factor are for numbers'
        if (self.style or "").endswith("d") and (kind.startswith("float") or self.scale != 1.0):
            kind = kind if self.scale == 1.0 else "a scaled number"
            return f'"{self.style}" is for whole numbers; "{self.path}" is {kind}'
        return ""


def _rounded(value: float) -> str:
    """A number in four significant digits, and no fewer digits before the point than it has."""
    if value == 0:
        return "0"
    if abs(value) < SMALLEST or abs(value) >= 1e15:
        return f"{value:.{DIGITS}g}"
    places = max(0, DIGITS - 1 - math.floor(math.log10(abs(value))))
    text = f"{value:.{places}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def pieces(text: str) -> Iterator[str | ResponseField]:
    """The text's parts: literal texts, and the fields between them. FieldError as of `parsed`."""
    for number, piece in enumerate(_PLACEHOLDER.split(text)):  # text, field, text, …
        if number % 2 == 0 and "{" in piece:
            raise FieldError("", f'"{text}": a brace has no partner; {RIGHT}')
        yield parsed(piece) if number % 2 else piece


@lru_cache(1000)
def parsed(written: str) -> ResponseField:
    """What stands between braces; FieldError, without a field, for anything else."""
    parts = _PARTS.fullmatch(written)
    style = parts["style"] if parts else None
    if parts is None or (style is not None and not re.fullmatch(FORMAT, style)):
        raise FieldError("", f'"{{{written}}}" names no field: {RIGHT}')
    try:
        scale = float(parts["scale"] or 1.0)
    except ValueError:
        raise FieldError("", f'"{{{written}}}" has no number after *: {RIGHT}') from None
    return ResponseField(parts["path"], scale, style)


def response_fields(template: TextLike) -> list[ResponseField]:
    """The fields of a response that a text about it names, in all its languages."""
    texts = each_language(template).values()
    parts = (part for text in texts for part in pieces(text))
    return list(dict.fromkeys(part for part in parts if isinstance(part, ResponseField)))


def response_paths(template: TextLike) -> list[str]:
    """The paths of the same, each once."""
    return list(dict.fromkeys(field.path for field in response_fields(template)))


def is_number(value: Any) -> bool:
    """Whether a value is written by `ResponseField.text`."""
    return isinstance(value, int | float) and not isinstance(value, bool)
