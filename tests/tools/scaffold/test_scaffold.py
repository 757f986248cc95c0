"""A first panel from a robot's graph: what is shown, what is locked, and that it is a good panel."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.cell.permission.verdict import topic_mismatch
from app.panel import check_panel
from app.panel.file.load import faults_of_text
from app.panel.model import Panel
from app.panel.widgets.families import PublishCommand
from app.ros.dialects.peer_traits import BRIDGE_TRAITS, RMW_ZENOH_TRAITS
from app.ros.graph.model import EndpointQos, Server, SurveyedTopic, TopicEndpoint
from app.ros.graph.node_services import NodeParameter
from app.ros.messages import load_interfaces
from app.ros.messages.names import Qos
from app.tools.scaffold.checked import checked_draft
from app.tools.scaffold.draft import Known, make_draft
from app.tools.scaffold.parts import (
    Draft,
    FieldCandidate,
    id_of,
    label_of,
    permits,
    place_of,
    range_for,
    shown_fields,
)
from app.tools.scaffold.toml_text import toml_text
from tests.support.builders import endpoint as subscribe
from tests.support.builders import robot_there

INTERFACES = load_interfaces("jazzy")
BOOL = "std_msgs/msg/Bool"


def endpoint(type_name: str, node: str, **qos: Any) -> TopicEndpoint:
    reliable = qos.pop("reliable", True)
    return TopicEndpoint(
        type=type_name, qos=EndpointQos(reliable=reliable, **qos), bridge="a", nodes=(node,)
    )


def published(name: str, type_name: str, node: str = "/cell_io", **qos: Any) -> SurveyedTopic:
    return SurveyedTopic(name=name, key=name[1:], publishers=(endpoint(type_name, node, **qos),))


def heard(name: str, type_name: str, node: str = "/cell_io", **qos: Any) -> SurveyedTopic:
    return SurveyedTopic(name=name, key=name[1:], subscribers=(endpoint(type_name, node, **qos),))


def server(name: str, type_name: str, dds: str = "Cyclone DDS") -> Server:
    return Server(name=name, key=name[1:], type=type_name, bridge="a", nodes=("/plc",), dds=dds)


def text_of(controls: bool = False, base: Draft | None = None, **known: Any) -> str:
    draft, faults = checked_draft(
        partial(make_draft, Known(**known), INTERFACES, base or Draft(title="Cell"), controls),
        partial(faults_of_text, folder=Path()),
    )
    assert not faults
    return toml_text(draft, controls=controls)


def widgets(text: str) -> dict[str, dict[str, Any]]:
    pages = tomllib.loads(text)["page"]
    return {widget["id"]: widget for page in pages for widget in page.get("widget", ())}


ENABLED = published("/operation_enabled", BOOL, transient_local=True)
CELL: Mapping[str, Any] = {
    "topics": [
        ENABLED,
        published("/estop_pressed", BOOL, transient_local=True),
        published("/arm/guard_closed", BOOL, "/arm/io"),
        published("/arm/joint_states", "sensor_msgs/msg/JointState", "/arm/driver"),
        published("/arm/temperature", "sensor_msgs/msg/Temperature", "/arm/driver", reliable=False),
        published("/speed", "std_msgs/msg/Float64"),
        published("/mode", "std_msgs/msg/String"),
        published("/odom", "nav_msgs/msg/Odometry"),
        published("/camera/image_raw", "sensor_msgs/msg/Image"),
        published("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
        published("/rosout", "rcl_interfaces/msg/Log", transient_local=True),
        published("/parameter_events", "rcl_interfaces/msg/ParameterEvent"),
        heard("/start", BOOL),
        heard("/cmd_vel", "geometry_msgs/msg/Twist"),
        heard("/pose", "geometry_msgs/msg/Pose"),
        heard("/target", "std_msgs/msg/Float64"),
    ],
    "services": [
        server("/reset", "std_srvs/srv/Trigger"),
        server("/light", "std_srvs/srv/SetBool"),
        server("/add", "example_interfaces/srv/AddTwoInts"),
        server("/plc/get_parameters", "rcl_interfaces/srv/GetParameters"),
        server("/old", "std_srvs/srv/Trigger", "Fast DDS"),
    ],
    "actions": [server("/count", "example_interfaces/action/Fibonacci")],
    "parameters": [
        NodeParameter(node="/plc", name="speed", type="double", value=0.5, min=0, max=2),
        NodeParameter(node="/plc", name="serial", type="string", value="1", read_only=True),
        NodeParameter(node="/plc", name="use_sim_time", type="bool", value=False),
    ],
    "samples": {
        "/arm/joint_states": SimpleNamespace(name=["j1", "j2"], position=[0.5, -4.0]),
        "/speed": SimpleNamespace(data=3.2),
    },
}


@pytest.mark.parametrize("controls", [False, True])
def test_scaffold_is_a_valid_panel(tmp_path: Path, controls: bool) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text_of(controls, **CELL))
    assert bool(check_panel(path).panel.commands) is controls


def test_a_robot_with_nothing_is_a_good_panel_too(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text_of())
    check_panel(path)


def test_controls_are_comments_unless_requested() -> None:
    text = text_of(**CELL)
    assert {widget["kind"] for widget in widgets(text).values()} <= {
        "indicator",
        "readout",
        "gauge",
        "joints",
        "camera",
        "table",
        "log",
        "trend",
        "label",
    }
    for name in ("/start", "/reset", "/count", "/cmd_vel"):
        assert f'"{name}"' in text
        assert all(line.startswith("#") for line in text.splitlines() if f'"{name}"' in line)


def test_each_live_control_has_the_interlock() -> None:
    live = {
        name: widget
        for name, widget in widgets(text_of(controls=True, **CELL)).items()
        if widget["kind"] in ("publish", "joystick", "call", "action", "parameter")
    }
    assert set(live) == {
        "start",
        "cmd_vel",
        "target",
        "reset",
        "light_on",
        "light_off",
        "count",
        "plc_speed",
    }
    assert {widget["interlock"] for widget in live.values()} == {"operation_enabled"}


def test_without_a_candidate_no_control_is_live() -> None:
    text = text_of(controls=True, topics=[heard("/start", BOOL)])
    assert 'topic = "/start"' in text
    assert "start" not in widgets(text)
    assert "No topic was found that looks like a permission" in text


def test_interlock_candidates_are_bools_that_permit() -> None:
    interlocks = tomllib.loads(text_of(**CELL))["interlock"]
    assert [
        (interlock["topic"], interlock.get("require_publisher"), interlock.get("max_age_s"))
        for interlock in interlocks
    ] == [
        ("/operation_enabled", True, None),  # latched: it is published once
        ("/arm/guard_closed", None, 2.0),
    ]


def test_interlock_requires_one_publisher_if_the_robot_has_one_publisher() -> None:
    interlocks = tomllib.loads(text_of(**CELL))["interlock"]
    assert {interlock["publishers"] for interlock in interlocks} == {"one"}
    twice = replace(
        published("/guard_closed", BOOL),
        publishers=(
            endpoint(BOOL, "/left"),
            endpoint(BOOL, "/right"),
        ),
    )
    text = text_of(topics=[twice])
    assert "several publishers, of which the last counts: /left, /right" in text
    assert "publishers" not in tomllib.loads(text)["interlock"][0]


def test_a_bool_of_a_fault_is_a_red_lamp() -> None:
    lamp = widgets(text_of(**CELL))["estop_pressed"]
    assert lamp["states"][0] == {
        "value": True,
        "text": "Estop pressed",
        "shape": "cross",
        "colour": "red",
    }


def test_usual_types_have_suitable_displays() -> None:
    by_id = widgets(text_of(**CELL))
    assert by_id["arm_joint_states"]["joint"] == [
        {"name": "j1", "label": "J1", "min": -180, "max": 180},
        {"name": "j2", "label": "J2", "min": -360, "max": 360},  # it was seen beyond half a turn
    ]
    gauge = by_id["arm_temperature"]
    assert (gauge["unit"], gauge["min"], gauge["max"]) == ("°C", 0, 100)
    assert gauge["qos"] == {"reliability": "best_effort"}  # else it would never be received
    assert (by_id["speed"]["min"], by_id["speed"]["max"]) == (0, 5)  # 3.2 was seen
    assert by_id["odom_pose_pose_position_x"]["unit"] == "m"
    assert {by_id[name]["kind"] for name in ("camera_image_raw", "rosout", "diagnostics")} == {
        "camera",
        "log",
        "table",
    }
    assert "parameter_events" not in by_id
    assert any(widget["kind"] == "trend" for widget in by_id.values())


def test_pages_are_namespaces_and_nodes() -> None:
    pages = tomllib.loads(text_of(**CELL))["page"]
    assert [page["id"] for page in pages] == ["arm", "cell_io", "plc", "robot", "nodes"]


def test_pages_of_similar_namespaces_have_ids_of_their_own(tmp_path: Path) -> None:
    topics = [
        published(f"/{page}/{name}", "std_msgs/msg/Float64")
        for page in ("armLeft", "arm_left")
        for name in ("speed", "load")
    ]
    path = tmp_path / "cell.toml"
    path.write_text(text_of(topics=topics))
    assert [page.id for page in check_panel(path).panel.pages] == ["arm_left", "arm_left_2"]


def test_topic_without_a_widget_is_named() -> None:
    text = text_of(**CELL, unreadable=["/cell_io"])
    assert "# - /pose (geometry_msgs/msg/Pose)" in text
    assert "# - /add (example_interfaces/srv/AddTwoInts): give its request" in text
    assert "# - /old (std_srvs/srv/Trigger), on Fast DDS: the bridge reaches" in text
    assert "# - parameters of /cell_io: the bridge reaches services on Cyclone DDS only" in text
    unknown = text_of(topics=[published("/jig", "jig_msgs/msg/Jig")])
    assert (
        '# - /jig: "jig_msgs/msg/Jig" is not an interface of ROS 2 jazzy; there is no package'
        in unknown
    )
    joints = text_of(topics=[published("/joint_states", "sensor_msgs/msg/JointState")])
    assert "# - /joint_states: no message arrived that names its joints" in joints


@pytest.mark.parametrize(
    "name", ["sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/LaserScan", "nav_msgs/msg/OccupancyGrid"]
)
def test_numbers_for_programs_are_no_gauges(name: str) -> None:
    text = text_of(topics=[published("/x", name)])
    assert widgets(text) == {}
    assert f"# - /x ({name})" in text


@pytest.mark.parametrize(
    "change",
    [
        lambda topic: SurveyedTopic(name="/x", key="x", publishers=topic.publishers, announced=False),
        lambda topic: SurveyedTopic(name="/_hidden", key="_hidden", publishers=topic.publishers),
        lambda topic: SurveyedTopic(name="/clock", key="clock", publishers=topic.publishers),
    ],
)
def test_unusable_topics_are_left_out(change: Callable[[SurveyedTopic], SurveyedTopic]) -> None:
    assert widgets(text_of(topics=[change(published("/y", "std_msgs/msg/Int32"))])) == {}


def test_a_value_looks_old_where_its_topic_is_published_regularly(tmp_path: Path) -> None:
    slow, fast = (
        published("/slow_speed", "std_msgs/msg/Float64"),
        published("/fast", "std_msgs/msg/Bool"),
    )
    kept = published("/kept", "std_msgs/msg/Bool", transient_local=True)
    seldom = published("/seldom", "std_msgs/msg/String")
    periods = {"/slow_speed": 1.3, "/fast": 0.02, "/kept": 1.0}
    text = text_of(topics=[slow, fast, kept, seldom], periods=periods)
    ages = {name: widget.get("max_age_s") for name, widget in widgets(text).items()}
    assert ages == {"slow_speed": 7, "fast": 2, "kept": None, "seldom": None, "cell_io_trend": 7}
    path = tmp_path / "cell.toml"
    path.write_text(text)
    check_panel(path)


def test_a_topic_that_the_bridge_holds_back_is_a_remark() -> None:
    held = SurveyedTopic(name="/x", key="x", publishers=ENABLED.publishers, announced=False)
    text = text_of(topics=[held], denied=["/x"])
    assert "# - /x: `allow` or `deny` in the bridge's configuration holds it back" in text


def test_topics_that_the_bridge_lost_have_their_own_remark() -> None:
    held = SurveyedTopic(name="/x", key="x", publishers=ENABLED.publishers, announced=False)
    text = text_of(topics=[held], lost=["/x", "/home", "/plc/get_parameters", "/rosout/_hidden"])
    remarks = [line for line in text.splitlines() if line.startswith("# - ")]
    assert remarks == [
        f"# - {name}: the bridge does not forward it: restart its node, or else the bridge"
        for name in ("/x", "/home")
    ]


def test_two_types_on_one_topic_are_a_remark() -> None:
    publishers = (endpoint(BOOL, "/a"), endpoint("std_msgs/msg/Int32", "/b"))
    text = text_of(topics=[SurveyedTopic(name="/x", key="x", publishers=publishers)])
    assert "# - /x: it has several types: std_msgs/msg/Bool, std_msgs/msg/Int32" in text


def test_a_type_of_another_definition_is_a_remark() -> None:
    for hash_, known in ((INTERFACES.type_hash(BOOL), True), ("RIHS01_0", False)):
        publisher = TopicEndpoint(type=BOOL, qos=EndpointQos(), bridge="a", type_hash=hash_)
        text = text_of(topics=[SurveyedTopic(name="/x", key="x", publishers=(publisher,))])
        assert ("x" in widgets(text)) is known
        assert ("# - /x: the robot's std_msgs/msg/Bool has another definition" in text) is not known


def test_texts_of_a_robot_can_not_leave_their_place(tmp_path: Path) -> None:
    evil = NodeParameter(
        node="/plc", name="x", type="string", value='"\n[[page]]\n', description="a\nb = 1\u2028c"
    )
    joints = {"/j": SimpleNamespace(name=['a"\n[x]', "b\u202e"], position=[0.0, 0.0])}
    text = text_of(
        topics=[ENABLED, published("/j", "sensor_msgs/msg/JointState")],
        parameters=[evil],
        samples=joints,
    )
    path = tmp_path / "cell.toml"
    path.write_text(text)
    assert [page["id"] for page in tomllib.loads(text)["page"]] == ["robot"]
    assert [line for line in text.splitlines() if "[[page]]" in line] == [
        "[[page]]",
        """# Now '"\\n[[page]]\\n'. a b = 1 c""",
    ]
    assert "# - /j (joints): joint[0].name: " in text


