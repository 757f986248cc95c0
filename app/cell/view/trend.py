"""The plot of a trend as paths, marks and texts of an SVG: pure, from (widget, history, time).

The plot is a square of `SIZE` units a side, stretched to its box; texts and marks stand at percentages.
`static/js/kinds/trend.js` draws the same in the browser.
"""

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, NamedTuple

from app.cell.robot.history import Column, History
from app.cell.robot.state import RobotState
from app.cell.view.displays import FieldState, field_state, is_not_finite, readout
from app.panel.numbers import is_beyond_battery, is_scaled, shown_number
from app.panel.widgets.trend import Axis, Pen, Trend
from app.system.clock import offset_text
from app.system.texts import TextLike, joined, say
from app.system.texts import number as text_number
from app.system.texts.locales import MINUS
from app.system.texts.text import together

SIZE: Final = 1000
AXES: Final[Sequence[Axis]] = ("left", "right")
NAME_ROOM: Final = 12  # percent of the height that the name of a limit takes
COLUMNS: Final = 240
VALUE_TICKS: Final = 4
TIME_TICKS: Final = 5
# Seconds between two ticks.
STEPS: Final = (
    *(1, 2, 5, 10, 15, 30),
    *(60, 120, 300, 600, 900, 1800),
    *(3600, 7200, 10_800, 21_600, 43_200, 86_400, 172_800, 604_800),
)
DAY: Final = 86_400
LARGEST: Final = 1e300  # of an axis
LEAST_WIDTH: Final = 1e-300
NARROWEST: Final = 1e-9  # relative: a narrower axis has ticks that doubles can't tell apart
MARGIN: Final = 0.05
MOST_DIGITS: Final = 12  # after the point

Range = tuple[float, float]
Place = Callable[[float], float]


class Tick(NamedTuple):
    """A line of the grid: its place in percent of the plot, and its text."""

    place: float
    text: TextLike


class PlotLimit(NamedTuple):
    """A limit of a pen, "H" or "L"."""

    pen: int
    place: float
    text: TextLike
    letter: str

    @property
    def named_above(self) -> bool:
        """Whether its name is above its line: outside of what the limits enclose, if that is drawn."""
        return self.place >= NAME_ROOM if self.letter == "H" else self.place > 100 - NAME_ROOM


class Band(NamedTuple):
    """The normal values of a pen."""

    pen: int
    top: float
    height: float


class PlotLine(NamedTuple):
    """A pen's line, and where its newest value stands; None without one in the plot."""

    path: str
    x: float | None
    y: float


@dataclass(frozen=True, slots=True)
class Plot:
    """What is drawn."""

    lines: Sequence[PlotLine]
    values: Sequence[Tick]
    times: Sequence[Tick]
    limits: Sequence[PlotLimit]
    bands: Sequence[Band]
    right_values: Sequence[Tick] = ()  # of the right axis, whose lines are not drawn


def plot(widget: Trend, robot: RobotState, monotonic: float, wall: float) -> Plot:
    """The plot of a trend's own window until now."""
    history = robot.history
    history.set_clock(monotonic, wall)
    begin = wall - widget.window_s
    columns = [pen_columns(robot, pen, begin, wall, widget.window_s / COLUMNS) for pen in widget.pens]
    return draw(widget, columns, begin, wall)


def pen_columns(
    robot: RobotState, pen: Pen, begin: float, end: float, width: float
) -> Sequence[Column]:
    """The columns of a pen, in its unit."""
    history: History = robot.history
    field = history.fields[robot.key(pen.topic), pen.field]
    return scaled_columns(history.columns(field, begin, end, width), pen)


def scaled_columns(columns: Sequence[Column], pen: Pen) -> Sequence[Column]:
    """Columns of a field, in the unit of its pen. A charge that can't be one is a gap."""
    if not is_scaled(pen):
        return columns
    scaled: list[Column] = []
    gap = False
    for column in columns:
        if is_beyond_battery(pen, column.high):
            gap = True
        else:
            shown = _scaled(column, pen)
            scaled.append(shown._replace(gap=True) if gap else shown)
            gap = False
    return scaled


def _scaled(column: Column, pen: Pen) -> Column:
    low, high = sorted((_shown(pen, column.low), _shown(pen, column.high)))
    return column._replace(low=low, high=high, last=_shown(pen, column.last))


