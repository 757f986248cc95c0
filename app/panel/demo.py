"""The `[demo]` table of a panel file: what the simulated robot does with single names."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Final

from pydantic import BeforeValidator, Field

from app.interfaces.validation import format_value
from app.panel.base import Description, Seconds

RANGE_LENGTH: Final = 2


def _check_range(value: Any) -> tuple[float, ...]:
    """The lowest and the highest value."""
    numbers = isinstance(value, list | tuple) and len(value) == RANGE_LENGTH
    if not numbers or not all(_is_finite(limit) for limit in value):
        raise ValueError(
            f"must be the lowest and the highest value, like [0, 100], not {format_value(value)}"
        )
    low, high = value
    if high <= low:
        lowest, highest = format_value(low), format_value(high)
        raise ValueError(f"the highest value ({highest}) must be more than the lowest ({lowest})")
    return low, high


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _check_values(value: Any) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple) or not value:
        raise ValueError(f"must be a list of one value at least, not {format_value(value)}")
    for element in value:
        if not isinstance(element, bool | int | float | str):
            raise ValueError(
                f"must be numbers, true or false, or texts; {format_value(element)} is none of them"
            )
    return tuple(value)


# Of numbers as the message has them, before a readout's `scale` and `offset`.
Range = Annotated[tuple[float, ...], BeforeValidator(_check_range)]


class DemoEntry(Description):
    """What the simulated robot does with one topic, service, action or node.

    Of a topic: `range` and `values` are of all fields that the panel shows, `ranges` of one each, and
    `message` fixes other fields. `silent`: the robot does not have it at all.
    """

    silent: bool = False
    range: Range | None = None
    ranges: Mapping[str, Range] = Field(default_factory=dict)
    values: Annotated[tuple[Any, ...], BeforeValidator(_check_values)] | None = None
    message: Mapping[str, Any] = Field(default_factory=dict)
    period_s: Seconds | None = None
    hz: Annotated[float, Field(ge=0.1, le=100)] | None = None
    response: Mapping[str, Any] = Field(default_factory=dict)
    result: Mapping[str, Any] = Field(default_factory=dict)
    duration_s: Seconds | None = None
    parameters: Mapping[str, Any] = Field(default_factory=dict)


NO_ENTRY: Final = DemoEntry()