@pytest.mark.parametrize("value", [1.7e308, -1.7e308, 5e-324, 2.0**53 + 2, 1e300])
def test_a_value_of_any_size_leaves_the_rest_of_the_panel(value: float) -> None:
    text = text_of(
        topics=[published("/speed", "std_msgs/msg/Float64"), ENABLED],
        samples={"/speed": SimpleNamespace(data=value)},
    )
    assert {"speed", "operation_enabled"} <= widgets(text).keys()


@pytest.mark.parametrize("controls", [False, True])
def test_name_that_a_panel_file_cannot_have_is_left_out_with_the_reason(controls: bool) -> None:
    long = f"/{'x' * 300}"
    joints = {"/joints": SimpleNamespace(name=["j1\x07"], position=[0.0])}
    text = text_of(
        controls,
        topics=[ENABLED, published("/joints", "sensor_msgs/msg/JointState"), heard("/start", BOOL)],
        actions=[server(long, "example_interfaces/action/Fibonacci")],
        samples=joints,
    )
    assert widgets(text).keys() >= {"operation_enabled", *(["start"] if controls else [])}
    remarks = [line for line in text.splitlines() if line.startswith("# - ")]
    assert [line.partition(": ")[0] for line in remarks] == [
        "# - /joints (joints)",
        f"# - {long} (action)",
    ]
    assert f'"{long}"' not in text