def _shown(pen: Pen, value: float) -> float:
    """The nearest finite number: a scale may lead beyond all doubles. As `shown_number` but for the
    last digits, which no curve shows: a plot has thousands of values."""
    return min(max(value * pen.scale + pen.offset, -sys.float_info.max), sys.float_info.max)


def draw(
    widget: Trend,
    columns: Sequence[Sequence[Column]],
    begin: float,
    end: float,
    points: int = COLUMNS,
) -> Plot:
    """The plot of columns from `begin` to `end`, which are seconds of the wall clock; there is room for
    so many `points` between them."""
    ends = {axis: value_range(widget, columns, axis) for axis in _axes(widget)}

    def place(value: float, axis: Axis = "left") -> float:
        low, high = ends[axis]
        return round(min(max((high - value) / (high - low), -0.5), 1.5) * 100, 2)

    width = (end - begin) / points
    pens = list(enumerate(widget.pens))
    bands = [
        Band(i, place(pen.normal[1], pen.axis), round(low - place(pen.normal[1], pen.axis), 2))
        for i, pen in pens
        if pen.normal
        for low in [place(pen.normal[0], pen.axis)]
    ]
    limits = [
        PlotLimit(
            i, place(value, pen.axis), together((f"{letter} ", text_number(f"{value:g}"))), letter
        )
        for i, pen in pens
        for value, letter in ((pen.high, "H"), (pen.low, "L"))
        if value is not None
    ]
    lines = [
        _line(column, begin, end, width, partial(place, axis=pen.axis))
        for column, (_, pen) in zip(columns, pens, strict=True)
    ]
    left, right = (
        [Tick(place(value, axis), text_number(text)) for value, text in value_ticks(*ends[axis])]
        if axis in ends
        else []
        for axis in AXES
    )
    return Plot(lines, left, list(time_ticks(begin, end)), limits, bands, right)


def _axes(widget: Trend) -> Sequence[Axis]:
    return AXES if widget.has_right_axis else AXES[:1]


def value_range(widget: Trend, columns: Sequence[Sequence[Column]], axis: Axis) -> tuple[float, float]:
    """The lowest and highest value of an axis: as the panel file says, else of all that its pens
    draw."""
    pens = [(pen, drawn) for pen, drawn in zip(widget.pens, columns, strict=True) if pen.axis == axis]
    limits = [v for pen, _ in pens for v in (pen.low, pen.high, *(pen.normal or ())) if v is not None]
    lows = [column.low for _, drawn in pens for column in drawn] + limits
    highs = [column.high for _, drawn in pens for column in drawn] + limits
    return axis_range(min(lows, default=0.0), max(highs, default=1.0), *widget.axis_ends(axis))


def axis_range(low: float, high: float, fixed_low: float | None, fixed_high: float | None) -> Range:
    """The ends of the axis for values from `low` to `high`, with a margin where an end is not fixed.

    Total: for all doubles but NaN the ends are finite and far enough apart for ticks that differ. The
    same as `axisRange` in `static/js/trend/plot.js`.
    """
    low = _drawable(low if fixed_low is None else fixed_low)
    high = _drawable(high if fixed_high is None else fixed_high)
    largest = max(abs(low), abs(high))
    if high - low < max(largest * NARROWEST, LEAST_WIDTH):
        margin = largest * MARGIN if largest * MARGIN >= LEAST_WIDTH else 1.0
        if fixed_low is not None:
            high = low + margin
        elif fixed_high is not None:
            low = high - margin
        else:
            low, high = high - margin, high + margin
    margin = (high - low) * MARGIN
    return (
        low if fixed_low is not None else low - margin,
        high if fixed_high is not None else high + margin,
    )


def _drawable(value: float) -> float:
    """The nearest value that an axis can have: sums and differences of such values are finite."""
    return min(max(value, -LARGEST), LARGEST)


