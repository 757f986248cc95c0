"""Decoded messages as plain values for JSON and the browser."""

import math
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any, Final

from app.ros.messages.definitions import PLACEHOLDER

# JavaScript's numbers are doubles: beyond this, integers are not exact.
MAX_EXACT_INTEGER: Final = 2**53
NON_JSON_FORMATS: Final = frozenset(
    "fdqQ"
)  # formats of elements that JSON or a browser may not be able to hold


def to_plain(message: Any) -> Any:
    """A decoded message, or any value in it, as JSON types.

    A message becomes a dict of its fields in order, an array or `bytes` a list. Values that JSON or a
    browser's numbers can't hold become text: integers beyond ±2^53 ("9007199254740993"), "NaN",
    "Infinity" and "-Infinity".
    """
    if message is None or isinstance(message, bool | str):
        return message
    if isinstance(message, int):
        return message if -MAX_EXACT_INTEGER <= message <= MAX_EXACT_INTEGER else str(message)
    if isinstance(message, float):
        return message if math.isfinite(message) else _non_finite_text(message)
    if isinstance(message, memoryview):
        return _plain_numbers(message)
    if isinstance(message, list | tuple | bytes | bytearray):
        return [to_plain(item) for item in message]
    return {name: to_plain(getattr(message, each)) for each, name in _field_names(message.__class__)}


def message_fields(message: Any) -> Iterator[tuple[str, Any]]:
    """(field name, value) of a message object, in the order of its definition."""
    return ((name, getattr(message, each)) for each, name in _field_names(message.__class__))


def plain_text(value: Any, most: int, clean: Callable[[str], str] = str) -> str:
    """A value in a decoded message as `str(to_plain(value))`, with its texts as `clean` returns them,
    cut to `most` characters. The rest is not read: a list may have any length."""
    text = ""
    for piece in _text_pieces(value, most, clean) if _is_compound(value) else [_text_of(value, clean)]:
        text += piece
        if len(text) > most:
            return text[: most - 1] + "…"
    return text


def _text_of(value: Any, clean: Callable[[str], str]) -> str:
    return clean(value) if isinstance(value, str) else str(to_plain(value))


def _is_compound(value: Any) -> bool:
    return isinstance(value, memoryview | list | tuple | bytes | bytearray) or is_dataclass(value)


def _text_pieces(value: Any, most: int, clean: Callable[[str], str]) -> Iterator[str]:
    """The text of a value, in pieces."""
    if isinstance(value, str):
        yield repr(clean(value[: most + 1]))
    elif not _is_compound(value):
        yield repr(to_plain(value))
    elif is_dataclass(value):
        for number, (each, name) in enumerate(_field_names(value.__class__)):
            yield f"{', ' if number else '{'}{name!r}: "
            yield from _text_pieces(getattr(value, each), most, clean)
        yield "}" if _field_names(value.__class__) else "{}"
    else:
        for number, item in enumerate(value):
            yield ", " if number else "["
            yield from _text_pieces(item, most, clean)
        yield "]" if len(value) else "[]"


def _non_finite_text(value: float) -> str:
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def _plain_numbers(values: "memoryview[Any]") -> list[Any]:
    """A list of numbers as plain values."""
    listed = values.tolist()
    return [to_plain(item) for item in listed] if values.format in NON_JSON_FORMATS else listed


@lru_cache(4096)
def _field_names(message_class: type[Any]) -> tuple[tuple[str, str], ...]:
    """(attribute, field name) of a message class. No ROS field name ends with "_"."""
    own = [field.name for field in fields(message_class) if field.name != PLACEHOLDER]
    return tuple((name, name.removesuffix("_")) for name in own)
