"""What the layers of a map show: where they are now, or why they are left out."""

import math
from typing import Any, Final

import pytest

from app.cell.robot.map_layers import POSE_TYPE, SCAN_TYPE, read_shape
from app.cell.robot.maps import GRID_TYPE, read_grid
from app.cell.robot.state import RobotState
from app.cell.view.map_layer_values import AHEAD_S
from app.cell.view.view import build_view
from app.ros.cdr.stamped import PATH_TYPE
from tests.cell.robot.test_map_layers import covariance_of, path_of, scan_of
from tests.cell.robot.test_transforms import transform, transforms_of
from tests.cell.view.test_map_values import INFO, MAP
from tests.support.builders import INTERFACES, NOW, endpoint, panel_of, robot_there
from tests.support.words import english

FIELDS: Final[Any] = {
    PATH_TYPE: path_of((1.0, 2.0), (3.0, 4.0)),
    SCAN_TYPE: scan_of(1.0, 2.0),
    POSE_TYPE: covariance_of(0.01, 0.0, 0.0001),
}


class Shown:
    """A map with one layer, whose message arrived at `NOW`."""

    def __init__(
        self, shows: str, type_name: str, *, frame: str = "map", stamp: int = 0, **keys: Any
    ) -> None:
        self.panel = panel_of(MAP | {"layer": [{"shows": shows, "topic": "/over", **keys}]})
        self.robot: RobotState = robot_there(self.panel)
        self.header = {"frame_id": frame, "stamp": {"sec": stamp}}
        self.robot.maps["map"].grid = read_grid(INTERFACES, grid_message("map"))
        self.robot.maps["map"].wall = self.robot.maps["map"].at = NOW
        if type_name == GRID_TYPE:
            state = self.robot.maps["over"]
            state.grid = read_grid(INTERFACES, grid_message(frame))
            state.at = NOW
        else:
            layer = self.robot.map_layers["over"]
            data = INTERFACES.encode(type_name, {"header": self.header, **FIELDS[type_name]})
            layer.shape, layer.at = read_shape(INTERFACES, type_name, data), NOW

    def tf(self, *moving: Any, at: float = NOW) -> None:
        self.robot.transforms.record(transforms_of(*moving), at, is_static=False)

    def widget(self, now: float = NOW) -> Any:
        return english(build_view(self.panel, self.robot, now).view["widgets"]["hall"])

    def layer(self, now: float = NOW) -> Any:
        return self.widget(now)["layer_0"]


def grid_message(frame: str) -> bytes:
    return INTERFACES.encode(GRID_TYPE, {"header": {"frame_id": frame}, "info": INFO, "data": [0, 100]})


def test_a_path_in_the_maps_frame_is_where_it_is() -> None:
    shown = Shown("path", PATH_TYPE)
    assert shown.layer() == {
        "label": "Path",
        "state": "live",
        "note": "",
        "warning": "",
        "points": [100, 200, 300, 400],
    }


def test_a_layer_of_another_frame_is_placed_by_the_newest_transforms() -> None:
    shown = Shown("path", PATH_TYPE, frame="odom", stamp=1)
    shown.tf(transform("map", "odom", 5.0, x=10.0, yaw=math.pi / 2))
    assert shown.layer()["points"] == [800, 100, 600, 300]


def test_a_scan_is_placed_at_its_stamp_and_stays_there() -> None:
    shown = Shown("scan", SCAN_TYPE, frame="laser", stamp=5)
    shown.tf(transform("map", "laser", 4.0, x=0.0), transform("map", "laser", 6.0, x=2.0))
    first = shown.layer()["points"]
    assert first == [200, 0, 100, 200]
    shown.tf(transform("map", "laser", 7.0, x=9.0))
    assert shown.layer()["points"] == first


def test_a_scan_ahead_of_the_transforms_is_left_out_and_named() -> None:
    shown = Shown("scan", SCAN_TYPE, frame="laser", stamp=50)
    shown.tf(transform("map", "laser", 50.0 - AHEAD_S - 1.0))
    layer = shown.layer()
    assert (layer["state"], layer["note"]) == (
        "unplaced",
        "its time is 2.0 s ahead of the transforms",
    )
    shown.tf(transform("map", "laser", 50.0))
    assert shown.layer()["state"] == "live"


def test_a_layer_without_a_way_to_the_map_is_named() -> None:
    shown = Shown("scan", SCAN_TYPE, frame="laser")
    widget = shown.widget()
    why = "No transform from map to laser: laser is missing"
    assert (widget["layer_0"]["state"], widget["layer_0"]["note"]) == ("unplaced", why)
    assert widget["layer_note"] == f"Laser scan: {why}"
    assert "points" not in widget["layer_0"]