def value_ticks(low: float, high: float, most: int = VALUE_TICKS) -> Iterator[tuple[float, str]]:
    """(value, text) of the lines of the grid, for the ends of an axis."""
    least = (high - low) / most
    power = 10.0 ** math.floor(math.log10(least))
    factor = next((f for f in (1, 2, 2.5, 5) if power * f >= least * 0.999), 10)
    step = power * factor
    digits = max(0, -math.floor(math.log10(step) + 1e-9) + (factor == 2.5))
    fixed_point = max(abs(low), abs(high)) < 1e6 and digits <= MOST_DIGITS
    for count in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1):
        value = count * step
        text = f"{value:.{digits}f}" if fixed_point else f"{value:.4g}"
        yield value, text.replace("-", "\N{MINUS SIGN}")


def time_ticks(begin: float, end: float) -> Iterator[Tick]:
    """The lines of the grid at whole times of day, all by the server's time zone at the end."""
    zone, offset = time.localtime(end).tm_gmtoff, shown_offset(begin, end)
    step = next((s for s in STEPS if s >= (end - begin) / TIME_TICKS), STEPS[-1])
    number = math.ceil((begin + zone) / step)
    while (at := number * step - zone) <= end:
        yield Tick(round((at - begin) / (end - begin) * 100, 2), _time_text(at + zone, step, offset))
        number += 1


def shown_offset(begin: float, end: float) -> str:
    """The offset from UTC at the end, if the clock was changed since the beginning: times of day have
    it then, as the clock did not show all of them, or some twice; else ""."""
    zones = {time.localtime(at).tm_gmtoff for at in (begin, end)}
    return offset_text(end).replace("-", MINUS) if len(zones) > 1 else ""


def _time_text(local: float, step: int, offset: str) -> str:
    form = "%H:%M:%S" if step < 60 else "%H:%M" if step < DAY else "%m-%d"
    shown = time.strftime(form, time.gmtime(local))
    return f"{shown} {offset}".rstrip() if step < DAY else shown


def _line(columns: Sequence[Column], begin: float, end: float, width: float, place: Place) -> PlotLine:
    """A path through the lowest and highest value of each column, so that no peak is lost."""
    parts: list[str] = []
    last = 0.0
    x = y = None
    for column in columns:
        at = ((column.number + 0.5) * width - begin) / (end - begin)
        x = round(min(at, 1.0) * SIZE, 1)
        values = (
            [column.low, column.high]
            if abs(last - column.low) <= abs(last - column.high)
            else [column.high, column.low]
        )
        if column.low == column.high:
            values = [column.low]
        elif values[-1] != column.last:
            values.append(column.last)
        points = [f"{x:g} {place(value) * SIZE / 100:g}" for value in values]
        parts.append(f"M{points[0]}h0" if column.gap or not parts else f"L{points[0]}")
        parts += [f"L{point}" for point in points[1:]]
        last = y = column.last
    return PlotLine(
        "".join(parts), None if x is None else x / SIZE * 100, 0.0 if y is None else place(y)
    )


# The newest values of a trend's pens: pure, from (widget, robot, time).


def trend(widget: Trend, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` and `note`, those of the pens that are not live; `text0`, `state0` and so on
    of each pen, where a value beyond its limits is "low" or "high"; `fault` of the disk. And when they
    change."""
    shown: dict[str, Any] = {}
    state, until = "live", math.inf
    notes: list[TextLike] = []
    for number, (pen, readout_widget) in enumerate(zip(widget.pens, widget.readouts, strict=True)):
        field = field_state(readout_widget, robot, now)
        until = min(until, field.until)
        if is_not_finite(field.value) and field.state == "live":
            notes.append(say("trend_pen", label=pen.label, note=field.note))
        elif field.state != "live":
            state = field.state if state == "live" else state
            notes.append(say("trend_pen", label=pen.label, note=field.note))
        shown[f"text{number}"] = readout(readout_widget, robot, now)[0]["text"]
        shown[f"state{number}"] = _state(pen, field)
    note = joined(dict.fromkeys(notes))
    fault = robot.history.fault if widget.disk else ""
    return {"state": state, "note": note, "fault": fault, **shown}, until


def _state(pen: Pen, field: FieldState) -> str:
    if field.state != "live" or not isinstance(field.value, int | float):
        return field.state
    if is_not_finite(field.value):
        return "unreadable"
    value = shown_number(pen, field.value)
    if pen.low is not None and value < pen.low:
        return "low"
    return "high" if pen.high is not None and value > pen.high else "live"
