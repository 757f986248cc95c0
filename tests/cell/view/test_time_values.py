"""Stamps, ages and durations are readable, in the reader's language, whatever the robot sends."""

import math
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as some

from app.cell.robot.state import Sample
from app.cell.view.times import EARLIEST, LATEST, time_text
from app.cell.view.view import build_view
from app.panel.times import TIME_FORMATS
from app.system.texts import render
from tests.support.builders import BRIDGE, HEARD, INTERFACES, NOW, panel_of, robot_there
from tests.support.words import english

WALL: Final = 1_795_630_000.0  # 2026-11-25 in every time zone
LANGUAGES: Final = ("en", "ja", "de")
STAMPED: Final = "std_msgs/msg/Header"


def shown(type_name: str, fields: Any, now: float = NOW, **more: Any) -> tuple[str, float]:
    """The text of a readout, and when it changes."""
    panel = panel_of({**HEARD, "type": type_name, **more})
    robot = robot_there(panel)
    payload = INTERFACES.encode(type_name, fields)
    robot.update("heard", Sample(payload, 1, NOW, WALL, BRIDGE))
    built = build_view(panel, robot, now)
    return english(built.view["widgets"]["heard"])["text"], built.displays["heard"]


def stamp(seconds: float) -> dict[str, Any]:
    return {"stamp": {"sec": int(seconds), "nanosec": round(seconds % 1 * 1e9)}, "frame_id": ""}


def test_a_time_is_a_date_and_a_time_of_day_without_a_format() -> None:
    text, until = shown(STAMPED, stamp(WALL + 0.5), field="stamp")
    assert text.startswith("2026-11-2")
    assert len(text) == len("2026-11-25 18:06:40")
    assert until == math.inf


@pytest.mark.parametrize(
    ("ago", "text", "until"),
    [
        (0.25, "0 s", 0.75),
        (7.5, "7 s", 0.5),
        (90, "1 min", 30),
        (7200, "2 h", 60),
        (3 * 86_400, "3 d", 60),
        (-0.5, "0 s", 0.5),
        (-30, "in 30 s", 1),
        (-7200, "in 2 h", 60),
    ],
)
def test_an_age_counts_on(ago: float, text: str, until: float) -> None:
    attributes = shown(STAMPED, stamp(WALL - ago), field="stamp", format="age")
    assert attributes == (text, NOW + until)


def test_an_age_counts_from_the_clock_at_the_last_message() -> None:
    assert shown(STAMPED, stamp(WALL - 5), NOW + 10, field="stamp", format="age")[0] == "15 s"


@pytest.mark.parametrize(
    ("data", "more", "text"),
    [
        (90.0, {"format": "duration"}, "1 min 30 s"),
        (12.345, {"format": "duration"}, "12.3 s"),
        (-3700.0, {"format": "duration"}, "−1 h 01 min"),
        (400_000.0, {"format": "duration"}, "4 d 15 h"),
        (0.0, {"format": "duration"}, "0 s"),
        (1e300, {"format": "duration"}, "1e+300 s"),
        (math.nan, {"format": "duration"}, "NaN s"),
        (0.0, {"format": "time"}, "no time set"),
        (0.0, {"format": "age"}, "no time set"),
        (1e18, {"format": "time"}, "outside the years 1000 to 9999"),
        (-1e18, {"format": "age"}, "outside the years 1000 to 9999"),
        (math.nan, {"format": "time"}, "outside the years 1000 to 9999"),
        (WALL * 1e9 - 3e9, {"format": "age", "scale": 1e-9}, "3 s"),
    ],
)
def test_number_is_shown_as_seconds(data: float, more: Any, text: str) -> None:
    assert shown("std_msgs/msg/Float64", {"data": data}, **more)[0] == text


def test_a_duration_is_shown_as_one() -> None:
    marker = {"lifetime": {"sec": 75, "nanosec": 500_000_000}}
    text = shown("visualization_msgs/msg/Marker", marker, field="lifetime")[0]
    assert text == "1 min 15 s"


def test_a_column_has_times_too() -> None:
    table = {
        "id": "parts", "kind": "table", "label": "Parts", "topic": "/goals",
        "type": "action_msgs/msg/GoalStatusArray", "field": "status_list", "rows_shown": 2,
        "column": [
            {"label": "Since", "field": "goal_info.stamp", "format": "age"},
            {"label": "At", "field": "goal_info.stamp"},
        ],
    }  # fmt: skip
    panel = panel_of(table)
    robot = robot_there(panel)
    goals = [{"goal_info": stamp_of(WALL - 5)}, {"goal_info": stamp_of(0)}]
    payload = INTERFACES.encode("action_msgs/msg/GoalStatusArray", {"status_list": goals})
    sample = Sample(payload, 1, NOW, WALL, BRIDGE)
    robot.update("goals", sample)
    robot.table_entries.record_sample("goals", sample)
    built = build_view(panel, robot, NOW + 0.5)
    first, unset = english(built.view["widgets"]["parts"])["table_rows"]
    assert first["cells"][0]["text"] == "5 s"
    assert first["cells"][1]["text"].startswith("2026-11-2")
    assert [cell["text"] for cell in unset["cells"]] == ["no time set"] * 2
    assert built.displays["parts"] == NOW + 1


def stamp_of(seconds: float) -> dict[str, Any]:
    return {"stamp": stamp(seconds)["stamp"]}


@given(some.floats(), some.sampled_from(TIME_FORMATS), some.floats(0, 4e9))
def test_every_number_has_a_text_in_every_language(seconds: float, style: str, wall: float) -> None:
    text, until = time_text(style, seconds, wall)
    assert until > 0
    for language in LANGUAGES:
        assert 0 < len(render(text, language)) < 60


@given(some.integers(-(2**31), 2**31 - 1), some.integers(0, 2**32 - 1), some.sampled_from(TIME_FORMATS))
def test_every_stamp_has_a_text(sec: int, nanosec: int, style: str) -> None:
    fields = {"stamp": {"sec": sec, "nanosec": nanosec}, "frame_id": ""}
    assert shown(STAMPED, fields, field="stamp", format=style)[0]


def test_first_and_last_possible_times_are_dates() -> None:
    for at, year in ((EARLIEST, "1000"), (LATEST, "9999")):
        assert render(time_text("time", at, WALL)[0], "de").split()[0].endswith(year)
    for beyond in (EARLIEST - 1, LATEST + 1):
        assert render(time_text("time", beyond, WALL)[0]) == "outside the years 1000 to 9999"
