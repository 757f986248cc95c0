"""Which places and touched poses are sent: each reason to refuse one, and the lock of the buttons."""

import math
from typing import Any, Final

import pytest

from app.cell.permission.goal_places import RECHECK_S, Goal, goal_of, places_verdict
from app.cell.permission.press_permission import judged
from app.cell.robot.maps import GRID_TYPE, read_grid
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import Pose
from app.panel.model import Panel
from app.panel.widgets.place import PlaceInput
from app.ros.zenoh.sample import Sample
from app.system.errors import InputError
from app.system.texts import Text, TextLike
from tests.cell.view.test_map_values import POSE_TYPE, moved
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there

pytestmark = pytest.mark.promise("places")

SIZE: Final = 40  # cells a side, of 0.25 m; a wall from x = 8 m on
HALL: Final = {"id": "hall", "kind": "map", "label": "Hall", "max_age_s": 1.0}
GOAL: Final = {"id": "goal", "kind": "place", "label": "Places", "map": "hall", "touch": True}
DRIVE: Final = {
    "id": "drive",
    "kind": "publish",
    "label": "Drive",
    "topic": "/goal_pose",
    "type": "geometry_msgs/msg/PoseStamped",
    "message": {"header": {"frame_id": "{goal.frame}"}, "pose": "{goal.pose}"},
}
PLACES: Final = [
    {"id": "dock", "label": "Dock", "x": 2.0, "y": 3.0, "yaw": 1.5},
    {"id": "wall", "label": "Wall", "x": 9.0, "y": 3.0},
    {"id": "away", "label": "Away", "x": 50.0, "y": 3.0},
    {"id": "stairs", "label": "Stairs", "x": 5.0, "y": 5.0},
    {"id": "old", "label": "Old", "x": 2.0, "y": 3.0, "map_version": "0123456789abcdef"},
    {"id": "odom", "label": "Odom", "x": 2.0, "y": 3.0, "frame": "odom"},
    {"id": "named", "label": "Named", "x": 2.0, "y": 3.0, "frame": "map"},
]
ZONES: Final = [
    {"id": "pit", "label": "Pit", "kind": "keep_out", "points": [[4, 4], [6, 4], [6, 6], [4, 6]]}
]


def message(unknown: bool = False, frame: str = "map", resolution: float = 0.25) -> dict[str, Any]:
    cells = [
        100 if column >= 32 else -1 if unknown else 0 for _ in range(SIZE) for column in range(SIZE)
    ]
    info = {
        "width": SIZE,
        "height": SIZE,
        "resolution": resolution,
        "origin": {"orientation": {"w": 1.0}},
    }
    return {"header": {"frame_id": frame}, "info": info, "data": cells}


def put_map(robot: RobotState, **about: Any) -> str:
    """The robot's map was read; its version."""
    state = robot.maps["map"]
    state.grid = read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, message(**about)))
    state.wall = state.at = NOW
    return state.grid.version


def cell_with(**keys: Any) -> tuple[Panel, RobotState, PlaceInput, str]:
    """A panel, a robot on its map, the input and the map's version."""
    panel = panel_of(HALL, GOAL | keys, DRIVE, place=PLACES, zone=ZONES)
    robot = robot_there(panel)
    version = put_map(robot)
    moved(robot, 1.0)
    return panel, robot, panel.place_inputs[0], version


def code(reason: Any) -> str:
    """The code of a sentence, or of the first of several."""
    while isinstance(reason, Text) and reason.code == "between_sentences":
        reason = reason.params[0][1][0]  # type: ignore[index]
    while isinstance(reason, Text) and reason.code == "=ended":
        reason = reason.params[0][1]
    return reason.code if isinstance(reason, Text) else str(reason)


def sent(robot: RobotState, widget: PlaceInput, value: str, now: float = NOW) -> Goal | TextLike:
    return goal_of(widget, value, robot, now)


def touched(version: str, x: float = 2.5, y: float = 1.25, yaw: float = 1.57) -> str:
    return f"x={x:.2f} y={y:.2f} yaw={yaw:.2f} map={version}"