def test_several_robots_have_their_entries(tmp_path: Path) -> None:
    robots: list[Mapping[str, Any]] = [
        {"id": "robot1", "name": "R1", "namespace": "/r1", "connect": ["tcp/r1:7447"]},
        {"id": "robot2", "name": "R2", "namespace": "/r2"},
    ]
    path = tmp_path / "cell.toml"
    path.write_text(text_of(base=Draft(title="Cells", robots=robots), topics=[ENABLED]))
    panel = check_panel(path).panel
    assert [(robot.namespace, robot.connect) for robot in panel.robots] == [
        ("/r1", ("tcp/r1:7447",)),
        ("/r2", ()),
    ]


@pytest.mark.parametrize(
    ("name", "label", "page"),
    [
        ("/arm/jointStates", "Joint states", ("arm",)),
        ("/speed", "Speed", ("node",)),
        ("/x/y/temp_2", "Temp 2", ("x", "y")),
    ],
)
def test_labels_and_pages_are_made_from_names(name: str, label: str, page: tuple[str, ...]) -> None:
    assert (label_of(name), place_of(name, ["/node"])) == (label, page)


def test_ids_are_valid_and_differ() -> None:
    assert id_of("/2nd/Speed", ()) == "n_2nd_speed"
    assert id_of("/a/b", ("a_b",)) == "a_b_2"
    assert len(id_of("/" + "x" * 300, ())) <= 64