def test_a_layer_by_old_transforms_is_left_out_and_named() -> None:
    shown = Shown("scan", SCAN_TYPE, frame="laser", max_age_s=60.0)
    shown.tf(transform("map", "laser", 1.0), at=NOW - 9.0)
    assert shown.layer()["note"] == "no transform from map to laser for 9 s"


def test_an_old_layer_is_left_out_and_named() -> None:
    shown = Shown("scan", SCAN_TYPE)
    assert build_view(shown.panel, shown.robot, NOW).until <= NOW + 1.0
    old = shown.widget(NOW + 4.0)
    assert (old["layer_0"]["state"], old["layer_0"]["note"]) == ("old", "last received 4 s ago")
    assert old["layer_note"] == "Laser scan: last received 4 s ago"
    assert "points" not in old["layer_0"]


def test_that_a_path_has_ended_stands_in_the_list_only() -> None:
    widget = Shown("path", PATH_TYPE).widget(NOW + 60.0)
    assert (widget["layer_0"]["state"], widget["layer_note"]) == ("old", "")


def test_a_layer_of_another_type_is_named() -> None:
    shown = Shown("scan", SCAN_TYPE)
    endpoint(shown.robot, "MP", "/over", "std_msgs/msg/String")
    layer = shown.layer()
    assert layer["state"] == "unreadable"
    assert layer["note"].startswith("/over is std_msgs/msg/String")


@pytest.mark.parametrize("shows", ["scan", "costmap"])
def test_a_layer_of_before_a_cut_is_left_out(shows: str) -> None:
    shown = Shown(shows, SCAN_TYPE if shows == "scan" else GRID_TYPE)
    assert shown.layer()["state"] == "live"
    shown.robot.mark_link_lost()
    assert shown.layer()["state"] == "old"
    assert shown.layer().keys().isdisjoint({"points", "grid"})


def test_a_layer_of_another_session_is_left_out() -> None:
    shown = Shown("scan", SCAN_TYPE)
    shown.robot.map_layers["over"].source = "0123456789abcdef"
    assert shown.layer()["state"] == "old"


def test_an_uncertain_position_is_an_ellipse_and_stands_beside_the_map() -> None:
    shown = Shown("covariance", POSE_TYPE)
    shown.tf(transform("map", "base_link", 1.0))
    widget = shown.widget()
    assert widget["layer_0"]["ellipse"] == pytest.approx([0.245, 0.024, 0.0], abs=0.001)
    assert widget["about"].endswith(", position ± 24 cm")
    assert "±" not in shown.widget(NOW + 30.0)["about"]  # the robot's position is old


def test_a_costmap_has_its_own_origin_in_the_maps_frame() -> None:
    shown = Shown("costmap", GRID_TYPE, frame="odom")
    shown.tf(transform("map", "odom", 1.0, x=10.0, yaw=math.pi / 2))
    grid = shown.layer()["grid"]
    assert grid["version"].startswith("cost-")
    assert (grid["x"], grid["y"], grid["yaw"]) == (10.0, 0.0, pytest.approx(math.pi / 2, abs=1e-3))


def test_lost_updates_make_a_costmap_old_and_a_map_too() -> None:
    shown = Shown("costmap", GRID_TYPE)
    shown.tf(transform("map", "base_link", 1.0))
    for key in ("over", "map"):
        shown.robot.maps[key].doubt = "Updates were lost"
    widget = shown.widget()
    assert (widget["state"], widget["note"]) == ("old", "Updates were lost")
    assert (widget["layer_0"]["state"], widget["layer_0"]["note"]) == ("old", "Updates were lost")


def test_a_layer_that_has_not_come_waits_without_an_alarm_of_the_map() -> None:
    shown = Shown("path", PATH_TYPE)
    state = shown.robot.map_layers["over"]
    state.shape, state.at = None, -math.inf
    widget = shown.widget()
    assert (widget["layer_0"]["state"], widget["layer_note"]) == ("waiting", "")


def test_a_rotated_origin_is_explained() -> None:
    shown = Shown("path", PATH_TYPE)
    assert shown.widget()["detail"] == ""
    origin = {"orientation": {"z": math.sin(0.25), "w": math.cos(0.25)}}
    turned = {"header": {"frame_id": "map"}, "info": INFO | {"origin": origin}, "data": [0, 100]}
    shown.robot.maps["map"].grid = read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, turned))
    assert shown.widget()["detail"].startswith("The map's origin is rotated by 28.6")


def test_points_that_did_not_move_are_the_same_again() -> None:
    shown = Shown("path", PATH_TYPE, frame="odom")
    shown.tf(transform("map", "odom", 5.0))
    first = build_view(shown.panel, shown.robot, NOW).view["widgets"]["hall"]["layer_0"]["points"]
    shown.tf(transform("map", "odom", 6.0))
    again = build_view(shown.panel, shown.robot, NOW).view["widgets"]["hall"]["layer_0"]["points"]
    assert again is first