def test_a_place_and_a_touched_pose_are_sent_in_the_frame_of_the_map() -> None:
    _, robot, widget, version = cell_with()
    dock = sent(robot, widget, "dock")
    assert isinstance(dock, Goal)
    assert (dock.pose, dock.frame, dock.name) == (Pose(2.0, 3.0, 1.5), "map", "Dock")
    pose = sent(robot, widget, touched(version))
    assert isinstance(pose, Goal)
    assert (pose.pose, pose.frame) == (Pose(2.5, 1.25, 1.57), "map")
    parts = dock.parts
    assert (parts["x"], parts["y"], parts["yaw"], parts["label"]) == (2.0, 3.0, 1.5, "Dock")
    assert parts["orientation"]["z"] == pytest.approx(math.sin(0.75))
    assert parts["pose"] == {
        "position": {"x": 2.0, "y": 3.0, "z": 0.0},
        "orientation": parts["orientation"],
    }
    assert isinstance(sent(robot, widget, "named"), Goal)


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("wall", "place_occupied"),
        ("away", "place_outside"),
        ("stairs", "place_in_zone"),
        ("old", "place_other_map"),
        ("odom", "place_other_frame"),
    ],
)
def test_a_place_that_does_not_fit_the_map_is_refused(value: str, why: str) -> None:
    _, robot, widget, _ = cell_with()
    assert code(sent(robot, widget, value)) == why


@pytest.mark.parametrize(
    ("x", "y", "why"),
    [(9.0, 3.0, "place_occupied"), (-1.0, 3.0, "place_outside"), (3.8, 5.0, "place_in_zone")],
)
def test_a_touched_pose_is_judged_as_a_place(x: float, y: float, why: str) -> None:
    _, robot, widget, version = cell_with()
    assert code(sent(robot, widget, touched(version, x, y))) == why


def test_floor_that_the_map_does_not_know_is_refused() -> None:
    _, robot, widget, _ = cell_with()
    version = put_map(robot, unknown=True)
    assert code(sent(robot, widget, "dock")) == "place_unknown_floor"
    assert code(sent(robot, widget, touched(version))) == "place_unknown_floor"


def test_the_radius_of_the_input_is_that_of_the_map_unless_it_has_one() -> None:
    _, robot, widget, version = cell_with()
    assert isinstance(sent(robot, widget, touched(version, 7.6)), Goal)
    _, robot, widget, version = cell_with(radius=0.5)
    assert code(sent(robot, widget, touched(version, 7.6))) == "place_occupied"


def test_a_pose_that_was_touched_on_another_map_is_refused() -> None:
    _, robot, widget, version = cell_with()
    put_map(robot, unknown=True)
    assert code(sent(robot, widget, touched(version))) == "place_map_changed"


@pytest.mark.parametrize(
    "value", ["", "gone", "x=1 y=2", touched("0123456789abcdeg"), "x" * 200, 3, None, {"x": 1}]
)
def test_a_value_that_chooses_nothing_is_bad_input(value: Any) -> None:
    _, robot, widget, _ = cell_with()
    with pytest.raises(InputError):
        goal_of(widget, value, robot, NOW)


def test_only_what_the_input_offers_can_be_sent() -> None:
    _, robot, widget, version = cell_with(touch=False, places=["named"])
    for value in ("dock", touched(version)):
        with pytest.raises(InputError):
            goal_of(widget, value, robot, NOW)
    assert isinstance(sent(robot, widget, "named"), Goal)


def pose_old(robot: RobotState) -> float:
    return NOW + 6.0


def tree_broken(robot: RobotState) -> float:
    robot.transforms = type(robot.transforms)()
    moved(robot, 1.0, child="wheel")
    return NOW


def nothing_heard(robot: RobotState) -> float:
    robot.transforms = type(robot.transforms)()
    return NOW


def no_map(robot: RobotState) -> float:
    robot.maps["map"].grid = None
    return NOW