@pytest.mark.parametrize("name", ["/enabled", "/arm/auto", "/guard_closed", "/isReady"])
def test_names_that_permit(name: str) -> None:
    assert permits(name)


@pytest.mark.parametrize("name", ["/e_stop_released", "/fault", "/enable_error", "/gripper_closed"])
def test_names_that_do_not(name: str) -> None:
    assert not permits(name)


@pytest.mark.parametrize(
    ("name", "value", "ends"),
    [
        ("/motor_temperature", None, (0, 100)),
        ("/motor_temperature", 340.0, (0, 500)),
        ("/motor_temperature", -3.0, (-5, 100)),
        ("/motor_temperature", float("nan"), (0, 100)),
        ("/motor_temperature", float("inf"), (0, 100)),
        ("/unheard_of", 340.0, None),  # a readout, not a guess
        ("/wheel_ticks_total", 12.0, None),
        ("/error_code", 3.0, None),
        ("/battery_level", 0.9, (0, 100)),
    ],
)
def test_ranges_fit_the_name_and_the_value(
    name: str, value: float | None, ends: tuple[float, float] | None
) -> None:
    assert range_for(FieldCandidate(field="data", kind="float64"), (name,), value) == ends


def test_times_and_durations_are_shown_as_such(tmp_path: Path) -> None:
    job = tmp_path / "cell_msgs/msg/Job.msg"
    job.parent.mkdir(parents=True)
    job.write_text("builtin_interfaces/Time began\nbuiltin_interfaces/Duration took\n")
    fields = shown_fields("cell_msgs/msg/Job", load_interfaces("jazzy", [tmp_path]))
    assert [(field.field, field.kind) for field in fields] == [
        ("began", "builtin_interfaces/msg/Time"),
        ("took", "builtin_interfaces/msg/Duration"),
    ]


