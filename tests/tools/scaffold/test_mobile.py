"""The page of a robot that drives, from a graph with the names of Nav2."""

import tomllib
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel import check_panel
from app.panel.file.load import faults_of_text
from app.ros.messages import load_interfaces
from app.system.settings import panel_path
from app.tools.scaffold.checked import checked_draft
from app.tools.scaffold.draft import Known, make_draft
from app.tools.scaffold.mobile import GRID, NAV2
from app.tools.scaffold.parts import Draft
from app.tools.scaffold.toml_text import toml_text
from tests.tools.scaffold.test_scaffold import heard, published, server, widgets

FOLDER: Final = panel_path("mobile-robot").parent / "interfaces"
INTERFACES: Final = load_interfaces("jazzy", (FOLDER,))
TF: Final = "tf2_msgs/msg/TFMessage"
AMCL: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
ODOMETRY: Final = "nav_msgs/msg/Odometry"
TOPICS: Final = (
    published("/map", GRID, "/map_server", transient_local=True),
    published("/global_costmap/costmap", GRID, "/global_costmap", transient_local=True),
    published("/tf", TF, "/robot_state_publisher"),
    published("/tf_static", TF, "/robot_state_publisher", transient_local=True),
    published("/amcl_pose", AMCL, "/amcl", transient_local=True),
    published("/odom", ODOMETRY, "/driver"),
    published("/scan", "sensor_msgs/msg/LaserScan", "/lidar", reliable=False),
    published("/plan", "nav_msgs/msg/Path", "/planner_server"),
    published("/battery_state", "sensor_msgs/msg/BatteryState", "/driver"),
    published("/motors_ready", "std_msgs/msg/Bool", "/driver", transient_local=True),
    heard("/cmd_vel", "geometry_msgs/msg/Twist", "/driver"),
)
ACTIONS: Final = tuple(
    server(name, f"{NAV2}{kind}")
    for name, kind in (
        ("/navigate_to_pose", "NavigateToPose"),
        ("/dock_robot", "DockRobot"),
        ("/undock_robot", "UndockRobot"),
        ("/compute_path_to_pose", "ComputePathToPose"),
    )
)


def text_of(controls: bool = False, **known: Any) -> str:
    own = {"topics": TOPICS, "actions": ACTIONS, **known}
    base = Draft(title="Shuttle", interfaces=(str(FOLDER),))
    draft, faults = checked_draft(
        partial(
            make_draft,
            Known(**own),
            INTERFACES,
            base,
            controls,
        ),
        partial(faults_of_text, folder=Path()),
    )
    assert not faults
    return toml_text(draft, controls=controls)


def without(*names: str) -> list[Any]:
    return [topic for topic in TOPICS if topic.name not in names]


def map_of(text: str) -> dict[str, Any]:
    return next(widget for widget in widgets(text).values() if widget["kind"] == "map")


@pytest.mark.parametrize("kind", ["FollowWaypoints", "NavigateThroughPoses"])
def test_a_tour_shows_the_goals_of_an_action_with_several_poses(kind: str, tmp_path: Path) -> None:
    actions = (*ACTIONS, server("/follow", f"{NAV2}{kind}"))
    path = tmp_path / "shuttle.toml"
    path.write_text(text_of(controls=True, actions=actions))
    (tour,) = check_panel(path).panel.tours
    assert (tour.id, tour.map, tour.action, tour.places) == ("waypoints", "map", "follow", None)
    assert "waypoints.poses" in path.read_text()
    assert "tour" not in text_of(controls=True)


@pytest.mark.parametrize("controls", [False, True])
def test_page_of_the_map_comes_first_and_is_good(controls: bool, tmp_path: Path) -> None:
    path = tmp_path / "shuttle.toml"
    path.write_text(text_of(controls))
    panel = check_panel(path).panel
    assert panel.pages[0].id == "map"
    kinds = [widget.kind for widget in panel.pages[0].widgets]
    assert kinds[0] == "map"
    assert {"gauge", "readout"} <= {*kinds}
    assert ("action" in kinds, "joystick" in kinds) == (controls, controls)


