"""The description of a trend: numeric fields over time, and the memory that its history takes."""

import re
from collections.abc import Iterable, Iterator
from functools import cached_property
from math import ceil
from typing import Annotated, Final, Literal, Protocol

from pydantic import AfterValidator, Field

from app.panel.base import (
    FiniteNumber,
    Label,
    Seconds,
    Span,
    non_empty,
)
from app.panel.checks.types import number_faults
from app.panel.shared_keys import AgeKey, FieldKeys, NumberKeys, number_key_faults
from app.panel.widgets.displays import Readout
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource
from app.ros.messages.validation import format_value
from app.system.errors import Fault

MAX_PENS: Final = 8
OF_READOUTS: Final = ("topic", "type", "qos", "field", "label", "unit", "scale", "offset", "format")
UNITS: Final = {"s": 1, "m": 60, "h": 3600, "d": 86_400}
DURATION: Final = "[1-9][0-9]{0,5}[smhd]"
LONGEST_S: Final = 31 * UNITS["d"]
SHORTEST_S: Final = 10

# The newest samples are kept as they are; older ones as buckets (width in seconds, how many).
RAW_SAMPLES: Final = 12_000
RAW_S: Final = 120.0
BUCKETS: Final = ((1.0, 7_200), (10.0, 8_640), (60.0, 10_080), (600.0, 4_464))
RAW_BYTES: Final = 17  # time, value, gap
BUCKET_BYTES: Final = 33  # time, lowest, highest, last, gap
SLACK: Final = 1.25  # what is not removed yet, and what the lists reserve
MAX_BYTES: Final = 128_000_000  # the histories of all trends of a panel


def _check_duration(text: str) -> str:
    if not re.fullmatch(DURATION, text):
        raise ValueError(
            f'{format_value(text)} is not a duration: it must be like "90s", "10m" or "24h"'
        )
    if not SHORTEST_S <= seconds_of(text) <= LONGEST_S:
        raise ValueError(f'{format_value(text)} is out of range: durations go from "10s" to "31d"')
    return text


def seconds_of(duration: str) -> int:
    """The seconds of "90s", "10m", "24h" or "7d"."""
    return int(duration[:-1]) * UNITS[duration[-1]]


def bucket_counts(keep_s: float) -> list[tuple[float, int]]:
    """(width in seconds, how many) of the buckets that a field kept for `keep_s` has."""
    return [(width, min(most, ceil(keep_s / width) + 1)) for width, most in BUCKETS]


def history_bytes(keep_s: float) -> int:
    """The most memory that the history of one field takes."""
    buckets = sum(count for _, count in bucket_counts(keep_s))
    return round((RAW_SAMPLES * RAW_BYTES + buckets * BUCKET_BYTES) * SLACK)


Duration = Annotated[str, AfterValidator(_check_duration)]


Axis = Literal["left", "right"]


class Pen(NumberKeys, FieldKeys):
    """One line of a trend: a field as `value * scale + offset`. `normal` is the lowest and the highest
    normal value, and `axis` the side with its numbers."""

    label: Label
    low: FiniteNumber | None = None
    high: FiniteNumber | None = None
    normal: (
        Annotated[tuple[FiniteNumber, ...], Field(strict=False, min_length=2, max_length=2)] | None
    ) = None
    axis: Axis = "left"

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        interfaces = checking.interfaces
        faults = list(number_faults(place, self.type, self.field, "a pen", interfaces))
        yield from faults
        if not faults:
            kind = interfaces.field_type(self.type, self.field)
            yield from number_key_faults(place, self, self.field, kind)
        if self.low is not None and self.high is not None and self.low >= self.high:
            yield Fault(f"{place}.low", f"{self.low:g} is not below high, which is {self.high:g}")
        if self.normal is not None and self.normal[0] >= self.normal[1]:
            yield Fault(f"{place}.normal", "the first number must be below the second")


