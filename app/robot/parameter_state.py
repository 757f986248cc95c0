"""What a node says of a parameter that it declares, and what may be set by it: pure.

Shapes: rcl_interfaces/msg/ParameterValue and ParameterDescriptor, of ROS 2's parameter services.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

from app.i18n import TextLike, joined, say
from app.panel.number_range import Range, described
from app.panel.widgets.parameter import Parameter, Value

# rcl_interfaces/msg/ParameterType: a type is its place here.
NAMES: Final = (
    "not set", "bool", "integer", "double", "string", "byte[]", "bool[]", "integer[]", "double[]",
    "string[]",
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
LONGEST_LIST: Final = 1000  # values that can be set; of longer lists so many and one more are known

State = Literal["waiting", "live", "cut", "silent", "missing", "undeclared", "mistyped", "unreadable"]
OPEN: Final = Range()


@dataclass(frozen=True, slots=True)
class ParameterState:
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


UNKNOWN: Final = ParameterState("waiting")


def parameter_states(of: Parameter, descriptor: Any, value: Any, wall: float) -> ParameterState:
    """From a ParameterDescriptor and a ParameterValue, each None where the node gave none."""
    kind = NOT_SET if value is None else value.type
    described_as = NOT_SET if descriptor is None or descriptor.dynamic_typing else descriptor.type
    if kind == described_as == NOT_SET and not (descriptor is not None and descriptor.dynamic_typing):
        return ParameterState("undeclared", wall=wall)
    for one in (kind, described_as):
        if one != NOT_SET and one != NAMES.index(of.type):
            return ParameterState("mistyped", found=name_of(one), wall=wall)
    if descriptor is None:
        return ParameterState("unreadable", wall=wall)
    return ParameterState(
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
    found: Any = getattr(value, _field(of))
    return tuple(found[: LONGEST_LIST + 1]) if of.many else found


def wire(of: Parameter, value: Value) -> dict[str, Any]:
    """The fields of a ParameterValue."""
    return {**EMPTY, "type": NAMES.index(of.type), _field(of): value}


def _field(of: Parameter) -> str:
    return f"{of.element}_array_value" if of.many else f"{of.element}_value"


def range_of(of: Parameter, descriptor: Any) -> Range:
    """The range that a node describes; without a limit where it gives none that is a number."""
    ranges = descriptor.integer_range if of.element == "integer" else descriptor.floating_point_range
    if not of.counts or not ranges:
        return OPEN
    one = ranges[0]
    return Range(_limit(one.from_value), _limit(one.to_value), _limit(one.step) or None)


def _limit(number: float) -> float | None:
    return number if math.isfinite(number) else None


def own_range(of: Parameter) -> Range:
    """What the panel itself allows."""
    limits = (of.min, of.max, of.step)
    if of.element == "integer":
        return Range(*(None if one is None else int(one) for one in limits))
    return Range(*limits)


def allowed(of: Parameter, known: ParameterState) -> Range:
    """What both the node and the panel allow."""
    return known.range.within(own_range(of))


def suits(of: Parameter, known: ParameterState) -> bool:
    """Whether there is a value that both the node and the panel allow."""
    if not (of.options and of.counts):
        return not allowed(of, known).empty
    values = (one.value if of.many else [one.value] for one in of.options)
    return any(all(known.range.holds(one) for one in several) for several in values)


def ours_text(of: Parameter) -> TextLike:
    """What the panel lets be set, as an operator reads it."""
    labels = joined((option.label for option in of.options), "between_names")
    return labels or limits_text(of, own_range(of))


def limits_text(of: Parameter, limits: Range) -> TextLike:
    """What may be set, as an operator reads it; "" where nothing has to be said."""
    if of.options:
        return ""
    if of.many:
        return say("limits_list", each=each_text(of, limits))
    return each_text(of, limits) if of.counts else ""


def each_text(of: Parameter, limits: Range) -> TextLike:
    """What one value may be."""
    match of.element:
        case "bool":
            return say("either", first=of.on, last=of.off)
        case "string":
            return say("any_text")
    whole = of.element == "integer"
    return described(limits, of.unit) or say("any_whole" if whole else "any_number")
