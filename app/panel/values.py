"""Formats and compares values of a panel file."""

from typing import Any


def number_text(number: float) -> str:
    """A number as in a panel file and in HTML: "5", "0.25", "1e-07"."""
    return str(int(number)) if number.is_integer() else repr(number)


def same_value(one: Any, other: Any) -> bool:
    """Whether two values are equal in TOML and JSON: 1 equals 1.0, but not true."""
    return one == other and isinstance(one, bool) == isinstance(other, bool)
