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


def check_value(parameter: Parameter, known: ParameterState, entered: Any) -> Value:
    """The value to set; InputError with the label and the limits."""
    if parameter.options:
        entered = _chosen(parameter, entered)
    if not parameter.is_list:
        return _scalar(parameter, known, parameter.label, entered)
    elements = _elements(parameter, known, entered)
    if len(elements) > MAX_LIST_LENGTH:
        raise InputError(
            say(
                "parameter_list_too_long",
                label=parameter.label,
                most=MAX_LIST_LENGTH,
                count=len(elements),
            )
        )
    named = (
        say("parameter_list_element", label=parameter.label, number=i + 1) for i in range(len(elements))
    )
    return tuple(
        _scalar(parameter, known, name, element) for name, element in zip(named, elements, strict=True)
    )


def _chosen(parameter: Parameter, entered: Any) -> Any:
    """The value of an option, given by its value or its key."""
    option = parameter.find_option(entered) or next(
        (choice for choice in parameter.options if choice.key == entered), None
    )
    if option is None:
        options = tuple(choice.label for choice in parameter.options)
        raise InputError(
            say(
                "input_not_an_option",
                label=parameter.label,
                options=options,
                given=format_value(entered),
            )
        )
    return option.value


def _elements(parameter: Parameter, known: ParameterState, entered: Any) -> list[Any]:
    """The elements of a list: from text with commas, or from a program's list."""
    if isinstance(entered, list):
        return entered
    try:
        if not isinstance(entered, str) or len(entered) > MAX_TEXT:
            raise ValueError
        if parameter.is_number_list:  # of a program: pages send JSON's own lists
            return list(read_numbers(entered, ENGLISH, whole=parameter.is_whole))
        return [_entered(parameter, text) for text in split_list(entered)]
    except ValueError:
        text = limits_text(parameter, allowed_range(parameter, known))
        raise InputError(
            say("parameter_not_a_list", label=parameter.label, limits=text, given=format_value(entered))
        ) from None


def _entered(parameter: Parameter, text: str) -> Any:
    if parameter.element_type != "bool":
        return text
    words = {"true": True, "false": False}
    words |= dict.fromkeys(_words(parameter.on), True)
    words |= dict.fromkeys(_words(parameter.off), False)
    return words.get(text.lower(), text)


def _words(text: TextLike) -> list[str]:
    return [word.lower() for word in each_language(text).values()]


def _scalar(parameter: Parameter, known: ParameterState, label: TextLike, entered: Any) -> Scalar:
    match parameter.element_type:
        case "bool":
            if isinstance(entered, bool):
                return entered
            raise InputError(
                say(
                    "input_not_a_boolean",
                    label=label,
                    on=parameter.on,
                    off=parameter.off,
                    given=format_value(entered),
                )
            )
        case "string":
            if isinstance(entered, str) and len(entered) <= MAX_TEXT:
                return entered
            text = format_value(entered)
            raise InputError(say("parameter_not_a_text", label=label, most=MAX_TEXT, given=text))
    return _number(parameter, known, label, entered)


def _number(parameter: Parameter, known: ParameterState, label: TextLike, entered: Any) -> int | float:
    limits = allowed_range(parameter, known)
    text = each_text(parameter, limits)
    if entered == "" or entered is None:
        raise InputError(say("input_number_empty", label=label, limits=text))
    value = _whole(entered) if parameter.element_type == "integer" else _double(entered)
    if value is None:
        raise InputError(no_number(label, text, entered, whole=parameter.is_whole))
    for allowed in (limits, known.range):
        if not allowed.contains(value):
            text = each_text(parameter, allowed)
            raise InputError(
                say("input_outside_limits", label=label, limits=text, given=parameter.value_text(value))
            )
    return value


def _whole(entered: Any) -> int | None:
    """An int64, given as a number, or as text beyond the exact range of a browser's numbers."""
    if isinstance(entered, str) and WHOLE.fullmatch(entered):
        entered = int(entered)
    if isinstance(entered, float) and entered.is_integer():
        entered = int(entered)
    if isinstance(entered, bool) or not isinstance(entered, int):
        return None
    low, high = INTEGER_RANGES["int64"]
    return entered if low <= entered <= high else None


def _double(entered: Any) -> float | None:
    if isinstance(entered, bool) or not isinstance(entered, int | float):
        return None
    try:
        value = float(entered)
    except OverflowError:
        return None
    return value if math.isfinite(value) else None
