"""The state of a node's parameter and the values that may be set. Pure.

Shapes: rcl_interfaces/msg/ParameterValue and ParameterDescriptor, of ROS 2's parameter services.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from app.panel.numbers import Range, range_text
from app.panel.widgets.parameter import Parameter, Value
from app.ros.graph.node_services import PARAMETER_TYPES
from app.system.texts import TextLike, joined, say
from app.system.texts.text import numbers

NOT_SET: Final = 0
EMPTY_VALUE: Final[Mapping[str, Any]] = {
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
MAX_LIST_LENGTH: Final = 1000  # values that can be set; of a longer list one value more is kept

State = Literal["waiting", "live", "cut", "silent", "missing", "undeclared", "mistyped", "unreadable"]
UNLIMITED: Final = Range()
EXAMPLE: Final = {False: ("1.5", "2.5"), True: ("1", "2")}  # of a list


@dataclass(frozen=True, slots=True)
class ParameterState:
    """The known state of a parameter; `robot_type` is its type on the robot.

    `value` is None without a value; in the states `cut` and `silent` it is the last known one. `wall`
    (seconds since the epoch) is when it was received.
    """

    state: State
    value: Value | None = None
    range: Range = UNLIMITED
    read_only: bool = False
    hint: str = ""
    robot_type: str = ""
    wall: float = 0.0


UNKNOWN: Final = ParameterState("waiting")


def read_parameter_state(
    parameter: Parameter, descriptor: Any, value: Any, wall: float
) -> ParameterState:
    """The state from a ParameterDescriptor and a ParameterValue, each None if the node sent none."""
    kind = NOT_SET if value is None else value.type
    described_as = NOT_SET if descriptor is None or descriptor.dynamic_typing else descriptor.type
    if kind == described_as == NOT_SET and not (descriptor is not None and descriptor.dynamic_typing):
        return ParameterState("undeclared", wall=wall)
    for robot_type in (kind, described_as):
        if robot_type != NOT_SET and robot_type != PARAMETER_TYPES.index(parameter.type):
            return ParameterState("mistyped", robot_type=type_name(robot_type), wall=wall)
    if descriptor is None:
        return ParameterState("unreadable", wall=wall)
    return ParameterState(
        "missing" if kind == NOT_SET else "live",
        None if kind == NOT_SET else decode_value(parameter, value),
        described_range(parameter, descriptor),
        bool(descriptor.read_only),
        " ".join(filter(None, (descriptor.description, descriptor.additional_constraints))),
        parameter.type,
        wall,
    )


def type_name(kind: int) -> str:
    """The name of a rcl_interfaces/msg/ParameterType."""
    return PARAMETER_TYPES[kind] if kind < len(PARAMETER_TYPES) else f"type {kind}"


def decode_value(parameter: Parameter, value: Any) -> Value:
    """The value in a ParameterValue of the parameter's type."""
    reported: Any = getattr(value, _value_field(parameter))
    return tuple(reported[: MAX_LIST_LENGTH + 1]) if parameter.is_list else reported


def encode_value(parameter: Parameter, value: Value) -> dict[str, Any]:
    """The fields of a ParameterValue."""
    return {
        **EMPTY_VALUE,
        "type": PARAMETER_TYPES.index(parameter.type),
        _value_field(parameter): value,
    }


def _value_field(parameter: Parameter) -> str:
    return (
        f"{parameter.element_type}_array_value"
        if parameter.is_list
        else f"{parameter.element_type}_value"
    )


def described_range(parameter: Parameter, descriptor: Any) -> Range:
    """The range in a ParameterDescriptor; limits that are not finite are left open."""
    ranges = (
        descriptor.integer_range
        if parameter.element_type == "integer"
        else descriptor.floating_point_range
    )
    if not parameter.has_numbers or not ranges:
        return UNLIMITED
    limits = ranges[0]
    return Range(_finite(limits.from_value), _finite(limits.to_value), _finite(limits.step) or None)


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def panel_range(parameter: Parameter) -> Range:
    """The range that the panel file allows."""
    limits = (parameter.min, parameter.max, parameter.step)
    if parameter.element_type == "integer":
        return Range(*(None if limit is None else int(limit) for limit in limits))
    return Range(*limits)


def allowed_range(parameter: Parameter, known: ParameterState) -> Range:
    """The range that both the node and the panel file allow."""
    return known.range.narrowed_by(panel_range(parameter))


def has_allowed_value(parameter: Parameter, known: ParameterState) -> bool:
    """Whether both the node and the panel file allow at least one value."""
    if not (parameter.options and parameter.has_numbers):
        return not allowed_range(parameter, known).is_empty
    values = (option.value if parameter.is_list else [option.value] for option in parameter.options)
    return any(all(known.range.contains(value) for value in several) for several in values)


def panel_limits_text(parameter: Parameter) -> TextLike:
    """The values that the panel file allows, as text for an operator."""
    labels = joined((option.label for option in parameter.options), "between_names")
    return labels or limits_text(parameter, panel_range(parameter))


def limits_text(parameter: Parameter, limits: Range) -> TextLike:
    """The allowed values as text for an operator; "" if no text is needed."""
    if parameter.options:
        return ""
    if parameter.is_list:
        each = each_text(parameter, limits)
        if parameter.has_numbers:
            return say("limits_numbers", each=each, example=numbers(EXAMPLE[parameter.is_whole]))
        return say("limits_list", each=each)
    return each_text(parameter, limits) if parameter.has_numbers else ""


def each_text(parameter: Parameter, limits: Range) -> TextLike:
    """The allowed values of one element, as text."""
    match parameter.element_type:
        case "bool":
            return say("condition_either", first=parameter.on, last=parameter.off)
        case "string":
            return say("limits_any_text")
    whole = parameter.element_type == "integer"
    return range_text(limits, parameter.unit) or say(
        "limits_any_whole_number" if whole else "limits_any_number"
    )
