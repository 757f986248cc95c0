"""The attributes of a trend and its plot, without a browser."""

import itertools
import math
import sys
from collections.abc import Callable
from datetime import datetime
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.history.trends import TrendRecorder
from app.cell.robot.history import Column
from app.cell.robot.state import RobotState
from app.cell.view.kinds import attributes_of
from app.cell.view.trend import COLUMNS, axis_range, draw, plot, scaled_columns, time_ticks, value_ticks
from app.panel.widgets.trend import Pen, Trend
from app.system.texts import render
from tests.support.builders import INTERFACES, NOW, Table, panel_of, robot_there, says

FLOAT: Final = "std_msgs/msg/Float64"
PENS: Final[list[Table]] = [
    {"topic": "/inlet", "type": FLOAT, "label": "Inlet", "unit": "bar", "low": 5.0, "high": 6.5},
    {"topic": "/gripper", "type": FLOAT, "label": "Gripper", "format": ".1f", "scale": 10.0},
]
TREND: Final[Table] = {"id": "course", "kind": "trend", "label": "Course", "pen": PENS}


def cell(**more: Any) -> tuple[Trend, RobotState]:
    panel = panel_of({**TREND, **more})
    robot = robot_there(panel)
    TrendRecorder(panel, INTERFACES, robot)
    (widget,) = panel.displays
    assert isinstance(widget, Trend)
    return widget, robot


def test_the_newest_values_are_shown_and_those_beyond_a_limit_marked() -> None:
    widget, robot = cell()
    says(robot, "/inlet", 4.9, FLOAT)
    says(robot, "/gripper", 0.46, FLOAT)
    shown, until = attributes_of(widget, robot, NOW)
    assert [render(shown[name]) for name in ("text0", "text1")] == ["4.9 bar", "4.6"]
    assert (shown["state"], shown["state0"], shown["state1"]) == ("live", "low", "live")
    assert until == NOW + 5.0
    says(robot, "/inlet", 6.6, FLOAT)
    assert attributes_of(widget, robot, NOW)[0]["state0"] == "high"


def test_each_pen_that_is_not_live_is_named() -> None:
    widget, robot = cell()
    says(robot, "/inlet", 6.0, FLOAT)
    shown, _ = attributes_of(widget, robot, NOW)
    assert (shown["state"], shown["state0"], shown["state1"]) == ("waiting", "live", "waiting")
    assert str(shown["note"]) == "Gripper: waiting for data"
    shown, until = attributes_of(widget, robot, NOW + 7)
    assert str(shown["note"]) == "Inlet: 7 s old Gripper: waiting for data"
    assert (shown["state0"], until) == ("old", NOW + 8)


def test_a_pen_that_is_not_a_number_says_so() -> None:
    widget, robot = cell()
    says(robot, "/inlet", math.nan, FLOAT)
    says(robot, "/gripper", 0.46, FLOAT)
    shown, _ = attributes_of(widget, robot, NOW)
    assert (shown["state"], shown["state0"], shown["state1"]) == ("live", "unreadable", "live")
    assert str(shown["note"]) == "Inlet: the value is not a number (NaN)"


def test_a_lost_bridge_makes_values_old() -> None:
    widget, robot = cell()
    says(robot, "/inlet", 6.0, FLOAT)
    robot.mark_link_lost()
    assert attributes_of(widget, robot, NOW)[0]["state0"] == "old"


def test_a_fault_of_the_disk_is_shown_where_the_disk_is_used() -> None:
    for disk in (True, False):
        widget, robot = cell(disk=disk)
        robot.history.fault = "full"
        assert attributes_of(widget, robot, NOW)[0]["fault"] == ("full" if disk else "")


def columns(*items: tuple[int, float, float, float] | None) -> list[Column]:
    made, gap = [], True
    for item in items:
        if item is not None:
            made.append(Column(*item, gap=gap))
        gap = item is None
    return made


def test_a_line_goes_through_both_ends_of_each_column_and_over_no_gap() -> None:
    widget, _ = cell(min=0.0, max=10.0, window="240s")
    pen = columns((0, 1.0, 1.0, 1.0), (1, 2.0, 9.0, 3.0), None, (3, 8.0, 9.0, 8.0))
    drawn = draw(widget, [pen, []], 0.0, 240.0)
    assert drawn.lines[0].path == "M2.1 900h0L6.2 800L6.2 100L6.2 700M14.6 200h0L14.6 100L14.6 200"
    assert drawn.lines[0].x == pytest.approx(1.46)
    assert drawn.lines[0].y == 20.0
    assert drawn.lines[1].x is None
    assert drawn.lines[1].path == ""


