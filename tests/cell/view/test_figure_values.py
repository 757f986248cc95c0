"""What a figure shows: its number, its target and how far it is."""

import math
from typing import Any, Final

import pytest

from app.cell.view.view import build_view
from app.system.texts import render
from tests.support.builders import NOW, panel_of, robot_there, says
from tests.support.words import english

COUNT: Final = "std_msgs/msg/UInt32"
FLOAT: Final = "std_msgs/msg/Float64"
FIGURE: Final = {
    "id": "boxes",
    "kind": "figure",
    "label": "Boxes",
    "topic": "/boxes",
    "type": COUNT,
    "format": "d",
    "unit": "boxes",
    "target": 144,
    "segments": 6,
    "max_age_s": 5.0,
}
LEFT: Final = {
    "text": {"en": "{value} min left", "de": "noch {value} min"},
    "topic": "/left",
    "type": FLOAT,
    "format": ".1f",
}
PLANNED: Final = {"topic": "/planned", "type": FLOAT}


def shown(value: float | None, *, now: float = NOW, heard: Any = (), **more: Any) -> Any:
    panel = panel_of({**FIGURE, **more})
    robot = robot_there(panel)
    if value is not None:
        says(robot, "/boxes", value, more.get("type", COUNT))
    for topic, number in heard:
        says(robot, topic, number, FLOAT)
    return build_view(panel, robot, now).view["widgets"]["boxes"]


@pytest.mark.parametrize(("value", "part"), [(0, 0.0), (36, 25.0), (144, 100.0), (150, 100.0)])
def test_the_bar_says_how_far_it_is(value: int, part: float) -> None:
    view = english(shown(value))
    assert (view["state"], view["text"], view["rest"]) == ("live", str(value), "/ 144 boxes")
    assert view["part"] == part


def test_without_a_target_the_unit_follows_the_number() -> None:
    view = english(shown(87, target=None))
    assert (view["text"], view["rest"], view["part"]) == ("87", "boxes", None)


@pytest.mark.parametrize(
    ("value", "now", "state", "text", "part"),
    [(None, NOW, "waiting", "—", None), (72, NOW + 6, "old", "72", 50.0)],
)
def test_what_is_not_known_now_is_marked(
    value: int | None, now: float, state: str, text: str, part: float | None
) -> None:
    view = english(shown(value, now=now))
    assert (view["state"], view["text"], view["part"]) == (state, text, part)
    assert view["note"]


@pytest.mark.parametrize(
    ("heard", "rest", "part"),
    [
        ([("/planned", 200.0)], "/ 200 boxes", 25.0),
        ([], "/ — boxes", None),
        ([("/planned", math.nan)], "/ — boxes", None),
        ([("/planned", 0.0)], "/ 0 boxes", None),
    ],
)
def test_a_target_of_a_topic_that_is_not_known_has_no_bar(
    heard: Any, rest: str, part: float | None
) -> None:
    view = english(shown(50, target=PLANNED, heard=heard))
    assert (view["rest"], view["part"]) == (rest, part)


def test_a_line_is_in_the_readers_language_and_shows_a_dash_for_what_is_not_known() -> None:
    line = shown(50, line=[LEFT], heard=[("/left", 1.26)])["line0"]
    assert (render(line, "en"), render(line, "de")) == ("1.3 min left", "noch 1,3 min")
    for heard in ((), [("/left", math.nan)]):
        unknown = shown(50, line=[LEFT], heard=heard)
        assert (render(unknown["line0"], "en"), unknown["line1"]) == ("— min left", "")