def test_map_has_the_robot_by_its_transforms_or_else_by_its_pose() -> None:
    assert "pose" not in map_of(text_of())
    by_pose = map_of(text_of(topics=without("/tf", "/tf_static")))
    assert by_pose["pose"] == {"topic": "/amcl_pose", "type": AMCL}
    by_odometry = map_of(text_of(topics=without("/tf", "/tf_static", "/amcl_pose")))
    assert by_odometry["pose"] == {"topic": "/odom", "type": ODOMETRY}


def test_map_of_another_name_is_named_and_a_costmap_is_none() -> None:
    assert "topic" not in map_of(text_of())
    topics = [*without("/map"), published("/hall/map", GRID, "/map_server")]
    assert map_of(text_of(topics=topics))["topic"] == "/hall/map"
    assert not any(
        widget["kind"] == "map" for widget in widgets(text_of(topics=without("/map"))).values()
    )


def test_map_has_layers_of_what_is_published() -> None:
    layers = {layer["shows"]: layer for layer in map_of(text_of())["layer"]}
    assert {name: layer["topic"] for name, layer in layers.items()} == {
        "path": "/plan",
        "scan": "/scan",
        "covariance": "/amcl_pose",
        "costmap": "/global_costmap/costmap",
    }
    assert layers["scan"]["qos"] == {"reliability": "best_effort"}
    assert "qos" not in layers["path"]
    assert layers["costmap"]["label"] == "Global costmap"
    assert not any(line.startswith("# - /scan") for line in text_of().splitlines())
    few = map_of(text_of(topics=without("/plan", "/scan", "/amcl_pose", "/global_costmap/costmap")))
    assert "layer" not in few


def test_layers_are_few_of_a_kind() -> None:
    plans = [published(f"/plan_{number}", "nav_msgs/msg/Path") for number in range(5)]
    layers = map_of(text_of(topics=[*TOPICS, *plans]))["layer"]
    assert sum(layer["shows"] == "path" for layer in layers) == 2


def test_goals_of_nav2_are_comments_with_what_to_fill_in() -> None:
    text = text_of()
    for name in ("/navigate_to_pose", "/dock_robot", "/undock_robot"):
        assert all(line.startswith("#") for line in text.splitlines() if f'"{name}"' in line)
    assert "# - /compute_path_to_pose (nav2_msgs/action/ComputePathToPose): an action between" in text
    live = widgets(text_of(controls=True))
    goal = live["navigate_to_pose"]["goal"]["pose"]
    assert goal["pose"] == "{goal.pose}"
    assert live["goal"] == {
        **{"id": "goal", "kind": "place", "label": "Goal"},
        **{"map": "map", "touch": True},
    }
    alone = widgets(text_of(controls=True, topics=without("/map")))
    assert "goal" not in alone
    assert alone["navigate_to_pose"]["goal"]["pose"]["header"]["frame_id"] == "map"
    assert live["navigate_to_pose"]["progress"] == "distance_remaining"
    assert live["dock_robot"]["goal"] == {"dock_id": "dock"}
    assert {live[name]["interlock"] for name in ("navigate_to_pose", "cmd_vel")} == {"motors_ready"}


def test_transforms_that_the_map_shows_are_not_said_to_be_left_out() -> None:
    assert "/tf" not in text_of()
    assert "# - /tf: " in text_of(topics=without("/map"))


def test_action_without_its_definition_is_a_remark() -> None:
    route = server("/follow_waypoints", f"{NAV2}FollowWaypoints")
    known = load_interfaces("jazzy")
    draft = make_draft(Known(topics=TOPICS, actions=(route,)), known, Draft(title="Shuttle"), False, {})
    assert "# - /follow_waypoints: " in toml_text(draft, controls=False)


def test_map_page_stays_on_a_robot_with_many_namespaces() -> None:
    others = [
        published(f"/cell{cell}/value{number}", "std_msgs/msg/Float64")
        for cell in range(12)
        for number in range(10)
    ]
    pages = tomllib.loads(text_of(topics=[*others, *TOPICS]))["page"]
    assert pages[0]["id"] == "map"
    assert len(pages) == 8
