"""The curves of a story: the values that its interlocks, conditions and alarms are about, around its
zero, as far as a trend of the panel or an alarm with limits keeps them."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from app.cell.alarms.shown import value_text
from app.cell.robot.history import Column
from app.cell.robot.state import RobotState
from app.cell.stops.sources import PanelNames
from app.cell.stops.story import Event, Source, Story
from app.cell.view.trend import draw, scaled_columns
from app.panel.widgets.trend import Pen, Trend, trends_of
from app.system.texts import TextLike, number
from app.system.texts.locales import MINUS
from app.system.texts.text import together
from app.web.pages.alarms import trend_of

MOST_CURVES: Final = 3
BEFORE_S: Final = 10.0  # the zero of a story
AFTER_S: Final = 5.0
COLUMNS: Final = 150
FEWEST: Final = 3  # columns of a curve: fewer show no course
NAMING: Final = ("interlock", "condition", "alarm")  # events that name values


class StoryCurve(NamedTuple):
    """`path` is that of an SVG of 1000 units a side, `limits` are at percents of its height; `value` is
    that at the zero, "" if it was not known."""

    label: TextLike
    unit: TextLike
    path: str
    limits: tuple[float, ...]
    value: TextLike


class StoryCurves(NamedTuple):
    """Curves with one axis of time: `zero_at` and `ticks`, those of the story's lines, are in percent
    of its width; `times` are the texts at its ends."""

    curves: tuple[StoryCurve, ...]
    zero_at: float
    ticks: tuple[float, ...]
    times: tuple[TextLike, TextLike]


def story_curves(
    story: Story, names: PanelNames, robot: RobotState, monotonic: float, wall: float
) -> StoryCurves | None:
    """The curves of a story at this moment; None without one. At most `MOST_CURVES`, those of the first
    cause first."""
    robot.history.set_clock(monotonic, wall)
    curves: list[StoryCurve] = []
    for value, pen in _pens(story, names).items():
        if len(curves) < MOST_CURVES and (curve := _curve(story, value, pen, robot, wall)):
            curves.append(curve)
    if not curves:
        return None
    lines = (line.offset_s for line in story.short())
    ticks = (_percent(offset) for offset in lines if -BEFORE_S <= offset <= AFTER_S)
    ends = together((MINUS, number(f"{BEFORE_S:g}", "s"))), together(("+", number(f"{AFTER_S:g}", "s")))
    return StoryCurves(tuple(curves), _percent(0.0), tuple(dict.fromkeys(ticks)), ends)


def _percent(offset_s: float) -> float:
    return round((offset_s + BEFORE_S) / (BEFORE_S + AFTER_S) * 100, 2)


def _pens(story: Story, names: PanelNames) -> Mapping[Source, Pen]:
    """Topic and field → how the value is shown: by the pen of a trend, or else as by the alarm. Beside
    a value the other pens of its topic."""
    drawn = {(pen.topic, pen.field): pen for trend in trends_of(names.panel) for pen in trend.pens}
    limited = {alarm.limited_value: alarm for alarm in names.panel.alarms if alarm.limited_value}
    chosen: dict[Source, Pen] = {}
    for source in _sources(story):
        if source in drawn:
            chosen.setdefault(source, drawn[source])
        elif source in limited:
            (pen,) = trend_of(limited[source]).pens
            update = {"label": limited[source].text, "format": limited[source].format}
            chosen.setdefault(source, pen.model_copy(update=update))
        for value, pen in drawn.items():
            if value[0] == source[0]:
                chosen.setdefault(value, pen)
    return chosen


def _sources(story: Story) -> Iterator[Source]:
    """The values that the story's events name, those of the first cause first."""

    def rank(event: Event) -> tuple[bool, bool, float]:
        return event is not story.first, not event.breaks, abs(event.begun - story.zero)

    named = (line.event for line in story.lines if line.event.sort in NAMING)
    for event in sorted(named, key=rank):
        yield from sorted(event.sources)


def _curve(story: Story, value: Source, pen: Pen, robot: RobotState, wall: float) -> StoryCurve | None:
    topic, field = value
    history = robot.history.fields.get((robot.key(topic), field))
    if history is None:
        return None
    begin, end = story.zero - BEFORE_S, story.zero + AFTER_S
    width = (end - begin) / COLUMNS
    kept = robot.history.columns(history, begin, min(end, wall), width)
    columns = scaled_columns(kept, pen)
    if len(columns) < FEWEST:
        return None
    trend = Trend.model_construct(None, pens=(pen,))
    plot = draw(trend, [columns], begin, end, COLUMNS)
    limits = tuple(limit.place for limit in plot.limits if 0 <= limit.place <= 100)
    shown = _value_at(columns, story.zero / width, pen)
    return StoryCurve(pen.label, pen.unit, plot.lines[0].path, limits, shown)


def _value_at(columns: Sequence[Column], at: float, pen: Pen) -> TextLike:
    """The last value at a column's number."""
    before = [column for column in columns if column.number <= at]
    return value_text(before[-1].last, "", pen.format) if before else ""
