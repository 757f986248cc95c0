"""What the doctor makes of the maps of a panel: from a graph and from samples."""

from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.robot.maps import read_grid
from app.panel import load_panel
from app.panel.widgets.map_view import TF_TYPE
from app.ros.graph.model import EndpointQos, GraphSnapshot, RobotGraph, SurveyedTopic, TopicEndpoint
from app.ros.messages import load_interfaces
from app.ros.zenoh.sample import Sample
from app.tools.doctor.findings import Report
from app.tools.doctor.maps import MapChecks
from app.tools.doctor.names import PanelNames, PanelRobot
from app.tools.doctor.received import ReceivedSamples
from app.tools.doctor.topics import TopicChecks
from tests.tools.doctor.setups import named, panel_of

pytestmark = pytest.mark.promise("doctor")

GRID: Final = "nav_msgs/msg/OccupancyGrid"
POSE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
INTERFACES: Final = load_interfaces("jazzy")
VIEW: Final = '[[page.widget]]\nid = "hall"\nkind = "map"\nlabel = "Hall"\n'
WITH_POSE: Final = f'{VIEW}pose = {{ topic = "/amcl_pose" }}\n'
TYPES: Final = {"/map": GRID, "/tf": TF_TYPE, "/tf_static": TF_TYPE, "/amcl_pose": POSE}
INFO: Final = {"resolution": 0.5, "width": 2, "height": 2}
MAP: Final = {"header": {"frame_id": "map"}, "info": INFO, "data": [0, 100, -1, 0]}
Sent = tuple[str, dict[str, Any]]


def transform(parent: str, child: str) -> dict[str, Any]:
    moved = {"header": {"frame_id": parent, "stamp": {"sec": 1}}, "child_frame_id": child}
    return {"transforms": [moved]}


def topic(name: str, *, latched: bool = True, type_name: str = "") -> SurveyedTopic:
    qos = EndpointQos(reliable=True, transient_local=latched)
    publisher = TopicEndpoint(type=type_name or TYPES[name], qos=qos, bridge="b1")
    return SurveyedTopic(name=name, key=name[1:], publishers=(publisher,))


def judged(folder: Path, widget: str, topics: list[SurveyedTopic], *sent: Sent) -> Report:
    path = folder / "cell1.toml"
    path.write_text(panel_of(widget))
    robot = PanelRobot(load_panel(path))
    graph = GraphSnapshot(robots=(RobotGraph(topics=tuple(topics)),))
    received = ReceivedSamples(began=0.0, ended=1.0)
    for name, fields in sent:
        payload = INTERFACES.encode(TYPES[name], fields)
        received.samples[name[1:]].append(Sample(payload, 0, 0.5, 0.5, "b1"))
    report = Report()
    MapChecks(report, PanelNames.for_robot(robot, graph), received, INTERFACES).check()
    return report


def test_map_with_a_way_to_the_robot_is_well(tmp_path: Path) -> None:
    sent = (("/map", MAP), ("/tf", transform("map", "odom")), ("/tf", transform("odom", "base_link")))
    report = judged(tmp_path, VIEW, [topic("/map"), topic("/tf_static")], *sent)
    assert report.codes() == []
    assert len(report.facts) == 2


def test_static_transforms_are_a_part_of_the_way(tmp_path: Path) -> None:
    sent = (
        ("/map", MAP),
        ("/tf_static", transform("map", "odom")),
        ("/tf", transform("odom", "base_link")),
    )
    assert judged(tmp_path, VIEW, [topic("/map")], *sent).codes() == []


def test_volatile_map_and_volatile_static_transforms(tmp_path: Path) -> None:
    topics = [
        topic("/map", latched=False),
        topic("/tf_static", latched=False),
        topic("/tf", latched=False),
    ]
    report = judged(tmp_path, VIEW, topics)
    assert named(report.findings) == [("map_not_latched", "/map"), ("map_not_latched", "/tf_static")]
    assert report.count("warning") == 2


