"""How a panel of a larger robot is arranged: labels that differ, permissions of the same namespace,
pages by namespace and node, and the reasons of topics without a widget."""

import tomllib
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.panel.file.load import faults_of_text
from app.ros.graph.model import SurveyedTopic
from app.ros.messages import Interfaces, load_interfaces
from app.tools.scaffold.checked import checked_draft
from app.tools.scaffold.draft import MOST_PAGES, MOST_WIDGETS, NO_ROOM, Known, make_draft
from app.tools.scaffold.parts import Draft, own_labels
from app.tools.scaffold.toml_text import toml_text
from tests.tools.scaffold.test_scaffold import BOOL, INTERFACES, heard, published, server, widgets

TRIGGER = "std_srvs/srv/Trigger"
# As vendors have them: an enumeration with and without a prefix, a LED, wheels.
MESSAGES = {
    "DriveMode": "uint8 MODE_IDLE=0\nuint8 MODE_AUTO=1\nuint8 MODE_FAULT=2\nuint8 drive_mode",
    "Hazard": "uint8 BUMP=0\nuint8 CLIFF=1\nuint8 STALL=2\nuint8 type",
    "Limits": "uint8 MAX_JOINTS=6\nuint8 MIN_JOINTS=1\nuint8 joints",
    "LedColor": "uint8 red\nuint8 green\nuint8 blue",
    "Wheels": "int32 ticks_left\nint32 ticks_right\nfloat32 current_left",
}


@pytest.fixture(scope="module")
def cell_msgs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ws")
    (folder / "cell_msgs/msg").mkdir(parents=True)
    for name, text in MESSAGES.items():
        (folder / "cell_msgs/msg" / f"{name}.msg").write_text(f"{text}\n")
    return folder


def text_of(
    interfaces: Interfaces = INTERFACES, folder: Path = Path(), controls: bool = False, **known: Any
) -> str:
    base = Draft(title="Cell", interfaces=["cell_msgs"] if folder != Path() else ())
    draft, faults = checked_draft(
        partial(make_draft, Known(**known), interfaces, base, controls),
        partial(faults_of_text, folder=folder),
    )
    assert not faults
    return toml_text(draft, controls)


def of_cell_msgs(folder: Path, *topics: SurveyedTopic) -> str:
    return text_of(load_interfaces("jazzy", [folder / "cell_msgs"]), folder, topics=topics)


def pages(text: str) -> dict[str, list[str]]:
    """The ids of each page's widgets."""
    return {
        page["title"]: [widget["id"] for widget in page.get("widget", ())]
        for page in tomllib.loads(text)["page"]
    }


@pytest.mark.parametrize(
    ("names", "labels"),
    [
        (["/left/home", "/right/home"], ["Left home", "Right home"]),
        (["/cell/left/home", "/cell/right/home"], ["Left home", "Right home"]),
        (["/home", "/right/home"], ["Home", "Right home"]),
        (["/left/home", "/left/gripper/home"], ["Home", "Gripper home"]),
        (["/armLeft/home", "/arm_left/home"], ["Arm left home", "/arm_left/home"]),
        (["/home", "/home"], ["Home", "/home"]),
    ],
)
def test_equal_labels_get_the_part_that_differs(names: list[str], labels: list[str]) -> None:
    assert own_labels([("Home", name) for name in names]) == labels
    assert own_labels([("Home", names[0]), ("Speed", names[1])]) == ["Home", "Speed"]


ARMS: dict[str, Any] = {
    "topics": [published(f"/{arm}/enabled", BOOL, f"/{arm}/io") for arm in ("left", "right")]
    + [heard("/light", BOOL), heard("/table/turn", BOOL)],
    "services": [server(f"/{arm}/home", TRIGGER) for arm in ("left", "right")],
}


def test_control_uses_the_interlock_of_its_namespace() -> None:
    text = text_of(controls=True, **ARMS)
    by_id = widgets(text)
    assert {name: by_id[name]["interlock"] for name in ("left_home", "right_home")} == {
        "left_home": "left_enabled",
        "right_home": "right_enabled",
    }
    assert {by_id[name]["label"] for name in ("left_home", "right_home")} == {"Left home", "Right home"}
    labels = {load["id"]: load["label"] for load in tomllib.loads(text)["interlock"]}
    assert labels == {"left_enabled": "left enabled", "right_enabled": "right enabled"}
    # Neither arm's permission says anything of the light and the table.
    assert not {"light", "table_turn"} & by_id.keys()
    assert '# topic = "/light"' in text


def test_interlock_of_an_outer_namespace_counts_without_an_own_interlock() -> None:
    own = published("/left/enabled", BOOL, "/left/io")
    text = text_of(
        controls=True,
        topics=[
            published("/cell_enabled", BOOL),
            own,
            heard("/left/arm/go", BOOL),
            heard("/light", BOOL),
        ],
        services=[server("/right/home", TRIGGER)],
    )
    by_id = {
        name: widget["interlock"] for name, widget in widgets(text).items() if "interlock" in widget
    }
    assert by_id == {
        "left_arm_go": "left_enabled",
        "right_home": "cell_enabled",
        "light": "cell_enabled",
    }


def test_controls_without_a_namespace_use_the_only_namespaces_interlock() -> None:
    text = text_of(controls=True, topics=[published("/safety/ok_enabled", BOOL), heard("/start", BOOL)])
    assert widgets(text)["start"]["interlock"] == "safety_ok_enabled"


