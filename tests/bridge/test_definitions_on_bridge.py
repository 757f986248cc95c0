"""Definitions of the panel that are not the robot's, and servers on another DDS, on the real bridge."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from tests.support import cyclone
from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, RosNode, Server, publish_until, until
from tests.support.servers import live_server

BOOL = "std_msgs/msg/Bool"
STRING = "std_msgs/msg/String"

# The robot has ROS 2's own definitions.
FILES = {
    "std_msgs/msg/Bool.msg": "bool off\nbool data\n",
    "std_msgs/msg/String.msg": "string data\nint32 length\n",
    "std_srvs/srv/SetBool.srv": "bool force\nbool data\n---\nbool success\nstring message\n",
    "std_srvs/srv/Trigger.srv": "---\nstring message\nbool success\n",
    "example_interfaces/action/Fibonacci.action": (
        "int32 first\nint32 order\n---\nint32[] sequence\n---\nint32[] sequence\n"
    ),
}
PACKAGES = sorted({name.split("/")[0] for name in FILES})
HEAD = 'title = "Cell"\nlanguages = ["en"]\n'
PAGE = """
[[interlock]]
id = "operation"
topic = "/operation_enabled"
type = "std_msgs/msg/Bool"

[[page]]
id = "main"
title = "Main"

[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/said"
type = "std_msgs/msg/String"
message = { data = "hello" }

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Empty"
message = {}
interlock = "operation"

[[page.widget]]
id = "words"
kind = "readout"
label = "Words"
topic = "/words"
type = "std_msgs/msg/String"

[[page.widget]]
id = "enable"
kind = "call"
label = "Enable"
service = "/set_enabled"
type = "std_srvs/srv/SetBool"
request = { data = true }

[[page.widget]]
id = "reset"
kind = "call"
label = "Reset"
service = "/reset"
type = "std_srvs/srv/Trigger"

[[page.widget]]
id = "count"
kind = "action"
label = "Count"
action = "/fibonacci"
type = "example_interfaces/action/Fibonacci"
goal = { order = 1 }
"""
CALLS = {"enable": "/set_enabled", "reset": "/reset", "count": "/fibonacci"}


@pytest.fixture
def robot(
    cyclone_bridge: Bridge, cyclone_robots: Callable[..., CycloneRobot]
) -> Callable[..., CycloneRobot]:
    """Starts a robot on Cyclone DDS behind the bridge."""
    return partial(cyclone_robots, cyclone_bridge.domain)


@pytest.fixture
def fast_node(cyclone_bridge: Bridge) -> Iterator[RosNode]:
    """A node of rclpy, on Fast DDS."""
    mine = RosNode(cyclone_bridge.domain, "fast_node")
    yield mine
    mine.end()


def other_definitions(folder: Path) -> str:
    """The head of a panel file whose definitions are not the robot's."""
    for name, text in FILES.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)
    return HEAD + f"interfaces = {PACKAGES}\n".replace("'", '"')


def code_of(kiosk: Server, widget: str) -> str:
    """The code of the receipt of a press."""
    return str(kiosk.http.post(f"/widgets/{widget}", json={"inputs": {}}).json().get("code"))


def test_a_service_or_an_action_of_another_definition_is_locked_and_never_called(
    cyclone_bridge: Bridge, robot: Callable[..., CycloneRobot], tmp_path: Path
) -> None:
    served = robot()
    with live_server(cyclone_bridge, tmp_path, other_definitions(tmp_path) + PAGE) as kiosk:
        for widget, name in CALLS.items():
            said = until(partial(differs, kiosk, widget), f"{name} is locked")
            assert name in said
            assert code_of(kiosk, widget) == "topic_definition_differs"
        details = kiosk.snapshot()["link"]["node"]["reason"]
        assert served.calls() == []
        assert served.goals() == []
    assert f"({cyclone.NODE})" in details.replace("(/", "(")
    assert "std_srvs/srv/SetBool_Request" in details
    assert details.count("RIHS01_") == 6
    assert "std_srvs/srv/SetBool.srv" in details


