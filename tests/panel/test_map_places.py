"""Places, zones and inputs for places in a panel file: their values in messages, and their faults."""

import math
from pathlib import Path
from typing import Any

import pytest

from app.panel.file.load import faults_of_text
from app.panel.template import fill, input_ids, placeholders
from app.panel.widgets.place import MapPose, message_parts, read_pose
from tests.panel.test_shared_keys import text_of
from tests.support.builders import panel_of

pytestmark = pytest.mark.promise("panel file")

HALL: dict[str, Any] = {"id": "hall", "kind": "map", "label": "Hall"}
GOAL: dict[str, Any] = {"id": "goal", "kind": "place", "label": "Goal", "map": "hall", "touch": True}
DOCK: dict[str, Any] = {"id": "dock", "label": "Dock", "x": 1.0, "y": 2.0}
PIT: dict[str, Any] = {"id": "pit", "label": "Pit", "kind": "keep_out"}
CORNERS = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]


def go(**fields: Any) -> dict[str, Any]:
    keys = {"id": "go", "kind": "publish", "label": "Go", "topic": "/goal_pose"}
    return {**keys, "type": "geometry_msgs/msg/PoseStamped", "message": fields}


def faults(folder: Path, *widgets: dict[str, Any], **tables: Any) -> dict[str, str]:
    page = {"id": "one", "title": "One", "widget": list(widgets)}
    text = text_of({"title": "Cell", "page": [page], **tables})
    return {fault.place: fault.message for fault in faults_of_text(text, folder)}


@pytest.mark.parametrize(
    ("text", "pose"),
    [
        (
            "x=12.40 y=-6.85 yaw=1.57 map=0123456789abcdef",
            MapPose(12.4, -6.85, 1.57, "0123456789abcdef"),
        ),
        ("x=1 y=2 yaw=0 map=0123456789abcdef", MapPose(1.0, 2.0, 0.0, "0123456789abcdef")),
        (
            "x=1 y=2 yaw=7 map=0123456789abcdef",
            MapPose(1.0, 2.0, math.remainder(7, math.tau), "0123456789abcdef"),
        ),
        ("dock", None),
        ("x=1 y=2 yaw=0 map=", None),
        ("x=nan y=2 yaw=0 map=0123456789abcdef", None),
        ("x=1e9 y=2 yaw=0 map=0123456789abcdef", None),
        ("x=12345678 y=2 yaw=0 map=0123456789abcdef", None),
        ("x=1 y=2 yaw=0 map=0123456789abcdef\n", None),
        ("x=１ y=2 yaw=0 map=0123456789abcdef", None),
    ],
)
def test_the_text_of_a_touched_pose_is_read_whole_or_not_at_all(
    text: str, pose: MapPose | None
) -> None:
    assert read_pose(text) == pose


def test_a_message_gets_the_parts_that_it_names() -> None:
    parts = message_parts(1.5, -2.0, math.pi / 2, "map", "Dock")
    message = {
        "header": {"frame_id": "{goal.frame}"},
        "pose": "{goal.pose}",
        "note": "{goal.label}: {goal.x}",
    }
    filled = fill(message, {"goal": parts})
    assert filled["header"] == {"frame_id": "map"}
    assert filled["pose"]["position"] == {"x": 1.5, "y": -2.0, "z": 0.0}
    assert filled["pose"]["orientation"]["z"] == pytest.approx(math.sqrt(0.5))
    assert filled["note"] == "Dock: 1.5"


def test_a_command_needs_the_input_whose_parts_it_names() -> None:
    panel = panel_of(HALL, GOAL, go(pose="{goal.pose}", header={"frame_id": "{goal.frame}"}))
    (command,) = panel.commands
    assert input_ids(command) == ["goal"]
    assert sorted(name for _, name in placeholders(command.templates())) == ["goal.frame", "goal.pose"]


def test_a_place_and_a_command_with_it_are_good(tmp_path: Path) -> None:
    command = go(header={"frame_id": "{goal.frame}"}, pose="{goal.pose}")
    assert faults(tmp_path, HALL, GOAL, command, place=[DOCK]) == {}


@pytest.mark.parametrize("header", [{}, {"header": {"frame_id": "odom"}}, {"header": {}}])
def test_a_pose_in_another_frame_than_its_map_is_a_mistake(tmp_path: Path, header: Any) -> None:
    for pose in ("{goal.pose}", {"position": {"x": "{goal.x}"}}):
        messages = faults(tmp_path, HALL, GOAL, go(**header, pose=pose))
        assert list(messages) == ["page[0].widget[2].message.header.frame_id"]
        assert 'must be "{goal.frame}"' in messages["page[0].widget[2].message.header.frame_id"]


def test_the_header_nearest_to_a_pose_names_its_frame(tmp_path: Path) -> None:
    header = {"frame_id": "{goal.frame}"}
    poses = [{"header": header, "pose": "{goal.pose}"}, {"pose": "{goal.pose}"}]
    path = go(header=header, poses=poses) | {"type": "nav_msgs/msg/Path"}
    messages = faults(tmp_path, HALL, GOAL, path)
    assert list(messages) == ["page[0].widget[2].message.poses[1].header.frame_id"]


def test_a_message_without_a_frame_may_have_a_pose(tmp_path: Path) -> None:
    pose = go(position={"x": "{goal.x}"}) | {"type": "geometry_msgs/msg/Pose"}
    assert faults(tmp_path, HALL, GOAL, pose) == {}


