"""The value that a parameter is set to: from what was entered or chosen, and checked. Pure."""

import math
import re
from typing import Any, Final

from app.errors import InputError
from app.i18n import TextLike, render, say
from app.interfaces import INTEGERS
from app.interfaces.validation import shown
from app.panel.list_text import elements
from app.panel.widgets.numbers import DECIMAL
from app.panel.widgets.parameter import LONGEST_TEXT, One, Parameter, Value
from app.robot.parameter_state import LONGEST_LIST, ParameterState, allowed, each_text, limits_text

WHOLE: Final = re.compile(r"\s*[+-]?[0-9]{1,19}\s*", re.ASCII)


def checked(of: Parameter, known: ParameterState, given: Any) -> Value:
    """The value to set; InputError names the label and what it may be."""
    if of.options:
        given = _chosen(of, given)
    if not of.many:
        return _one(of, known, of.label, given)
    several = _several(of, known, given)
    if len(several) > LONGEST_LIST:
        raise InputError(say("list_long", label=of.label, most=LONGEST_LIST, count=len(several)))
    named = (say("list_value", label=of.label, number=i + 1) for i in range(len(several)))
    return tuple(_one(of, known, name, one) for name, one in zip(named, several, strict=True))


def _chosen(of: Parameter, given: Any) -> Any:
    """The value of the option that was given by its value or its key."""
    option = of.option(given) or next((one for one in of.options if one.key == given), None)
    if option is None:
        options = tuple(one.label for one in of.options)
        raise InputError(say("no_option", label=of.label, options=options, given=shown(given)))
    return option.value


def _several(of: Parameter, known: ParameterState, given: Any) -> list[Any]:
    """What was entered with commas between; a program gives a list."""
    if isinstance(given, list):
        return given
    try:
        if not isinstance(given, str) or len(given) > LONGEST_TEXT:
            raise ValueError
        return [_entered(of, text) for text in elements(given)]
    except ValueError:
        text = limits_text(of, allowed(of, known))
        raise InputError(say("no_list", label=of.label, limits=text, given=shown(given))) from None


def _entered(of: Parameter, text: str) -> Any:
    match of.element:
        case "bool":
            words = {"true": True, "false": False, _lower(of.on): True, _lower(of.off): False}
            return words.get(text.lower(), text)
        case "double":
            return float(text) if DECIMAL.fullmatch(text) else text
    return text


def _lower(text: TextLike) -> str:
    return render(text).lower()


def _one(of: Parameter, known: ParameterState, label: TextLike, given: Any) -> One:
    match of.element:
        case "bool":
            if isinstance(given, bool):
                return given
            raise InputError(say("no_toggle", label=label, on=of.on, off=of.off, given=shown(given)))
        case "string":
            if isinstance(given, str) and len(given) <= LONGEST_TEXT:
                return given
            text = shown(given)
            raise InputError(say("no_text", label=label, most=LONGEST_TEXT, given=text))
    return _number(of, known, label, given)


def _number(of: Parameter, known: ParameterState, label: TextLike, given: Any) -> int | float:
    limits = allowed(of, known)
    text = each_text(of, limits)
    if given == "" or given is None:
        raise InputError(say("number_empty", label=label, limits=text))
    value = _whole(given) if of.element == "integer" else _double(given)
    if value is None:
        raise InputError(say("no_number", label=label, limits=text, given=shown(given)))
    for one in (limits, known.range):
        if not one.holds(value):
            text = each_text(of, one)
            raise InputError(say("off_limits", label=label, limits=text, given=of.written(value)))
    return value


def _whole(given: Any) -> int | None:
    """An int64: as a number, or as text where a browser's numbers are not exact."""
    if isinstance(given, str) and WHOLE.fullmatch(given):
        given = int(given)
    if isinstance(given, float) and given.is_integer():
        given = int(given)
    if isinstance(given, bool) or not isinstance(given, int):
        return None
    low, high = INTEGERS["int64"]
    return given if low <= given <= high else None


def _double(given: Any) -> float | None:
    if isinstance(given, bool) or not isinstance(given, int | float):
        return None
    try:
        value = float(given)
    except OverflowError:
        return None
    return value if math.isfinite(value) else None
