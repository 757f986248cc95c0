"""Keys that several tables of a panel file take: their types, their checks, and what is computed with
them. `app/panel/reference/panel_keys.toml` says once what each means."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from app.panel.base import (
    Description,
    FieldPath,
    FiniteNumber,
    Id,
    Seconds,
    TopicName,
    TopicQos,
    Type,
    distinct,
    panel_text,
)
from app.panel.numbers import FORMAT, NUMBERS, is_scaled
from app.panel.times import DEFAULT_FORMATS, time_faults
from app.ros.messages import INTEGER_RANGES
from app.system.errors import Fault
from app.system.texts import PanelText

# The topic of a table, and the field that is read.


class TopicKeys(Description):
    """A topic that the table reads or publishes."""

    topic: TopicName
    type: Type
    qos: TopicQos = TopicQos()


class OptionalTopicKeys(Description):
    """The same of a table that may have none."""

    topic: TopicName | None = None
    type: Type | None = None
    qos: TopicQos = TopicQos()


class FieldKey(Description):
    """A field of a message."""

    field: FieldPath = "data"


class FieldKeys(FieldKey, TopicKeys):
    """A field of a topic."""


class AgeKey(Description):
    """How old a value may be."""

    max_age_s: Seconds | None = None


def stale_at(at: float, max_age_s: float | None) -> float:
    """When a value that was received at `at` becomes too old (both in monotonic seconds)."""
    return math.inf if max_age_s is None else at + max_age_s


# How a number is shown: `value * scale + offset` in a format, with a unit.

# The same, or a time: see `app.panel.times`.
FORMAT_OR_TIME: Final = rf"{FORMAT}|^(time|age|duration)$"
NumberFormat = Annotated[str, Field(pattern=FORMAT)]
NumberOrTimeFormat = Annotated[str, Field(pattern=FORMAT_OR_TIME)]
if TYPE_CHECKING:
    Unit = str | PanelText
else:
    Unit = panel_text(20, least=0)


class ScaleKeys(Description):
    """A number that is shown or compared as `value * scale + offset`."""

    scale: FiniteNumber = 1.0
    offset: FiniteNumber = 0.0

    @property
    def is_scaled(self) -> bool:
        """Whether another number is shown than that of the message."""
        return is_scaled(self)


class NumberKeys(ScaleKeys):
    """The same, with its unit and its format."""

    unit: Unit = ""
    format: NumberFormat | None = None


def number_key_faults(place: str, table: Description, field: str, kind: str) -> Iterator[Fault]:
    """Faults of the keys of the table at `place` that are for numbers, with a `field` of this type. The
    table takes some of them."""
    values: dict[str, Any] = {
        "unit": "",
        "scale": 1.0,
        "offset": 0.0,
        "format": None,
        "constants": None,
    }
    values |= {key: getattr(table, key) for key in values if key in type(table).model_fields}
    unit, scale, offset, style, constants = values.values()
    if times := list(time_faults(place, style, kind, unit)):
        yield from times
        return
    style = None if kind in DEFAULT_FORMATS else style
    for_numbers = {"unit": unit, "scale": scale != 1.0, "offset": offset, "format": style}
    for key in (key for key, value in for_numbers.items() if value):
        if kind not in NUMBERS:
            yield Fault(
                f"{place}.{key}", f'is for numbers; "{field}" is {kind}', cause=f"number {place}"
            )
        elif constants is not None:
            message = "is for numbers; constants are shown by their names"
            yield Fault(f"{place}.{key}", message, cause=f"number {place}")
    yield from scale_faults(place, scale)
    is_whole = kind in INTEGER_RANGES and (scale, offset) == (1.0, 0.0)
    if style is not None and style.endswith("d") and kind in NUMBERS and not is_whole:
        kind_text = "a scaled number" if (scale, offset) != (1.0, 0.0) else kind
        yield Fault(f"{place}.format", f'"{style}" is for whole numbers; this is {kind_text}')


def scale_faults(place: str, scale: float | None) -> Iterator[Fault]:
    """A fault of the scale 0."""
    if scale == 0:
        yield Fault(f"{place}.scale", "is 0: every value would be the same")


class RobotKey(Description):
    """The robot that the table is of, by its id; None for the one that the table around it says, or for
    each."""

    robot: Id | None = None


class RobotsKey(Description):
    """Whether a table shows the robot whose page it is on, or all robots."""

    robots: Literal["this", "all"] = "this"


class NeedsKey(Description):
    """The role or group of users that the table needs."""

    needs: Id | None = None


# Priorities of alarms: 1 high, 2 medium, 3 low, 4 diagnostic.

Priority = Annotated[int, Field(ge=1, le=4)]
Priorities = Annotated[tuple[Priority, ...], Field(strict=False), AfterValidator(distinct)]
