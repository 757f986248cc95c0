"""The curve of a value around the raise of its alarm, as an SVG has it."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from app.alarms.instance import AlarmInstance
from app.alarms.rows import DIGITS
from app.clock import format_time
from app.i18n import TextLike, number
from app.i18n.locales import MINUS
from app.i18n.values import together
from app.panel.alarm import Alarm
from app.panel.number_range import decimal_text
from app.panel.widgets.numbers import Unit
from app.panel.widgets.trend import Pen, Trend
from app.robot.history import Column
from app.runtime.alarm_curves import AFTER_S, BEFORE_S, COLUMNS, WIDTH_S, Curve
from app.view.trend_plot import Plot, draw, scaled_columns


class ShownCurve(NamedTuple):
    """`raise_at` is where the raise stands, in percent of the width; `times` are the texts at the left
    end, at the raise and at the right end. `value` is that at the raise, "" if it was not known."""

    plot: Plot
    raise_at: float
    times: tuple[TextLike, TextLike, TextLike]
    value: TextLike


def shown_curve(alarm: AlarmInstance, curve: Curve) -> ShownCurve:
    """What the details of an alarm show of its curve."""
    described = alarm.definition.alarm
    trend = _trend(described)
    columns = scaled_columns(curve.columns, trend.pens[0])
    begin, end = curve.raised_at - BEFORE_S, curve.raised_at + AFTER_S
    return ShownCurve(
        draw(trend, [columns], begin, end, COLUMNS),
        round(100 * BEFORE_S / (BEFORE_S + AFTER_S), 2),
        (
            number(f"{MINUS}{BEFORE_S:g}", "s"),
            format_time(curve.raised_at),
            together(("+", number(f"{AFTER_S:g}", "s"))),
        ),
        _value_at(columns, curve.raised_at, described.unit),
    )


def _trend(alarm: Alarm) -> Trend:
    """The trend whose one pen has the alarm's value and its limits nearest to what is normal."""
    low = alarm.low_low if alarm.low is None else alarm.low
    high = alarm.high_high if alarm.high is None else alarm.high
    pen = Pen.model_construct(None, unit=alarm.unit, scale=alarm.scale, low=low, high=high)
    return Trend.model_construct(None, pens=(pen,))


def _value_at(columns: Sequence[Column], at: float, unit: Unit) -> TextLike:
    """The last value that was there at a time."""
    before = [column for column in columns if column.number <= math.floor(at / WIDTH_S)]
    if not before:
        return ""
    return number(decimal_text(float(f"{before[-1].last:.{DIGITS}g}")), unit)