class Trend(AgeKey, DisplayWidget):
    """Fields over the time of `window`, of which the server keeps `keep`. A silence longer than
    `max_age_s` is a gap. `min` and `max` are of the left axis."""

    kind: Literal["trend"]
    pens: Annotated[
        tuple[Pen, ...], Field(strict=False, max_length=MAX_PENS), AfterValidator(non_empty)
    ] = Field(alias="pen")
    window: Duration = "10m"
    windows: Annotated[tuple[Duration, ...], Field(strict=False, max_length=12)] = ()
    keep: Duration = "24h"
    disk: bool = False
    max_age_s: Seconds = 5.0
    min: FiniteNumber | None = None
    max: FiniteNumber | None = None
    right_min: FiniteNumber | None = None
    right_max: FiniteNumber | None = None
    keys: bool = True
    span: Span = 12

    @property
    def choices(self) -> list[int]:
        """The windows to choose from, in seconds, the shortest first."""
        return sorted({seconds_of(window) for window in (*self.windows, self.window)})

    @property
    def keep_s(self) -> int:
        return seconds_of(self.keep)

    @property
    def window_s(self) -> int:
        return seconds_of(self.window)

    @cached_property
    def readouts(self) -> tuple[Readout, ...]:
        """The value of each pen, as a readout has it."""
        return tuple(
            Readout.model_construct(
                None,
                id=self.id,
                kind="readout",
                max_age_s=self.max_age_s,
                **{name: getattr(pen, name) for name in OF_READOUTS},
            )
            for pen in self.pens
        )

    def sources(self) -> Iterator[TopicSource]:
        for number, pen in enumerate(self.pens):
            yield TopicSource(pen.topic, pen.type, pen.qos, (pen.field,), f"pen[{number}]")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for number, pen in enumerate(self.pens):
            yield from pen.faults(f"{place}.pen[{number}]", checking)
        windows = {"window": self.window} | {f"windows[{i}]": w for i, w in enumerate(self.windows)}
        for key, duration in windows.items():
            if seconds_of(duration) > self.keep_s:
                message = f'"{duration}" is longer than what is kept, which is "{self.keep}"'
                yield Fault(f"{place}.{key}", message)
        yield from self._axis_faults(place)

    def axis_ends(self, axis: Axis) -> tuple[float | None, float | None]:
        """The lower and the upper end of an axis, as far as they are fixed."""
        return (self.min, self.max) if axis == "left" else (self.right_min, self.right_max)

    @property
    def has_right_axis(self) -> bool:
        """Whether pens have their numbers on the right."""
        return any(pen.axis == "right" for pen in self.pens)

    def _axis_faults(self, place: str) -> Iterator[Fault]:
        names: dict[Axis, tuple[str, str]] = {
            "left": ("min", "max"),
            "right": ("right_min", "right_max"),
        }
        for axis, (low_key, high_key) in names.items():
            low, high = self.axis_ends(axis)
            if low is not None and high is not None and low >= high:
                yield Fault(f"{place}.{low_key}", f"{low:g} is not below {high_key}, which is {high:g}")
        for key in ("right_min", "right_max") if not self.has_right_axis else ():
            if getattr(self, key) is not None:
                yield Fault(f"{place}.{key}", 'is for pens with axis = "right": there is none')
        if all(pen.axis == "right" for pen in self.pens):
            yield Fault(f"{place}.pen[0].axis", 'is "right" of every pen: leave one on the left')


def kept_fields(trends: Iterable[Trend]) -> dict[tuple[str, str], Trend]:
    """(topic, field) → the trend that keeps it for the longest time, of each field with a history."""
    kept: dict[tuple[str, str], Trend] = {}
    for trend in sorted(trends, key=lambda trend: trend.keep_s):
        for pen in trend.pens:
            kept[pen.topic, pen.field] = trend
    return kept


def disk_fields(trends: Iterable[Trend]) -> set[tuple[str, str]]:
    """(topic, field) of each history that is kept on disk."""
    return {(pen.topic, pen.field) for trend in trends if trend.disk for pen in trend.pens}


def memory_of(trends: Iterable[Trend], robots: int) -> int:
    """The most memory that the histories of all trends take, in bytes; `robots` is their number."""
    return robots * sum(history_bytes(trend.keep_s) for trend in kept_fields(trends).values())


class HasDisplays(Protocol):
    """A panel."""

    @property
    def displays(self) -> tuple[DisplayWidget, ...]: ...


def trends_of(panel: HasDisplays) -> list[Trend]:
    """The trends of a panel."""
    return [widget for widget in panel.displays if isinstance(widget, Trend)]