def unreadable(robot: RobotState) -> float:
    robot.maps["map"].problem = Text("map_empty")
    return NOW


def no_frame(robot: RobotState) -> float:
    put_map(robot, frame="")
    return NOW


def map_cut(robot: RobotState) -> float:
    robot.maps["map"].cut_at = NOW + 1
    return NOW


def pose_cut(robot: RobotState) -> float:
    robot.transforms.cut(NOW)
    return NOW


@pytest.mark.parametrize(
    ("happens", "why", "first"),
    [
        (pose_old, "place_pose_old", "place_pose_old"),
        (tree_broken, "place_pose_unknown", "place_pose_unknown"),
        (nothing_heard, "place_pose_unknown", "place_pose_unknown"),
        (pose_cut, "place_pose_old", "place_pose_old"),
        (no_map, "place_no_map", "map_waiting"),
        (unreadable, "place_no_map", "map_empty"),
        (no_frame, "place_no_map", "map_no_frame"),
        (map_cut, "place_no_map", "readout_before_disconnect"),
    ],
)
def test_what_is_not_known_now_locks_the_button_and_refuses_each_choice(
    happens: Any, why: str, first: str
) -> None:
    panel, robot, widget, version = cell_with()
    now = happens(robot)
    verdict = places_verdict("drive", robot, now)
    assert verdict is not None
    assert (verdict.permitted, verdict.code) == (False, why)
    assert now < verdict.until <= now + RECHECK_S
    button = panel.widget("drive", type(panel.commands[0]))
    assert judged(button, (), robot, now).code == why
    for value in ("dock", touched(version)):
        assert code(sent(robot, widget, value, now)) == first


def test_while_a_newer_map_is_not_read_yet_nothing_is_sent_and_nothing_flickers() -> None:
    _, robot, widget, version = cell_with()
    robot.maps["map"].is_behind = True
    for value in ("dock", touched(version)):
        assert code(sent(robot, widget, value)) == "place_map_behind"
    verdict = places_verdict("drive", robot, NOW)
    assert verdict is not None
    assert verdict.permitted


@pytest.mark.parametrize(("age_s", "why"), [(0, ""), (600, "place_pose_old")])
def test_a_pose_that_a_node_repeats_for_a_later_subscriber_is_old(age_s: int, why: str) -> None:
    panel = panel_of(HALL | {"pose": {"topic": "/amcl_pose"}}, GOAL, DRIVE, place=PLACES)
    robot = robot_there(panel)
    put_map(robot)
    stamp = {"sec": int(NOW) - age_s}
    pose = {
        "header": {"frame_id": "map", "stamp": stamp},
        "pose": {"pose": {"orientation": {"w": 1.0}}},
    }
    robot.update("amcl_pose", Sample(INTERFACES.encode(POSE_TYPE, pose), 1, NOW, NOW, BRIDGE))
    goal = sent(robot, panel.place_inputs[0], "dock")
    assert isinstance(goal, Goal) if not why else code(goal) == why


def test_the_missing_frame_is_named() -> None:
    _, robot, widget, _ = cell_with()
    tree_broken(robot)
    assert "base_link" in str(sent(robot, widget, "dock"))


def test_a_lock_is_judged_again_after_some_time_and_goes() -> None:
    _, robot, _, _ = cell_with()
    verdict = places_verdict("drive", robot, NOW)
    assert verdict is not None
    assert (verdict.permitted, verdict.until) == (True, NOW + RECHECK_S)
    assert places_verdict("other", robot, NOW) is None


def test_a_localization_may_start_where_the_position_is_not_known() -> None:
    _, robot, widget, version = cell_with(require_pose=False)
    nothing_heard(robot)
    assert isinstance(sent(robot, widget, touched(version)), Goal)
    no_map(robot)
    assert code(sent(robot, widget, touched(version))) == "map_waiting"


def test_a_lost_link_locks() -> None:
    _, robot, _, _ = cell_with()
    robot.mark_link_lost()
    verdict = places_verdict("drive", robot, NOW)
    assert verdict is not None
    assert not verdict.permitted