def test_a_permission_of_the_control_s_own_node_comes_first() -> None:
    topics = [published("/a_enabled", BOOL, "/plc"), published("/b_enabled", BOOL, "/io")]
    text = text_of(controls=True, topics=[*topics, heard("/start", BOOL, "/io")])
    assert widgets(text)["start"]["interlock"] == "b_enabled"


def test_an_enumeration_is_a_lamp_with_its_constants(cell_msgs: Path) -> None:
    topics = [published(f"/{name.lower()}", f"cell_msgs/msg/{name}") for name in MESSAGES]
    by_id = widgets(of_cell_msgs(cell_msgs, *topics))
    modes = by_id["drivemode_drive_mode"]["states"]
    assert [(mode["value"], mode["text"], mode["shape"]) for mode in modes] == [
        ("MODE_IDLE", "Idle", "circle"),
        ("MODE_AUTO", "Auto", "circle"),
        ("MODE_FAULT", "Fault", "cross"),
    ]
    assert [state["value"] for state in by_id["hazard_type"]["states"]] == ["BUMP", "CLIFF", "STALL"]
    assert by_id["limits_joints"]["kind"] != "indicator"  # its constants are limits


def test_numbers_without_a_known_scale_are_no_gauges_and_colours_have_no_widget(
    cell_msgs: Path,
) -> None:
    topics = [published(f"/{name.lower()}", f"cell_msgs/msg/{name}") for name in ("LedColor", "Wheels")]
    text = of_cell_msgs(cell_msgs, *topics, published("/lamp", "std_msgs/msg/ColorRGBA"))
    kinds = {name: widget["kind"] for name, widget in widgets(text).items()}
    assert (kinds["wheels_ticks_left"], kinds["wheels_ticks_right"]) == ("readout", "readout")
    assert not any("led" in name or "lamp" in name for name in kinds)
    assert "# - /ledcolor (cell_msgs/msg/LedColor): no widget shows a colour" in text
    assert "# - /lamp (std_msgs/msg/ColorRGBA): no widget shows a colour" in text


def test_pages_are_by_namespace_then_node_and_none_has_too_many() -> None:
    topics = [published(f"/arm/{part}/t{n}", BOOL) for part in ("base", "hand") for n in range(12)]
    topics += [published(f"/t{n:02}", BOOL, f"/node_{n % 2}") for n in range(75)]
    by_title = pages(text_of(topics=topics))
    assert set(by_title) == {
        *("Arm base", "Arm hand"),
        *(f"Node {node}{n}" for node in (0, 1) for n in ("", " 2", " 3")),
    }
    assert max(map(len, by_title.values())) <= MOST_WIDGETS
    assert sum(map(len, by_title.values())) == len(topics)


def test_small_namespaces_share_the_page_of_their_outer_namespace() -> None:
    topics = [published("/left/enabled", BOOL)]
    topics += [
        published(f"/left/joint_{n}/{part}", BOOL) for n in range(1, 7) for part in ("hot", "jam", "on")
    ]
    by_title = pages(text_of(topics=topics, services=[server("/left/home", TRIGGER)]))
    assert {title: len(ids) for title, ids in by_title.items()} == {"Left": 16, "Left joint 6": 3}
    assert "left_enabled" in by_title["Left"]


def test_many_small_nodes_share_pages() -> None:
    topics = [published(f"/t{n:02}_{m}", BOOL, f"/node_{n:02}") for n in range(20) for m in range(3)]
    text = text_of(topics=topics)
    assert NO_ROOM not in text
    by_title = pages(text)
    assert (len(by_title), sum(map(len, by_title.values()))) == (MOST_PAGES, 60)
    assert {title for title in by_title if title.startswith("Robot")} == {"Robot", "Robot 2", "Robot 3"}


def test_widget_without_room_is_named() -> None:
    topics = [published(f"/t{n:03}", BOOL) for n in range(MOST_PAGES * MOST_WIDGETS + 2)]
    text = text_of(topics=topics)
    by_title = pages(text)
    assert (len(by_title), max(map(len, by_title.values()))) == (MOST_PAGES, MOST_WIDGETS)
    assert text.count(NO_ROOM) == 2


@pytest.mark.parametrize(
    ("name", "type_name", "why"),
    [
        ("/tf", "tf2_msgs/msg/TFMessage", "/tf: the tree of frames is drawn by tools such as RViz"),
        ("/costmap", "nav_msgs/msg/OccupancyGrid", "/costmap (nav_msgs/msg/OccupancyGrid): it is not"),
        ("/scan", "sensor_msgs/msg/LaserScan", "/scan (sensor_msgs/msg/LaserScan): a laser scan is dr"),
        (
            "/robot_description",
            "std_msgs/msg/String",
            "/robot_description: the robot's model is a whole",
        ),
        ("/pose", "geometry_msgs/msg/Pose", "/pose (geometry_msgs/msg/Pose): no field of it is a"),
    ],
)
def test_topic_that_cannot_be_shown_is_named_with_the_reason(
    name: str, type_name: str, why: str
) -> None:
    text = text_of(topics=[published(name, type_name)])
    assert widgets(text) == {}
    assert f"# - {why}" in text


def test_a_text_of_many_characters_is_named_in_place_of_a_readout() -> None:
    topics = [published("/urdf", "std_msgs/msg/String"), published("/mode", "std_msgs/msg/String")]
    samples = {"/urdf": SimpleNamespace(data="x" * 200_000), "/mode": SimpleNamespace(data="auto")}
    text = text_of(topics=topics, samples=samples)
    assert widgets(text).keys() == {"mode"}
    assert "# - /urdf: its text of 200,000 characters is too long for a page" in text
    assert len(text) < 3000
