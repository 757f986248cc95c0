"""What an operator entered, checked: values of JSON and of forms → what a message takes."""

import re
from typing import Any, Final

from app.errors import InputError
from app.i18n import say
from app.interfaces.validation import shown
from app.panel.model import Input
from app.panel.widgets.check_inputs import on_step
from app.panel.widgets.inputs import MOST, Numeric, SelectInput, TextInput, ToggleInput, digits, same

# Reads each character once, however long a text is: what two parts could take is tried again and again.
DECIMAL: Final = re.compile(r"\s*[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?\s*", re.ASCII)
SWITCHED: Final = {"true": True, "false": False}


def limits(of: Numeric) -> str:
    """What a number may be, as an operator reads it: "0 to 1.5 m/s, in steps of 0.1"."""
    low, high = digits(of.min), digits(of.max)
    unit = f" {of.unit}" if of.unit else ""
    if of.step is None:
        return say("limits_both", low=low, high=high, unit=unit)
    return say("limits", low=low, high=high, unit=unit, step=digits(of.step))


def default_of(of: Input) -> Any:
    """The default that the panel file gives an input, as a press gives it; None where it gives none."""
    if "default" not in of.model_fields_set or of.default is None:
        return None
    return of.typed(of.default) if isinstance(of, Numeric) else of.default


def typed(of: Input, text: str) -> Any:
    """A form's text as a value of this input's kind; as it is where it is none."""
    match of:
        case ToggleInput():
            return SWITCHED.get(text, text)
        case Numeric():
            return _written(text) if DECIMAL.fullmatch(text) else text
    return text


def _written(text: str) -> int | float:
    value = float(text)
    return int(value) if abs(value) <= MOST and value.is_integer() else value


def checked(of: Input, given: Any) -> Any:
    """The value that a message takes; InputError with a sentence that names label and limits."""
    match of:
        case TextInput():
            return _text(of, given)
        case SelectInput():
            return _option(of, given)
        case ToggleInput():
            if isinstance(given, bool):
                return given
            raise InputError(say("no_toggle", label=of.label, on=of.on, off=of.off, given=shown(given)))
    return _number(of, given)


def _text(of: TextInput, given: Any) -> str:
    """Lengths count characters, as an operator does."""
    if not isinstance(given, str):
        raise InputError(f'{of.label} ("{of.id}") must be text, not {shown(given)}')
    if len(given) > of.max_length:
        raise InputError(f"{of.label} is {len(given)} characters long; {of.max_length} are allowed")
    return given


def _number(of: Numeric, given: Any) -> int | float:
    label, allowed = of.label, limits(of)
    if given == "" or given is None:
        raise InputError(say("number_empty", label=label, limits=allowed))
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise InputError(say("no_number", label=label, limits=allowed, given=shown(given)))
    # Limits first: what is beyond them may be no float at all, or take long to divide.
    if not of.min <= given <= of.max or not on_step(of, float(given)):
        small = isinstance(given, float) and abs(given) <= MOST
        text = digits(given) if small else shown(given)
        raise InputError(say("off_limits", label=label, limits=allowed, given=text))
    return of.typed(float(given))


def _option(of: SelectInput, given: Any) -> Any:
    """The option whose value was given, or whose key: so it comes from a form and a browser."""
    for option in of.options:
        if same(option.value, given) or option.key == given:
            return option.value
    options = ", ".join(option.label for option in of.options)
    raise InputError(say("no_option", label=of.label, options=options, given=shown(given)))
