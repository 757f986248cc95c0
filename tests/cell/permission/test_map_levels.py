"""On which level of a map the robot is, and which goals are refused for it."""

from types import SimpleNamespace as Message
from typing import Any, Final

import pytest

from app.cell.permission.goal_places import Goal, input_verdict, map_versions
from app.cell.permission.robot_pose import robot_level
from app.cell.robot.maps import GRID_TYPE, read_grid
from app.cell.robot.state import RobotState, Sample
from app.cell.view.map_robots import other_robots, robot_on_map
from app.cell.view.map_values import map_view
from app.cell.view.place_values import card_of, place_input
from app.panel.model import Panel
from tests.cell.permission.test_goal_places import code, sent, touched
from tests.panel.test_map_levels import GROUND, NUMBER, STRING, UPPER
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there
from tests.support.words import english

pytestmark = pytest.mark.promise("places")

INFO: Final = {"width": 20, "height": 20, "resolution": 0.25, "origin": {"orientation": {"w": 1.0}}}
DRIVE: Final = {
    "id": "drive",
    "kind": "publish",
    "label": "Drive",
    "topic": "/goal_pose",
    "type": "geometry_msgs/msg/PoseStamped",
    "message": {"header": {"frame_id": "{goal.frame}"}, "pose": "{goal.pose}"},
}
PLACES: Final = [
    {"id": "dock", "label": "Dock", "x": 2.0, "y": 3.0, "level": "ground"},
    {"id": "attic", "label": "Attic", "x": 2.0, "y": 3.0, "level": "upper"},
]
CORNERS: Final = [[3, 3], [4, 3], [4, 4], [3, 4]]
ZONES: Final = [
    {"id": "hole", "label": "Hole", "kind": "keep_out", "points": CORNERS, "level": "upper"},
    {"id": "bay", "label": "Bay", "kind": "label", "points": CORNERS},
]


def cell(
    robot_level: Any = STRING, frames: tuple[str, str] = ("map", "map"), **keys: Any
) -> tuple[Panel, RobotState, dict[str, str]]:
    """A panel with two levels, a robot with their maps, and the versions of these by level."""
    hall = {"id": "hall", "kind": "map", "label": "Hall", "max_age_s": 1.0, "level": [GROUND, UPPER]}
    goal = {"id": "goal", "kind": "place", "label": "Places", "map": "hall", "touch": True}
    if robot_level is not None:
        hall["robot_level"] = robot_level
    panel = panel_of(hall | keys, goal, DRIVE, place=PLACES, zone=ZONES)
    robot = robot_there(panel)
    versions = {}
    for number, (level, frame) in enumerate(zip(("ground", "upper"), frames, strict=True)):
        state = robot.maps[f"{level}/map"]
        message = {"header": {"frame_id": frame}, "info": INFO, "data": [number] * 400}
        state.grid = read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, message))
        state.wall, state.at = NOW, float("inf")  # no cut is after it
        versions[level] = state.grid.version
    return panel, robot, versions


def moved(robot: RobotState, frame: str, at: float = NOW) -> None:
    way = Message(
        translation=Message(x=1.0, y=2.0, z=0.0), rotation=Message(x=0.0, y=0.0, z=0.0, w=1.0)
    )
    stamp = Message(sec=1, nanosec=0)
    header = Message(frame_id=frame, stamp=stamp)
    each = Message(header=header, child_frame_id="base_link", transform=way)
    robot.transforms.record(Message(transforms=[each]), at, is_static=False)


def says(robot: RobotState, value: Any, source: str = BRIDGE) -> None:
    kind = "std_msgs/msg/String" if isinstance(value, str) else "std_msgs/msg/Int32"
    payload = INTERFACES.encode(kind, {"data": value})
    robot.update("level", Sample(payload, 1, NOW, NOW, source))


def level_of(panel: Panel, robot: RobotState, now: float = NOW) -> tuple[str, str]:
    """The id of the robot's level, and the code of why it is not known."""
    known = robot_level(panel.map_views["hall"], robot, now)
    return "" if known.level is None else known.level.id, code(known.note)


@pytest.mark.parametrize(
    ("keys", "value", "now", "known"),
    [
        ({}, None, NOW, ("", "map_level_waiting")),
        ({}, "ground", NOW, ("ground", "")),
        ({}, "upper", NOW + 3600.0, ("upper", "")),
        ({}, "roof", NOW, ("", "map_level_other")),
        ({}, "", NOW, ("", "map_level_other")),
        ({"robot_level": STRING | {"max_age_s": 2.0}}, "ground", NOW + 1.9, ("ground", "")),
        ({"robot_level": STRING | {"max_age_s": 2.0}}, "ground", NOW + 2.0, ("", "map_level_old")),
        (
            {
                "robot_level": NUMBER,
                "level": [GROUND | {"value": 0}, UPPER | {"value": 1}],
            },
            1,
            NOW,
            ("upper", ""),
        ),
    ],
)
def test_a_topic_says_on_which_level_the_robot_is(
    keys: dict[str, Any], value: Any, now: float, known: tuple[str, str]
) -> None:
    panel, robot, _ = cell(**keys)
    if value is not None:
        says(robot, value)
    assert level_of(panel, robot, now) == known


def test_a_level_of_another_session_or_of_before_a_cut_is_not_known() -> None:
    panel, robot, _ = cell()
    says(robot, "ground", source="0123456789abcdef")
    assert level_of(panel, robot) == ("", "readout_foreign")
    says(robot, "ground")
    robot.mark_peer_lost(BRIDGE, 10)
    assert level_of(panel, robot) == ("", "readout_before_disconnect")