@pytest.mark.parametrize(
    ("fields", "place", "words"),
    [
        ({"pose": "{goal.z}"}, "message.pose", 'no part of "goal" "z"'),
        ({"pose": "{goal.poes}"}, "message.pose", 'did you mean "pose"?'),
        ({"pose": "{goal}"}, "message.pose", '"goal" is a place: name a part, as in "{goal.x}"'),
        ({"pose": "{gaol.pose}"}, "message.pose", 'no input "gaol"'),
        ({"pose": "{name.x}"}, "message.pose", '"name" has no parts: write "{name}"'),
        ({"pose": {"position": "{goal.x}"}}, "message.pose.position", ""),
        ({"header": {"frame_id": "{goal.pose}"}}, "message.header.frame_id", ""),
    ],
)
def test_a_wrong_part_is_named(tmp_path: Path, fields: Any, place: str, words: str) -> None:
    name = {"id": "name", "kind": "text", "label": "Name"}
    messages = faults(tmp_path, HALL, GOAL, name, go(**fields))
    assert list(messages) == [f"page[0].widget[3].{place}"]
    assert words in next(iter(messages.values()))


@pytest.mark.parametrize(
    ("goal", "tables", "place", "words"),
    [
        ({"map": "hal"}, {}, "page[0].widget[1].map", 'did you mean "hall"?'),
        ({"places": ["dok"]}, {"place": [DOCK]}, "page[0].widget[1].places[0]", 'did you mean "dock"?'),
        ({"touch": False}, {}, "page[0].widget[1].touch", "has nothing to choose"),
        ({"radius": 0.0}, {}, "page[0].widget[1].radius", "must be more than 0"),
        ({}, {"place": [DOCK, DOCK]}, "place[1].id", '"dock" is already the id of place[0]'),
        ({}, {"place": [DOCK, {**DOCK, "id": "b"}]}, "place[1].label", "already the label of place[0]"),
        ({}, {"place": [{**DOCK, "yaw": 90.0}]}, "place[0].yaw", "90° is 1.5708"),
        ({}, {"place": [{**DOCK, "frame": "/map"}]}, "place[0].frame", "without a slash"),
        ({}, {"place": [{**DOCK, "map_version": "new"}]}, "place[0].map_version", "16 digits"),
        ({}, {"place": [{**DOCK, "icon": "ancor"}]}, "place[0].icon", 'did you mean "anchor"?'),
        ({}, {"place": [{**DOCK, "robot": "r1"}]}, "place[0].robot", "[[robot]]"),
        ({}, {"zone": [{**PIT, "points": CORNERS[:2]}]}, "zone[0].points", "has 2 points"),
        ({}, {"zone": [{**PIT, "points": [*CORNERS, [1.0]]}]}, "zone[0].points[3]", "like [2.0, 1.5]"),
        ({}, {"zone": [{**PIT, "points": CORNERS, "yaw": 1.0}]}, "zone[0].yaw", "one_way"),
        (
            {},
            {"zone": [{**PIT, "points": CORNERS, "kind": "one_way"}]},
            "zone[0].yaw",
            "where the zone leads",
        ),
        ({}, {"zone": [{**PIT, "points": CORNERS, "kind": "keepout"}]}, "zone[0].kind", "keep_out"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, goal: Any, tables: Any, place: str, words: str) -> None:
    messages = faults(tmp_path, HALL, GOAL | goal, **tables)
    assert list(messages) == [place]
    assert words in messages[place]


def test_a_panel_without_a_map_says_so(tmp_path: Path) -> None:
    assert "the panel has none" in faults(tmp_path, GOAL)["page[0].widget[0].map"]


def test_a_map_of_all_robots_is_on_a_page_of_each(tmp_path: Path) -> None:
    hall = HALL | {"robots": "all"}
    assert "no [[robot]] table" in faults(tmp_path, hall)["page[0].widget[0].robots"]
    names = [{"id": name, "name": name, "namespace": f"/{name}"} for name in ("left", "right")]
    assert faults(tmp_path, hall, robot=names) == {}
    messages = faults(tmp_path, hall | {"robot": "left"}, robot=names)
    assert 'this map is of "left"' in messages["page[0].widget[0].robots"]


def test_only_a_press_sends_a_place(tmp_path: Path) -> None:
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    hold: dict[str, Any] = {
        "id": "jog",
        "kind": "hold",
        "label": "Jog",
        "topic": "/cmd_vel",
        "interlock": "ready",
    }
    hold |= {"type": "geometry_msgs/msg/Twist", "release": {"linear": zero, "angular": zero}}
    hold |= {"message": {"linear": {**zero, "x": "{goal.x}"}, "angular": zero}}
    ready = {"id": "ready", "topic": "/ready", "type": "std_msgs/msg/Bool", "max_age_s": 1.0}
    messages = faults(tmp_path, HALL, GOAL, hold, interlock=[ready])
    assert "only a press may send one" in messages["page[0].widget[2]"]


def test_a_recipe_has_no_place(tmp_path: Path) -> None:
    recipe: dict[str, Any] = {"id": "r", "label": "R", "fields": ["goal"], "topic": "/load"}
    recipe |= {"type": "geometry_msgs/msg/Point", "message": {"x": "{goal.x}"}}
    messages = faults(tmp_path, HALL, GOAL, recipe=[recipe])
    assert "of the moment" in messages["recipe[0].fields[0]"]
