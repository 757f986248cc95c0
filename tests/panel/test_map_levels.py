"""The levels of a map in a panel file: each mistake is named at its place."""

from pathlib import Path
from typing import Any, Final

import pytest

from app.panel.file.load import faults_of_text
from tests.panel.test_map_places import CORNERS, PIT, faults

pytestmark = pytest.mark.promise("panel file")

GROUND: Final = {"id": "ground", "label": "Ground", "topic": "/ground/map"}
UPPER: Final = {"id": "upper", "label": "Upper", "topic": "/upper/map"}
STRING: Final = {"topic": "/level", "type": "std_msgs/msg/String"}
NUMBER: Final = {"topic": "/level", "type": "std_msgs/msg/Int32"}
BUILDING: Final[dict[str, Any]] = {"id": "hall", "kind": "map", "label": "Hall"}
GOAL: Final[dict[str, Any]] = {"id": "goal", "kind": "place", "label": "Goal", "map": "hall"}
DOCK: Final = {"id": "dock", "label": "Dock", "x": 1.0, "y": 2.0}
AT: Final = "page[0].widget[0]"


def map_with(*levels: dict[str, Any], **keys: Any) -> dict[str, Any]:
    return BUILDING | {"level": list(levels)} | keys


@pytest.mark.parametrize(
    ("view", "place", "words"),
    [
        (map_with(GROUND, UPPER, topic="/map"), "topic", "each level has its topic"),
        (map_with(GROUND, UPPER | {"id": "ground"}), "level[1].id", "level[0]"),
        (map_with(GROUND, UPPER | {"label": "Ground"}), "level[1].label", "level[0]"),
        (map_with(GROUND, UPPER | {"topic": "/ground/map"}), "level[1].topic", "level[0]"),
        (map_with(GROUND | {"value": "L0"}), "level[0].value", "robot_level"),
        (BUILDING | {"robot_level": STRING}, "robot_level", "is for a map with levels"),
        (map_with(GROUND, robot_level=STRING | {"field": "text"}), "robot_level.field", "text"),
        (map_with(GROUND, robot_level=NUMBER), "level[0].value", "must be a whole number"),
        (
            map_with(GROUND | {"value": "a"}, UPPER | {"value": "a"}, robot_level=STRING),
            "level[1].value",
            "earlier level",
        ),
        (
            map_with(GROUND, plan={"src": "palletizing-cell.svg", "resolution": 1.0}),
            "plan.level",
            "is missing: the map has the levels ground",
        ),
        (
            map_with(GROUND, plan={"src": "palletizing-cell.svg", "resolution": 1.0, "level": "roof"}),
            "plan.level",
            'no level "roof"',
        ),
        (
            BUILDING | {"plan": {"src": "palletizing-cell.svg", "resolution": 1.0, "level": "roof"}},
            "plan.level",
            "it has none",
        ),
    ],
)
def test_a_mistake_in_levels_is_named(
    tmp_path: Path, view: dict[str, Any], place: str, words: str
) -> None:
    messages = faults(tmp_path, view)
    assert [*messages] == [f"{AT}.{place}"]
    assert words in messages[f"{AT}.{place}"]


def test_levels_with_numbers_and_names_have_no_fault(tmp_path: Path) -> None:
    numbered = (GROUND | {"value": 0}, UPPER | {"value": 1})
    assert faults(tmp_path, map_with(*numbered, robot_level=NUMBER)) == {}
    assert faults(tmp_path, map_with(GROUND, UPPER, robot_level=STRING)) == {}
    assert faults(tmp_path, map_with(GROUND, UPPER)) == {}


@pytest.mark.parametrize(
    ("tables", "place", "words"),
    [
        ({"place": [DOCK]}, "place[0].level", "is missing: the map has the levels ground, upper"),
        ({"place": [DOCK | {"level": "roof"}]}, "place[0].level", 'no level "roof"'),
        ({"place": [DOCK | {"level": "upper"}]}, "", ""),
        ({"place": [DOCK | {"map_version": "0123456789abcdef"}]}, "", ""),
        (
            {"zone": [PIT | {"points": CORNERS, "level": "roof"}]},
            "zone[0].level",
            'no level "roof"',
        ),
        ({"zone": [PIT | {"points": CORNERS}]}, "", ""),
    ],
)
def test_places_and_zones_name_a_level_of_the_map(
    tmp_path: Path, tables: dict[str, Any], place: str, words: str
) -> None:
    offered = GOAL | {"touch": True}
    messages = faults(tmp_path, map_with(GROUND, UPPER), offered, _go(), **tables)
    assert [*messages] == ([place] if place else [])
    assert words in messages.get(place, "")


def test_an_input_offers_places_of_its_maps_levels(tmp_path: Path) -> None:
    other = BUILDING | {"id": "yard"}
    offered = GOAL | {"map": "yard", "places": ["dock"]}
    places = [DOCK | {"level": "upper"}]
    messages = faults(tmp_path, map_with(GROUND, UPPER), other, offered, _go(), place=places)
    assert messages["page[0].widget[2].places[0]"] == (
        '"dock" is on the level upper, and the map yard has none of it'
    )


def _go() -> dict[str, Any]:
    keys = {"id": "go", "kind": "publish", "label": "Go", "topic": "/goal_pose"}
    message = {"header": {"frame_id": "{goal.frame}"}, "pose": "{goal.pose}"}
    return {**keys, "type": "geometry_msgs/msg/PoseStamped", "message": message}


LEVEL_KEYS: Final = """topic = "/level"
type = "std_msgs/msg/String"
field = "data"
"""
MAP_KEYS: Final = """title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "building"
kind = "map"
label = "Building"
"""
LEVEL_TABLES: Final = """[[page.widget.level]]
id = "ground"
label = "Ground"
topic = "/ground/map"
[[page.widget.level]]
id = "upper"
label = "Upper"
topic = "/upper/map"
"""
PLAN_KEYS: Final = """[page.widget.plan]
src = "plan.svg"
resolution = 0.1
level = "upper"
"""


@pytest.mark.parametrize(
    ("text", "first"),
    [
        (MAP_KEYS + LEVEL_KEYS + LEVEL_TABLES, "topic"),
        (MAP_KEYS + LEVEL_TABLES + PLAN_KEYS + LEVEL_KEYS, "plan.topic"),
        (
            MAP_KEYS + LEVEL_TABLES + LEVEL_KEYS.partition("\n")[2] + "max_age_s = 2.0\n",
            "level[1].type",
        ),
    ],
)
def test_a_missing_header_of_the_robots_level_is_one_fault_that_names_it(text: str, first: str) -> None:
    (fault,) = faults_of_text(text, folder=Path())
    assert fault.place == f"page[0].widget[0].{first}"
    assert "are keys of page.widget.robot_level: is its header missing above?" in str(fault)
