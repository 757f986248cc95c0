"""What a node says of a parameter that it declares, and what may be set by it: pure.

Shapes: rcl_interfaces/msg/ParameterValue and ParameterDescriptor, of ROS 2's parameter services.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from app.errors import InputError
from app.inputs import DECIMAL
from app.interfaces import INTEGERS
from app.interfaces.scalars import shown
from app.panel.parameter import Parameter
from app.panel.ranges import Range, described
from app.sentences import say

# rcl_interfaces/msg/ParameterType: a type is its place here.
NAMES: Final = (
    "not set", "bool", "integer", "double", "string", "byte array", "bool array", "integer array",
    "double array", "string array",
)  # fmt: skip
NOT_SET: Final = 0
EMPTY: Final[Mapping[str, Any]] = {
    "type": NOT_SET,
    "bool_value": False,
    "integer_value": 0,
    "double_value": 0.0,
    "string_value": "",
    "byte_array_value": (),
    "bool_array_value": (),
    "integer_array_value": (),
    "double_array_value": (),
    "string_array_value": (),
}
LONGEST_TEXT: Final = 1000  # characters that can be set
WHOLE: Final = re.compile(r"\s*[+-]?[0-9]{1,19}\s*", re.ASCII)

State = Literal["waiting", "live", "cut", "silent", "missing", "undeclared", "mistyped", "unreadable"]
Value = bool | int | float | str

OPEN: Final = Range()


@dataclass(frozen=True, slots=True)
class Declared:
    """What is known of a parameter; `found` is the type that it has on the robot.

    `value` is None where there is none; of one that is `cut` or `silent` it is the last known.
    `wall` (seconds since the epoch) is when the node told it.
    """

    state: State
    value: Value | None = None
    range: Range = OPEN
    read_only: bool = False
    hint: str = ""
    found: str = ""
    wall: float = 0.0


UNKNOWN: Final = Declared("waiting")


def declared(of: Parameter, descriptor: Any, value: Any, wall: float) -> Declared:
    """From a ParameterDescriptor and a ParameterValue, each None where the node gave none."""
    kind = NOT_SET if value is None else value.type
    described_as = NOT_SET if descriptor is None or descriptor.dynamic_typing else descriptor.type
    if kind == described_as == NOT_SET and not (descriptor is not None and descriptor.dynamic_typing):
        return Declared("undeclared", wall=wall)
    for one in (kind, described_as):
        if one != NOT_SET and one != NAMES.index(of.type):
            return Declared("mistyped", found=name_of(one), wall=wall)
    if descriptor is None:
        return Declared("unreadable", wall=wall)
    return Declared(
        "missing" if kind == NOT_SET else "live",
        None if kind == NOT_SET else value_in(of, value),
        range_of(of, descriptor),
        bool(descriptor.read_only),
        " ".join(filter(None, (descriptor.description, descriptor.additional_constraints))),
        of.type,
        wall,
    )


def name_of(kind: int) -> str:
    """The name of a rcl_interfaces/msg/ParameterType."""
    return NAMES[kind] if kind < len(NAMES) else f"type {kind}"


def value_in(of: Parameter, value: Any) -> Value:
    """The value of a ParameterValue whose type is the parameter's."""
    found: Value = getattr(value, f"{of.type}_value")
    return found


def wire(of: Parameter, value: Value) -> dict[str, Any]:
    """The fields of a ParameterValue."""
    return {**EMPTY, "type": NAMES.index(of.type), f"{of.type}_value": value}


def range_of(of: Parameter, descriptor: Any) -> Range:
    """The range that a node describes; without a limit where it gives none that is a number."""
    ranges = descriptor.integer_range if of.type == "integer" else descriptor.floating_point_range
    if not of.numeric or not ranges:
        return OPEN
    one = ranges[0]
    return Range(_limit(one.from_value), _limit(one.to_value), _limit(one.step) or None)


def _limit(number: float) -> float | None:
    return number if math.isfinite(number) else None


def own_range(of: Parameter) -> Range:
    """What the panel itself allows."""
    limits = (of.min, of.max, of.step)
    if of.type == "integer":
        return Range(*(None if one is None else int(one) for one in limits))
    return Range(*limits)


def allowed(of: Parameter, known: Declared) -> Range:
    """What both the node and the panel allow."""
    return known.range.within(own_range(of))


def limits_text(of: Parameter, limits: Range) -> str:
    """What may be set, as an operator reads it; "" for what is no number."""
    if not of.numeric:
        return ""
    return described(limits, of.unit) or say("any_whole" if of.type == "integer" else "any_number")


def typed(of: Parameter, text: str) -> Any:
    """A form's text as a value of this parameter's type; as it is where it is none."""
    match of.type:
        case "bool":
            return {"true": True, "false": False}.get(text, text)
        case "double":
            return float(text) if DECIMAL.fullmatch(text) else text
    return text


def checked(of: Parameter, known: Declared, given: Any) -> Value:
    """The value to set; InputError names the label and what it may be."""
    match of.type:
        case "bool":
            if isinstance(given, bool):
                return given
            raise InputError(say("no_toggle", label=of.label, on=of.on, off=of.off, given=shown(given)))
        case "string":
            if isinstance(given, str) and len(given) <= LONGEST_TEXT:
                return given
            text = shown(given)
            raise InputError(say("no_text", label=of.label, most=LONGEST_TEXT, given=text))
    return _number(of, known, given)


def _number(of: Parameter, known: Declared, given: Any) -> int | float:
    limits = allowed(of, known)
    text = limits_text(of, limits)
    if given == "" or given is None:
        raise InputError(say("number_empty", label=of.label, limits=text))
    value = _whole(given) if of.type == "integer" else _double(given)
    if value is None:
        raise InputError(say("no_number", label=of.label, limits=text, given=shown(given)))
    for one in (limits, known.range):
        if not one.holds(value):
            text = limits_text(of, one)
            raise InputError(say("off_limits", label=of.label, limits=text, given=of.written(value)))
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