def test_a_charge_above_one_in_percent_is_a_gap() -> None:
    keys = {"topic": "/battery", "type": "sensor_msgs/msg/BatteryState", "field": "percentage"}
    pen = Pen.model_validate({**keys, "label": "Charge", "scale": 100, "unit": "%"})
    sent = [Column(number, value, value, value, False) for number, value in enumerate((0.5, 87.0, 0.6))]
    shown = [(column.number, column.last, column.gap) for column in scaled_columns(sent, pen)]
    assert shown == [(0, 50.0, False), (2, 60.0, True)]


def test_the_axis_holds_all_values_and_limits() -> None:
    widget, _ = cell()
    drawn = draw(widget, [columns((0, 4.0, 7.0, 5.0)), []], 0.0, 600.0)
    assert [render(limit.text, "en") for limit in drawn.limits] == ["H 6.5", "L 5"]
    assert all(0 < limit.place < 100 for limit in drawn.limits)
    assert all(0 <= tick.place <= 100 for tick in (*drawn.values, *drawn.times))


@pytest.mark.parametrize(
    ("low", "high", "texts"),
    [
        (3.85, 7.15, ["4", "5", "6", "7"]),
        (0.0, 1.0, ["0.00", "0.25", "0.50", "0.75", "1.00"]),
        (-20.0, 20.0, ["−20", "−10", "0", "10", "20"]),
        (0.0, 4e9, ["0", "1e+09", "2e+09", "3e+09", "4e+09"]),
    ],
)
def test_lines_of_the_grid_are_at_round_values(low: float, high: float, texts: list[str]) -> None:
    assert [text for _, text in value_ticks(low, high)] == texts


def test_numbers_of_the_plot_are_in_the_language_of_their_reader() -> None:
    widget, _ = cell(min=-1.0, max=0.0)
    drawn = draw(widget, [columns((0, -0.5, -0.5, -0.5)), []], 0.0, 600.0)
    assert [render(tick.text, "de") for tick in drawn.values][:2] == ["−1,00", "−0,75"]
    assert render(drawn.limits[0].text, "de") == "H 6,5"


@pytest.mark.parametrize("value", [0.0, 5.0, -3e-7, 1e12])
@pytest.mark.parametrize("fixed", [{}, {"min": 4.0}, {"max": 4.0}])
def test_a_value_that_does_not_change_is_drawn(value: float, fixed: Table) -> None:
    widget, _ = cell(pen=[PENS[1]], **fixed)
    drawn = draw(widget, [columns((0, value, value, value), (1, value, value, value))], 0.0, 600.0)
    assert drawn.values
    assert math.isfinite(drawn.lines[0].y)


DOUBLES: Final = st.floats(allow_nan=False) | st.sampled_from(
    [0.0, 5e-324, -5e-324, 2.3e-308, 1.7e308, -1.7e308, sys.float_info.max, math.inf, -math.inf]
)
ENDS: Final = st.none() | st.floats(-(2.0**53), 2.0**53)


@given(a=DOUBLES, b=DOUBLES, neighbour=st.booleans(), fixed_low=ENDS, fixed_high=ENDS)
def test_an_axis_is_drawn_for_all_doubles(
    a: float, b: float, neighbour: bool, fixed_low: float | None, fixed_high: float | None
) -> None:
    low, high = sorted((a, math.nextafter(a, math.inf) if neighbour else b))
    low, high = axis_range(low, high, fixed_low, fixed_high)
    assert -math.inf < low < high < math.inf
    assert math.isfinite(high - low)
    ticks = list(itertools.islice(value_ticks(low, high), 12))
    assert 2 <= len(ticks) <= 10
    assert all(math.isfinite(value) and len(text) < 25 for value, text in ticks)
    assert [value for value, _ in ticks] == sorted({value for value, _ in ticks})


