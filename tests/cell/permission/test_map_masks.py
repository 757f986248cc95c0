"""The filter masks of Nav2 over a map: what they mark, and which goals they refuse."""

import io
from typing import Any, Final

import pytest
from PIL import Image

from app.cell.permission.goal_places import Goal, input_verdict
from app.cell.permission.map_masks import Mask, mask_of
from app.cell.robot.maps import HATCH_CELLS, mask_tile, read_grid
from app.cell.robot.state import RobotState
from app.cell.view.map_layer_values import map_layer
from app.panel.model import Panel
from app.panel.widgets.map_layers import GRID_TYPE, INFO_TYPE
from app.ros.messages import load_interfaces
from app.ros.zenoh.sample import Sample
from tests.cell.permission.test_goal_places import DRIVE, GOAL, HALL, code, put_map, sent
from tests.cell.view.test_map_values import moved
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there
from tests.support.parts import ROOT
from tests.support.words import english

pytestmark = pytest.mark.promise("places")

NAV2: Final = load_interfaces("jazzy", [ROOT / "docs/examples/mobile-robot/interfaces"])
KEEP_OUT: Final = {"shows": "keep_out", "topic": "/keepout_mask", "info": "/filter_info"}
SPEED: Final = {"shows": "speed", "topic": "/speed_mask", "info": "/filter_info"}
PLACES: Final = [
    {"id": "free", "label": "Free", "x": 2.0, "y": 3.0},
    {"id": "closed", "label": "Closed", "x": 5.0, "y": 5.0},
    {"id": "beside", "label": "Beside", "x": 5.8, "y": 5.0},
    {"id": "uneasy", "label": "Uneasy", "x": 5.0, "y": 1.0},
]
INFO: Final = {"type": 0, "filter_mask_topic": "keepout_mask", "base": 0.0, "multiplier": 1.0}


def cell(*layers: dict[str, Any], **keys: Any) -> tuple[Panel, RobotState]:
    """A robot on its map, whose masks have not come."""
    panel = panel_of(HALL | {"layer": list(layers)} | keys, GOAL, DRIVE, place=PLACES)
    robot = robot_there(panel, interfaces=NAV2)
    put_map(robot)
    moved(robot, 1.0)
    return panel, robot


def put_mask(robot: RobotState, topic: str = "keepout_mask", closed: int = 100, **header: Any) -> None:
    """A mask of 10 x 10 cells of 1 m: closed at (5, 5), uneasy at (5, 1), the corner not known."""
    data = [0] * 100
    data[55], data[15], data[0] = closed, 60, -1
    info = {"width": 10, "height": 10, "resolution": 1.0, "origin": {"orientation": {"w": 1.0}}}
    message = {"header": {"frame_id": "map"} | header, "info": info, "data": data}
    state = robot.maps[topic]
    state.grid = read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, message))
    state.wall, state.at = NOW, NOW


def put_info(robot: RobotState, **fields: Any) -> None:
    payload = NAV2.encode(INFO_TYPE, INFO | fields)
    robot.update("filter_info", Sample(payload, 1, NOW, NOW, BRIDGE))


@pytest.mark.parametrize(
    ("value", "why"),
    [
        ("free", None),
        ("closed", "place_in_zone"),
        ("beside", "place_in_zone"),  # its circle of 0.3 m touches the cell
        ("uneasy", None),  # Nav2 avoids it, and drives there
    ],
)
def test_a_goal_on_a_cell_of_a_keep_out_mask_is_refused(value: str, why: str | None) -> None:
    panel, robot = cell(KEEP_OUT)
    put_mask(robot)
    put_info(robot)
    goal = sent(robot, panel.place_inputs[0], value)
    assert (None if isinstance(goal, Goal) else code(goal)) == why


@pytest.mark.parametrize(
    ("fields", "closed", "is_closed"),
    [
        ({}, 99, False),
        ({"multiplier": 2.0}, 50, True),
        ({"base": 50.0, "multiplier": 0.5}, 98, False),
        ({"base": 50.0, "multiplier": 0.5}, 99, True),
    ],
)
def test_what_a_cell_says_is_by_base_and_multiplier(
    fields: dict[str, Any], closed: int, is_closed: bool
) -> None:
    panel, robot = cell(KEEP_OUT)
    put_mask(robot, closed=closed)
    put_info(robot, **fields)
    goal = sent(robot, panel.place_inputs[0], "closed")
    assert (not isinstance(goal, Goal)) == is_closed


