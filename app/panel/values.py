"""How values of a panel file are written and compared."""

from typing import Any


def number_text(number: float) -> str:
    """A number as it is written and as HTML has it: "5", "0.25", "1e-07"."""
    return str(int(number)) if number.is_integer() else repr(number)


def same_value(one: Any, other: Any) -> bool:
    """Whether two values are one, as TOML and JSON see it: 1 is 1.0, but not true."""
    return one == other and isinstance(one, bool) == isinstance(other, bool)