@pytest.mark.parametrize(
    ("frames", "moves", "known"),
    [
        (("map_0", "map_1"), ["map_1"], ("upper", "")),
        (("map_0", "map_1"), [], ("", "map_level_nowhere")),
        (("map_0", "map_1"), ["odom"], ("", "map_level_nowhere")),
        (("map", "map"), ["map"], ("", "map_level_several")),
    ],
)
def test_without_a_topic_it_is_where_its_transforms_lead(
    frames: tuple[str, str], moves: list[str], known: tuple[str, str]
) -> None:
    panel, robot, _ = cell(None, frames)
    for frame in moves:
        moved(robot, frame)
    assert level_of(panel, robot) == known


def test_a_level_by_an_old_pose_is_not_known() -> None:
    panel, robot, _ = cell(None, ("map_0", "map_1"))
    moved(robot, "map_0")
    assert level_of(panel, robot, NOW + 0.9) == ("ground", "")
    assert level_of(panel, robot, NOW + 1.0) == ("", "map_level_nowhere")


@pytest.mark.parametrize(
    ("here", "value", "why"),
    [
        ("ground", "dock", None),
        ("ground", "attic", "place_other_level"),
        ("upper", "attic", None),
        ("upper", "dock", "place_other_level"),
        ("roof", "dock", "map_level_other"),
        ("ground", "touch ground", None),
        ("ground", "touch upper", "place_touched_level"),
        ("ground", "touch none", "place_map_changed"),
        ("ground", "touch hole", None),
        ("upper", "touch hole", "place_in_zone"),
    ],
)
def test_a_goal_is_sent_only_on_the_level_of_the_robot(here: str, value: str, why: str | None) -> None:
    panel, robot, versions = cell()
    moved(robot, "map")
    says(robot, here)
    on = {**versions, "none": "0" * 16, "hole": versions.get(here, "")}
    if value.startswith("touch "):
        at = 3.5 if value.endswith("hole") else 2.0
        value = touched(on[value.removeprefix("touch ")], at, at)
    goal = sent(robot, panel.place_inputs[0], value)
    assert (None if isinstance(goal, Goal) else code(goal)) == why


def test_levels_with_the_same_map_can_not_be_told_apart_by_a_touched_pose() -> None:
    panel, robot, versions = cell()
    robot.maps["upper/map"].grid = robot.maps["ground/map"].grid
    moved(robot, "map")
    says(robot, "ground")
    assert code(sent(robot, panel.place_inputs[0], touched(versions["ground"]))) == "place_levels_alike"


def test_each_goal_is_locked_while_the_level_is_not_known() -> None:
    panel, robot, versions = cell()
    moved(robot, "map")
    widget = panel.place_inputs[0]
    assert input_verdict(widget, robot, NOW).code == "place_no_map"
    assert map_versions("drive", robot, NOW) == ""
    says(robot, "upper")
    assert input_verdict(widget, robot, NOW).permitted
    assert map_versions("drive", robot, NOW) == versions["upper"]


def test_the_map_shows_the_robots_level_and_has_the_others() -> None:
    panel, robot, versions = cell()
    moved(robot, "map")
    view = panel.map_views["hall"]
    shown = english(map_view(view, robot, NOW)[0])
    assert (shown["state"], shown["level"], shown["grid"]) == ("waiting", "", None)
    assert shown["note"] == shown["level_note"] == "Waiting for the robot's level"
    says(robot, "upper")
    shown = english(map_view(view, robot, NOW)[0])
    assert (shown["state"], shown["level"]) == ("live", "upper")
    assert shown["grid"]["version"] == versions["upper"]
    assert shown["level_note"] == "The robot is on another level: Upper"
    assert [zone["label"] for zone in shown["zones"]] == ["Hole", "Bay"]
    ground, upper = shown["levels"]
    assert (ground["id"], ground["grid"]["version"]) == ("ground", versions["ground"])
    assert [zone["label"] for zone in ground["zones"]] == ["Bay"]
    assert (upper["id"], upper["note"]) == ("upper", "")
    robot.maps["ground/map"].grid = None
    ground = english(map_view(view, robot, NOW)[0])["levels"][0]
    assert (ground["grid"], ground["note"]) == (None, "Waiting for the robot's map")


def test_a_place_on_another_level_has_no_distance_and_its_card_says_the_level() -> None:
    panel, robot, _ = cell()
    moved(robot, "map")
    says(robot, "ground")
    widget = panel.place_inputs[0]
    rows = english(place_input(widget, robot, NOW)[0]["places"])
    assert [(row["id"], row["level"]) for row in rows] == [("dock", "ground"), ("attic", "upper")]
    assert [row["distance"] != "" for row in rows] == [True, False]
    assert rows[1]["reason"] == "Attic is on Upper. The robot is on Ground."
    card = card_of(widget, "attic", robot, NOW)
    assert (card.level, "Upper" in [row.text for row in card.rows]) == ("upper", True)


def test_another_robot_is_drawn_on_the_level_that_it_is_on() -> None:
    shown = {}
    for level in ("ground", "upper"):
        panel, robot, _ = cell(robots="all")
        moved(robot, "map")
        says(robot, level)
        shown[level] = map_view(panel.map_views["hall"], robot, NOW)[0]
    others = other_robots(shown["ground"], [("r2", "Robot 2", robot_on_map(shown["upper"]))])
    (row,) = english(others["robots"])
    assert (row["level"], row["state"], row["note"]) == ("upper", "live", "Level: Upper")
    assert others["robots_note"] == ""