@given(
    values=st.lists(DOUBLES.filter(math.isfinite), min_size=1, max_size=4),
    scale=DOUBLES.filter(math.isfinite),
)
def test_every_finite_value_is_drawn(values: list[float], scale: float) -> None:
    widget, robot = cell(pen=[{**PENS[1], "scale": scale}])
    history = robot.history
    for second, value in enumerate(values):
        history.fields["gripper", "data"].add(history.start + second, value)
    drawn = plot(widget, robot, 10 - history.time(0.0) + history.start, history.start + 10)
    assert "inf" not in drawn.lines[0].path
    assert "nan" not in drawn.lines[0].path
    assert math.isfinite(drawn.lines[0].y)
    assert drawn.values


@pytest.mark.usefixtures("utc")
@pytest.mark.parametrize(
    ("span", "texts"),
    [
        (60, ["10:05:00", "10:05:15", "10:05:30", "10:05:45", "10:06:00"]),
        (600, ["09:56", "09:58", "10:00", "10:02", "10:04", "10:06"]),
        (86_400, ["12:00", "18:00", "00:00", "06:00"]),
        (31 * 86_400, ["12-25", "01-01", "01-08", "01-15", "01-22"]),
    ],
)
def test_lines_of_the_grid_are_at_round_times(span: int, texts: list[str]) -> None:
    end = 1_769_162_760.0  # 2026-01-23 10:06 UTC
    ticks = list(time_ticks(end - span, end))
    assert [tick.text for tick in ticks] == texts


@pytest.mark.parametrize(
    ("end", "texts"),
    [
        ("2026-10-25T01:50", ["01:30 +01:00", "02:00 +01:00", "02:30 +01:00"]),
        ("2026-10-25T03:50", ["03:30", "04:00", "04:30"]),
        ("2026-03-29T01:50", ["02:30 +02:00", "03:00 +02:00", "03:30 +02:00"]),
    ],
)
def test_times_have_their_offset_where_the_clock_was_changed_within_the_plot(
    time_zone: Callable[[str], None], end: str, texts: list[str]
) -> None:
    time_zone("Europe/Berlin")
    until = datetime.fromisoformat(f"{end}Z").timestamp()
    assert [tick.text for tick in time_ticks(until - 5400, until)] == texts


def test_the_plot_of_a_page_has_the_window_until_now() -> None:
    widget, robot = cell()
    history = robot.history
    start = history.start
    for second in range(700):
        history.fields["gripper", "data"].add(start + second, second / 10.0)
    shown = plot(widget, robot, start + 700 - history.time(0.0), start + 700)
    assert len(shown.lines[1].path.split("L")) >= COLUMNS
    assert shown.lines[1].x == pytest.approx(100.0, abs=0.5)
    assert shown.lines[0].path == ""


def test_pens_on_the_right_have_an_axis_of_their_own() -> None:
    left, right = {"topic": "/load", "type": FLOAT, "label": "Load"}, {**PENS[0], "axis": "right"}
    widget, _ = cell(pen=[left, right], min=0.0, max=100.0, right_min=4.0, right_max=8.0)
    drawn = draw(widget, [columns((0, 25.0, 25.0, 25.0)), columns((0, 7.0, 7.0, 7.0))], 0.0, 600.0)
    assert [line.y for line in drawn.lines] == [75.0, 25.0]
    assert [render(tick.text) for tick in drawn.values] == ["0", "25", "50", "75", "100"]
    assert [render(tick.text) for tick in drawn.right_values] == ["4", "5", "6", "7", "8"]
    assert [(limit.pen, limit.place) for limit in drawn.limits] == [(1, 37.5), (1, 75.0)]
    alone, _ = cell()
    assert draw(alone, [columns((0, 5.0, 5.0, 5.0)), []], 0.0, 600.0).right_values == []


@pytest.mark.parametrize(
    ("keys", "place"),
    [
        ({"right_min": 1.0}, "right_min"),
        ({"pen": [{**PENS[0], "axis": "right"}]}, "pen[0].axis"),
        (
            {"pen": [PENS[0], {**PENS[1], "axis": "right"}], "right_min": 2.0, "right_max": 1.0},
            "right_min",
        ),
    ],
)
def test_an_axis_that_does_not_fit_is_a_fault(keys: Table, place: str) -> None:
    widget = Trend.model_validate({**TREND, **keys})
    assert [fault.place for fault in widget._axis_faults("w")] == [f"w.{place}"]