def test_diagnostics_are_proposed_as_alarms() -> None:
    diagnostics = "diagnostic_msgs/msg/DiagnosticArray"
    topics = [
        published("/diagnostics", diagnostics),
        published("/diagnostics_agg", diagnostics),
        published("/arm/health", diagnostics, reliable=False),
    ]
    assert tomllib.loads(text_of(topics=topics))["alarm"] == [
        {"id": "diagnostics", "diagnostics": "*"},
        {
            "id": "arm_health",
            "diagnostics": "*",
            "topic": "/arm/health",
            "qos": {"reliability": "best_effort"},
        },
    ]
    assert "alarm" not in tomllib.loads(text_of(topics=[ENABLED]))


@pytest.mark.parametrize("has_dds_qos", [True, False])
@pytest.mark.parametrize("type_name", [BOOL, "geometry_msgs/msg/Twist"])
@pytest.mark.parametrize("transient_local", [True, False])
@pytest.mark.parametrize("reliable", [True, False])
def test_a_control_is_received_by_the_subscriber_that_it_was_made_for(
    reliable: bool, transient_local: bool, type_name: str, has_dds_qos: bool
) -> None:
    qos = Qos(reliable, transient_local)
    topic = heard("/go", type_name, reliable=reliable, transient_local=transient_local)
    text = text_of(controls=True, topics=[ENABLED, topic], has_dds_qos=has_dds_qos)
    panel = Panel.model_validate(tomllib.loads(text))
    (command,) = panel.commands
    assert isinstance(command, PublishCommand)
    robot = robot_there(panel)
    robot.traits = BRIDGE_TRAITS if has_dds_qos else RMW_ZENOH_TRAITS
    subscribe(robot, "MS", "/go", type_name, qos=qos)
    assert topic_mismatch("MP", command, robot) is None
    assert command.qos.durability == ("transient_local" if transient_local and has_dds_qos else None)
