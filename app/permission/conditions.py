"""Whether a value of the robot's permits by an interlock, and the sentence where it does not: pure."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from app.i18n import Text, TextLike, render, say
from app.panel.interlock import Interlock
from app.panel.number_range import decimal, shortest
from app.panel.values import same

LONGEST_TEXT: Final = 40  # characters of a text that stands in a reason
DIGITS: Final = (6, 9)  # a float32 has nine at most

HOLDS: Final[Mapping[str, Callable[[Any, Any], bool]]] = {
    "equals": same,
    "not_equals": lambda value, other: value == value and not same(value, other),
    "min": lambda value, lowest: value >= lowest,
    "max": lambda value, highest: value <= highest,
    "one_of": lambda value, values: any(same(value, one) for one in values),
}


def permits(of: Interlock, value: Any) -> bool:
    """Whether this value permits; None is one that is not there. NaN never does."""
    conditions = of.conditions
    if not conditions:
        return value is True
    return value is not None and all(HOLDS[key](value, wanted) for key, wanted in conditions.items())


def unmet(of: Interlock, value: Any) -> Text:
    """The sentence for a value that does not meet the conditions."""
    wanted = list(_wanted(of))
    must = wanted[0] if len(wanted) == 1 else say("both", one=wanted[0], other=wanted[1])
    return say("unmet", name=of.name, value=_now(of, value, must), wanted=must)


def _wanted(of: Interlock) -> Iterator[TextLike]:
    if of.equals is not None:
        yield _told(of, of.equals)
    if of.one_of is not None:
        *all_but_last, last = (_told(of, one) for one in of.one_of)
        yield say("either", first=tuple(all_but_last), last=last) if all_but_last else last
    if of.min is not None or of.max is not None:
        yield _limits(of)
    if of.not_equals is not None:
        yield say("not_value", value=_told(of, of.not_equals))


def _limits(of: Interlock) -> Text:
    low, high = ("" if one is None else _written(of, one) for one in (of.min, of.max))
    code = "limits_both" if low and high else "limits_low" if low else "limits_high"
    return say(code, low=low, high=high, unit=_unit(of))


def _now(of: Interlock, value: Any, must: TextLike) -> str:
    """What the robot said: in as few digits as tell it from what it must be."""
    if not isinstance(value, float):
        return _told(of, value)
    told = (_told(of, float(f"{value:.{digits}g}")) for digits in DIGITS)
    written = render(must)  # its numbers are the same in every language
    return next((text for text in told if text not in written), _told(of, value))


def _told(of: Interlock, value: Any) -> str:
    return _written(of, value) + _unit(of)


def _unit(of: Interlock) -> str:
    return f" {of.unit}" if of.unit else ""


def _written(of: Interlock, value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"' if len(value) <= LONGEST_TEXT else f'"{value[: LONGEST_TEXT - 1]}…"'
    if value in of.constants:
        return of.constants[value]
    return decimal(shortest(value) if isinstance(value, float) else value)