@pytest.mark.parametrize(
    "transforms",
    [
        [],
        [("map", "odom")],
        [("map", "odom"), ("world", "base_link")],
        [("map", "odom"), ("odom", "base_footprint")],
    ],
)
def test_no_way_from_the_map_to_the_robot(transforms: list[tuple[str, str]], tmp_path: Path) -> None:
    sent = [("/tf", transform(*pair)) for pair in transforms]
    report = judged(tmp_path, VIEW, [topic("/map")], ("/map", MAP), *sent)
    assert named(report.findings) == [("map_no_transform", "/map")]


@pytest.mark.parametrize(
    "info", [{**INFO, "width": 3}, {**INFO, "resolution": 0.0}, {**INFO, "width": 0}]
)
def test_map_that_can_not_be_shown(info: dict[str, Any], tmp_path: Path) -> None:
    report = judged(tmp_path, VIEW, [topic("/map")], ("/map", {**MAP, "info": info}))
    assert named(report.findings) == [("map_unreadable", "/map")]


ZONE: Final = """
[[zone]]
id = "pit"
label = "Pit"
kind = "keep_out"
points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]
"""


@pytest.mark.parametrize("is_current", [True, False, None])
def test_zones_of_a_map_that_was_made_again_are_named(is_current: bool | None, tmp_path: Path) -> None:
    version = read_grid(INTERFACES, INTERFACES.encode(GRID, MAP)).version
    wanted = {True: version, False: "0" * 16, None: ""}[is_current]
    zone = ZONE + (f'map_version = "{wanted}"\n' if wanted else "")
    sent = (("/map", MAP), ("/tf", transform("map", "base_link")))
    report = judged(tmp_path, zone + VIEW, [topic("/map"), topic("/tf_static")], *sent)
    if is_current is False:
        assert named(report.findings) == [("map_zones_outdated", "/map")]
        assert report.findings[0].details == {"version": version, "zones": "Pit"}
    else:
        assert report.codes() == []


LEVELS: Final = f"""{VIEW}level = [
  {{ id = "ground", label = "Ground", topic = "/map" }},
  {{ id = "upper", label = "Upper", topic = "/upper" }},
]
"""


@pytest.mark.parametrize(("frame", "codes"), [("map", []), ("odom", ["map_no_transform"])])
def test_of_levels_one_has_a_way_to_the_robot(frame: str, codes: list[str], tmp_path: Path) -> None:
    sent = (("/map", MAP), ("/tf", transform(frame, "base_link")))
    report = judged(tmp_path, LEVELS, [topic("/map"), topic("/tf_static")], *sent)
    assert report.codes() == codes


@pytest.mark.parametrize(("frame", "codes"), [("map", []), ("/map", []), ("odom", ["map_pose_frame"])])
def test_pose_in_another_frame_than_the_map(frame: str, codes: list[str], tmp_path: Path) -> None:
    pose = {"header": {"frame_id": frame}}
    topics = [topic("/map"), topic("/amcl_pose")]
    report = judged(tmp_path, WITH_POSE, topics, ("/map", MAP), ("/amcl_pose", pose))
    assert report.codes() == codes


def test_nothing_is_said_of_what_did_not_come_or_has_another_type(tmp_path: Path) -> None:
    assert judged(tmp_path, VIEW, [topic("/map")]).codes() == []
    assert judged(tmp_path, WITH_POSE, [topic("/map")], ("/map", MAP)).codes() == []
    another = topic("/map", type_name="std_msgs/msg/String")
    assert judged(tmp_path, VIEW, [another], ("/map", MAP)).codes() == []


def test_missing_updates_are_no_finding(tmp_path: Path) -> None:
    path = tmp_path / "cell1.toml"
    path.write_text(panel_of(VIEW))
    graph = GraphSnapshot(
        robots=(RobotGraph(topics=(topic("/map"), topic("/tf"), topic("/tf_static"))),)
    )
    report = Report()
    behind = PanelNames.for_robot(PanelRobot(load_panel(path)), graph)
    TopicChecks(report, behind, INTERFACES).check()
    assert report.codes() == []
