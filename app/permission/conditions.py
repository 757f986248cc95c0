"""Whether the value of an interlock's field permits, and the sentence if it does not: pure."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from app.i18n import PanelText, Text, TextLike, number, render, say
from app.i18n.values import after_space, with_unit
from app.panel.interlock import Interlock
from app.panel.number_range import decimal_text, shortest_float
from app.panel.values import same_value

LONGEST_TEXT: Final = 40  # characters of a text that stands in a reason
DIGITS: Final = (6, 9)  # a float32 has nine at most

HOLDS: Final[Mapping[str, Callable[[Any, Any], bool]]] = {
    "equals": same_value,
    "not_equals": lambda value, other: value == value and not same_value(value, other),
    "min": lambda value, lowest: value >= lowest,
    "max": lambda value, highest: value <= highest,
    "one_of": lambda value, values: any(same_value(value, one) for one in values),
}


def permits(interlock: Interlock, value: Any) -> bool:
    """Whether this value permits. None, a value that is missing, never does; nor does NaN."""
    conditions = interlock.conditions
    if not conditions:
        return value is True
    return value is not None and all(HOLDS[key](value, wanted) for key, wanted in conditions.items())


def unmet(interlock: Interlock, value: Any) -> Text:
    """The sentence for a value that does not meet the conditions."""
    wanted = list(_wanted(interlock))
    must = wanted[0] if len(wanted) == 1 else say("both", one=wanted[0], other=wanted[1])
    return say("unmet", name=interlock.name, value=_now(interlock, value, must), wanted=must)


def not_finite(value: float) -> Text:
    """What stands for NaN and infinities in a sentence."""
    return say("value_nan") if math.isnan(value) else say("value_infinite")


def _wanted(interlock: Interlock) -> Iterator[TextLike]:
    if interlock.equals is not None:
        yield _value_text(interlock, interlock.equals, interlock.unit)
    if interlock.one_of is not None:
        *all_but_last, last = (_value_text(interlock, one, interlock.unit) for one in interlock.one_of)
        yield say("either", first=tuple(all_but_last), last=last) if all_but_last else last
    if interlock.min is not None or interlock.max is not None:
        yield _limits(interlock)
    if interlock.not_equals is not None:
        yield say("not_value", value=_value_text(interlock, interlock.not_equals, interlock.unit))


def _limits(interlock: Interlock) -> Text:
    low, high = (
        "" if one is None else _value_text(interlock, one, "") for one in (interlock.min, interlock.max)
    )
    code = "limits_both" if low and high else "limits_low" if low else "limits_high"
    return say(code, low=low, high=high, unit=after_space(interlock.unit))


def _now(interlock: Interlock, value: Any, must: TextLike) -> TextLike:
    """The value that was received, in as few digits as distinguish it from the one that is needed."""
    if not isinstance(value, float):
        return _value_text(interlock, value, interlock.unit)
    if math.isnan(value):
        return not_finite(value)
    rounded = (float(f"{value:.{digits}g}") for digits in DIGITS)
    candidates = [_value_text(interlock, one, interlock.unit) for one in (*rounded, value)]
    written = render(must)  # its numbers have the same digits in every language
    return next((text for text in candidates if render(text) not in written), candidates[-1])


def _value_text(interlock: Interlock, value: Any, unit: str | PanelText) -> TextLike:
    text = _written(interlock, value)
    known = isinstance(value, bool | str) or value in interlock.constants
    return with_unit(text, unit) if known else number(text, unit)


def _written(interlock: Interlock, value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= LONGEST_TEXT else f'"{value[: LONGEST_TEXT - 1]}…"'
    if value in interlock.constants:
        return interlock.constants[value]
    return decimal_text(shortest_float(value) if isinstance(value, float) else value)
