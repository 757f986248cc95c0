"""Checks and converts the entered value of a parameter. Pure."""

import math
import re
from typing import Any, Final

from app.errors import InputError
from app.i18n import ENGLISH, TextLike, say
from app.i18n.typed_numbers import read_numbers
from app.i18n.values import each_language
from app.interfaces import INTEGER_RANGES
from app.interfaces.validation import format_value
from app.panel.values import split_list
from app.panel.widgets.numbers import no_number
from app.panel.widgets.parameter import MAX_TEXT, Parameter, Scalar, Value
from app.robot.parameter_state import (
    MAX_LIST_LENGTH,
    ParameterState,
    allowed_range,
    each_text,
    limits_text,
)

# As browsers send it. A typed text that is read as another number is none of these.
WHOLE: Final = re.compile(r"-?(0|[1-9][0-9]{0,18})", re.ASCII)


def check_value(parameter: Parameter, known: ParameterState, given: Any) -> Value:
    """The value to set; InputError with the label and the limits."""
    if parameter.options:
        given = _chosen(parameter, given)
    if not parameter.is_list:
        return _one(parameter, known, parameter.label, given)
    several = _several(parameter, known, given)
    if len(several) > MAX_LIST_LENGTH:
        raise InputError(
            say(
                "parameter_list_too_long",
                label=parameter.label,
                most=MAX_LIST_LENGTH,
                count=len(several),
            )
        )
    named = (
        say("parameter_list_element", label=parameter.label, number=i + 1) for i in range(len(several))
    )
    return tuple(_one(parameter, known, name, one) for name, one in zip(named, several, strict=True))


def _chosen(parameter: Parameter, given: Any) -> Any:
    """The value of an option, given by its value or its key."""
    option = parameter.find_option(given) or next(
        (one for one in parameter.options if one.key == given), None
    )
    if option is None:
        options = tuple(one.label for one in parameter.options)
        raise InputError(
            say(
                "input_not_an_option", label=parameter.label, options=options, given=format_value(given)
            )
        )
    return option.value


def _several(parameter: Parameter, known: ParameterState, given: Any) -> list[Any]:
    """The elements of a list: from text with commas, or from a program's list."""
    if isinstance(given, list):
        return given
    try:
        if not isinstance(given, str) or len(given) > MAX_TEXT:
            raise ValueError
        if parameter.is_number_list:  # of a program: pages send JSON's own lists
            return list(read_numbers(given, ENGLISH, whole=parameter.is_whole))
        return [_entered(parameter, text) for text in split_list(given)]
    except ValueError:
        text = limits_text(parameter, allowed_range(parameter, known))
        raise InputError(
            say("parameter_not_a_list", label=parameter.label, limits=text, given=format_value(given))
        ) from None


def _entered(parameter: Parameter, text: str) -> Any:
    if parameter.element_type != "bool":
        return text
    words = {"true": True, "false": False}
    words |= dict.fromkeys(_words(parameter.on), True)
    words |= dict.fromkeys(_words(parameter.off), False)
    return words.get(text.lower(), text)


def _words(text: TextLike) -> list[str]:
    return [one.lower() for one in each_language(text).values()]


def _one(parameter: Parameter, known: ParameterState, label: TextLike, given: Any) -> Scalar:
    match parameter.element_type:
        case "bool":
            if isinstance(given, bool):
                return given
            raise InputError(
                say(
                    "input_not_a_boolean",
                    label=label,
                    on=parameter.on,
                    off=parameter.off,
                    given=format_value(given),
                )
            )
        case "string":
            if isinstance(given, str) and len(given) <= MAX_TEXT:
                return given
            text = format_value(given)
            raise InputError(say("parameter_not_a_text", label=label, most=MAX_TEXT, given=text))
    return _number(parameter, known, label, given)


def _number(parameter: Parameter, known: ParameterState, label: TextLike, given: Any) -> int | float:
    limits = allowed_range(parameter, known)
    text = each_text(parameter, limits)
    if given == "" or given is None:
        raise InputError(say("input_number_empty", label=label, limits=text))
    value = _whole(given) if parameter.element_type == "integer" else _double(given)
    if value is None:
        raise InputError(no_number(label, text, given, whole=parameter.is_whole))
    for one in (limits, known.range):
        if not one.contains(value):
            text = each_text(parameter, one)
            raise InputError(
                say("input_outside_limits", label=label, limits=text, given=parameter.value_text(value))
            )
    return value


def _whole(given: Any) -> int | None:
    """An int64, given as a number, or as text beyond the exact range of a browser's numbers."""
    if isinstance(given, str) and WHOLE.fullmatch(given):
        given = int(given)
    if isinstance(given, float) and given.is_integer():
        given = int(given)
    if isinstance(given, bool) or not isinstance(given, int):
        return None
    low, high = INTEGER_RANGES["int64"]
    return given if low <= given <= high else None


def _double(given: Any) -> float | None:
    if isinstance(given, bool) or not isinstance(given, int | float):
        return None
    try:
        value = float(given)
    except OverflowError:
        return None
    return value if math.isfinite(value) else None