def differs(kiosk: Server, widget: str) -> str:
    """Why a widget is locked, or shows nothing, where it is for a definition that differs."""
    shown = kiosk.widget(widget)
    said = str(shown.get("reason") or shown.get("note"))
    return said if said.startswith("Definitions differ") else ""


def is_on_fast_dds(kiosk: Server, widget: str) -> bool:
    return "Fast DDS" in str(kiosk.widget(widget)["reason"])


def test_a_topic_of_another_definition_is_not_read_and_not_written(
    cyclone_bridge: Bridge, fast_node: RosNode, tmp_path: Path
) -> None:
    fast_node.subscribe("/said", STRING)
    fast_node.advertise("/words", STRING, durability="transient_local")
    fast_node.advertise("/operation_enabled", BOOL, durability="transient_local")
    fast_node.publish("/words", {"data": "hello"})
    fast_node.publish("/operation_enabled", {"data": True})
    with live_server(cyclone_bridge, tmp_path, other_definitions(tmp_path) + PAGE) as kiosk:
        for widget, topic in {"say": "/said", "go": "/operation_enabled", "words": "/words"}.items():
            said = until(partial(differs, kiosk, widget), f"{topic} is not used")
            assert topic in said
        assert kiosk.widget("words")["state"] == "unreadable"
        assert (code_of(kiosk, "say"), code_of(kiosk, "go")) == ("topic_definition_differs",) * 2
        assert fast_node.heard("/said") == []


def test_a_second_publisher_of_another_definition_counts_too(
    cyclone_bridge: Bridge,
    fast_node: RosNode,
    cyclone_robots: Callable[..., CycloneRobot],
    tmp_path: Path,
) -> None:
    """The bridge announces only the first publisher of a topic."""
    fast_node.advertise("/words", STRING)
    with live_server(cyclone_bridge, tmp_path, HEAD + PAGE) as kiosk:
        publish_until(fast_node, "/words", {"data": "same"}, lambda: shows(kiosk, "same"))
        other = cyclone_robots(cyclone_bridge.domain)
        other.advertise(topic="/words", type=STRING, hash=f"RIHS01_{'0' * 64}")
        until(partial(differs, kiosk, "words"), "the second publisher is known")
        fast_node.publish("/words", {"data": "of either"})
        assert not shows(kiosk, "of either")
        other.end()
        publish_until(fast_node, "/words", {"data": "again"}, lambda: shows(kiosk, "again"))


def shows(kiosk: Server, text: str) -> bool:
    return bool(kiosk.widget("words")["text"] == text)


def test_without_hashes_nothing_locks_and_the_details_say_so(
    cyclone_bridge: Bridge, robot: Callable[..., CycloneRobot], tmp_path: Path
) -> None:
    robot(hashed=False)
    with live_server(cyclone_bridge, tmp_path, HEAD + PAGE) as kiosk:
        until(lambda: kiosk.widget("enable")["enabled"], "it can be called")
        details = kiosk.snapshot()["link"]["node"]["reason"]
        assert "no type hash for /set_enabled, /reset" in details


def test_a_server_on_fast_dds_is_locked_by_its_vendor(
    cyclone_bridge: Bridge, fast_node: RosNode, tmp_path: Path
) -> None:
    panel = HEAD + (
        '[[page]]\nid = "main"\ntitle = "Main"\n'
        '[[page.widget]]\nid = "list"\nkind = "call"\nlabel = "List"\n'
        'service = "/fast_node/list_parameters"\ntype = "rcl_interfaces/srv/ListParameters"\n'
        '[[page.widget]]\nid = "simulated"\nkind = "parameter"\nlabel = "Simulated time"\n'
        'node = "/fast_node"\nparameter = "use_sim_time"\ntype = "bool"\n'
    )
    with live_server(cyclone_bridge, tmp_path, panel) as kiosk:
        for widget in ("list", "simulated"):
            until(partial(is_on_fast_dds, kiosk, widget), "it is locked")
        assert code_of(kiosk, "list") == "service_wrong_rmw"
        assert "Fast DDS" in kiosk.snapshot()["link"]["node"]["reason"]