@pytest.mark.parametrize(
    ("mask", "info", "note"),
    [
        (None, INFO, "map_layer_waiting"),
        ({}, None, "map_mask_waiting"),
        ({}, {"filter_mask_topic": "/other_mask"}, "map_mask_topic"),
        ({}, {"filter_mask_topic": "/keepout_mask"}, ""),
        ({}, {"type": 1}, "map_mask_type"),
        ({}, {"base": float("nan")}, "map_layer_not_finite"),
        ({"frame_id": "odom"}, {}, "map_mask_frame"),
    ],
)
def test_a_mask_that_is_not_known_locks_each_goal_and_is_named(
    mask: dict[str, Any] | None, info: dict[str, Any] | None, note: str
) -> None:
    panel, robot = cell(KEEP_OUT)
    if mask is not None:
        put_mask(robot, **mask)
    if info is not None:
        put_info(robot, **info)
    view, widget = panel.map_views["hall"], panel.place_inputs[0]
    geometry = robot.maps["map"].grid.geometry  # type: ignore[union-attr]
    assert code(mask_of(view.layers[0], robot, geometry, NOW).note) == note
    verdict = input_verdict(widget, robot, NOW)
    assert verdict.code == ("place_no_mask" if note else "permitted")
    shown = map_layer(view, view.layers[0], robot, geometry, NOW).attributes
    assert (shown["state"] == "live", bool(shown["warning"])) == (not note, bool(note))


def test_an_old_mask_and_one_of_before_a_cut_are_not_in_force() -> None:
    panel, robot = cell(KEEP_OUT | {"max_age_s": 5.0})
    put_mask(robot)
    put_info(robot)
    widget = panel.place_inputs[0]
    assert input_verdict(widget, robot, NOW + 4.9, require_pose=False).permitted
    assert input_verdict(widget, robot, NOW + 5.0, require_pose=False).code == "place_no_mask"
    robot.maps["keepout_mask"].cut_at = NOW + 1.0
    assert input_verdict(widget, robot, NOW).code == "place_no_mask"


def test_a_newer_mask_that_is_not_read_yet_refuses_each_goal() -> None:
    panel, robot = cell(KEEP_OUT)
    put_mask(robot)
    put_info(robot)
    robot.maps["keepout_mask"].is_behind = True
    assert code(sent(robot, panel.place_inputs[0], "free")) == "place_map_behind"


@pytest.mark.parametrize(
    ("fields", "note"),
    [
        ({"type": 1}, "Limits: 60 %"),  # 100 % is no limit
        ({"type": 2, "multiplier": 0.01}, "Limits: 0.6 m/s, 1 m/s"),
        ({"type": 1, "base": 100.0, "multiplier": -1.0}, "Limits: 40 %"),
    ],
)
def test_a_mask_of_speeds_names_its_limits_and_refuses_nothing(
    fields: dict[str, Any], note: str
) -> None:
    panel, robot = cell(SPEED)
    put_mask(robot, "speed_mask")
    put_info(robot, filter_mask_topic="/speed_mask", **fields)
    view = panel.map_views["hall"]
    geometry = robot.maps["map"].grid.geometry  # type: ignore[union-attr]
    shown = english(dict(map_layer(view, view.layers[0], robot, geometry, NOW).attributes))
    assert (shown["state"], shown["note"], shown["warning"]) == ("live", note, "")
    assert shown["grid"]["version"].startswith("speed-")
    assert isinstance(sent(robot, panel.place_inputs[0], "closed"), Goal)


@pytest.mark.parametrize("is_hatched", [True, False])
def test_a_tile_of_a_mask_is_hatched_or_dotted_where_it_is_marked(is_hatched: bool) -> None:
    size = 4 * HATCH_CELLS
    info = {"width": size, "height": size, "resolution": 0.1, "origin": {"orientation": {"w": 1.0}}}
    data = [100 if x < size // 2 else -1 for _ in range(size) for x in range(size)]
    message = {"header": {"frame_id": "map"}, "info": info, "data": data}
    grid = read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, message))
    mask = Mask(grid, 0, 0.0, 1.0)
    picture = mask_tile(grid, 0, 0, "light", mask.marked, is_hatched=is_hatched)
    alpha = Image.open(io.BytesIO(picture)).convert("RGBA").getchannel("A")
    left = alpha.crop((0, 0, size // 2, size)).tobytes()
    assert {*left} == {40, 200}
    assert left.count(200) == len(left) // (4 if is_hatched else 16)
    assert {*alpha.crop((size // 2, 0, size, size)).tobytes()} == {0}
