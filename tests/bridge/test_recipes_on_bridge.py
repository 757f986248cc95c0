"""Recipes loaded into nodes and read back, through the real bridge: by parameters and a service of a
node on Cyclone DDS, and by a message to an rclpy node."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("recipes")

PANEL: Final = """
title = "Cyclone cell"
mode = "live"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
unit = "mm/s"
send_unit = "m/s"
min = 0
max = 3000
[[page.widget]]
id = "limit"
kind = "number"
label = "Limit"
min = 0
max = 200
[[page.widget]]
id = "enabled"
kind = "toggle"
label = "Enabled"
[[recipe]]
id = "tunes"
label = "Tunes"
fields = ["speed", "limit", "enabled"]
node = "/cyclone_robot"
parameters = { speed = "speed", limit = "limit", enabled = "enabled" }
parameter_types = { speed = "double" }
confirm_s = 20.0
"""
SLOW: Final = {"speed": 1200, "limit": 40, "enabled": False}


@pytest.fixture
def cell(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        until(lambda: mine.widget("tunes")["enabled"], "the node's parameters can be set")
        yield mine


def make(cell: Server, name: str, values: dict[str, Any]) -> None:
    answer = cell.http.post("/recipes/tunes/create", json={"name": name, "values": values})
    assert answer.json()["done"], answer.text


def load(cell: Server, recipe: str) -> dict[str, Any]:
    answer: dict[str, Any] = cell.http.post("/widgets/tunes", json={"inputs": {"tunes": recipe}}).json()
    return answer


def marked(cell: Server) -> bool:
    page = cell.http.get("/recipes/tunes", params={"recipe": "slow"}).text
    return "<em>In the robot</em>" in page


def test_a_recipe_is_set_in_one_request_and_read_back(cell: Server, robot: CycloneRobot) -> None:
    make(cell, "Slow", SLOW)
    receipt = load(cell, "slow@1")
    assert (receipt["outcome"], receipt["code"]) == ("confirmed", "recipe_loaded"), receipt
    values = robot.parameters()
    assert [values[name] for name in ("speed", "limit", "enabled")] == [1.2, 40, False]
    assert sets(robot) == (1, 0)
    assert marked(cell)


def sets(robot: CycloneRobot) -> tuple[int, int]:
    """The requests that set all values or none, and those that set each on its own."""
    services = ("set_parameters_atomically", "set_parameters")
    atomic, single = (robot.parameter_requests(service=service) for service in services)
    return atomic, single


def test_a_node_that_refuses_one_value_keeps_all_old_ones(cell: Server, robot: CycloneRobot) -> None:
    make(cell, "Slow", SLOW)
    before = robot.parameters()
    robot.refuse_value(name="limit", value=40)  # the second of three
    receipt = load(cell, "slow@1")
    assert (receipt["outcome"], receipt["code"]) == ("rejected", "recipe_kept"), receipt
    assert "parameter 'limit' can't be 40 now" in receipt["reason"]
    assert robot.parameters() == before
    assert sets(robot) == (1, 0)
    assert not marked(cell)


OF_TOPIC: Final = """
title = "Cell"
mode = "live"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "length"
kind = "number"
label = "Length"
unit = "mm"
send_unit = "m"
min = 0
max = 600
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0.0
max = 100.0
[[recipe]]
id = "boxes"
label = "Boxes"
fields = ["length", "speed"]
topic = "/test_recipe"
type = "geometry_msgs/msg/Vector3"
message = { x = "{length}", y = "{speed}" }
confirm_s = 10.0
[recipe.readback]
topic = "/test_recipe_now"
type = "geometry_msgs/msg/Vector3"
fields = { length = "x", speed = "y" }
"""
OF_SERVICE: Final = """
[[recipe]]
id = "tunes"
label = "Tunes"
fields = ["enabled"]
service = "/set_enabled"
type = "std_srvs/srv/SetBool"
request = { data = "{enabled}" }
answer = "the node says {success}"
"""
READ_BACK: Final = """
[recipe.readback]
topic = "/enabled_now"
type = "std_msgs/msg/Bool"
fields = { enabled = "data" }
"""
OF_NODES_SERVICE: Final = """
title = "Cell"
mode = "live"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "program"
kind = "text"
label = "Program"
[[page.widget]]
id = "layers"
kind = "number"
label = "Layers"
min = 1
max = 10
[[recipe]]
id = "programs"
label = "Programs"
fields = ["program", "layers"]
service = "/load_program"
type = "rcl_interfaces/srv/ListParameters"
request = { prefixes = ["{program}"], depth = "{layers}" }
confirm_s = 10.0
[recipe.readback]
topic = "/program_now"
type = "rcl_interfaces/msg/Log"
fields = { program = "name", layers = "line" }
"""
BOX: Final = {"length": 400, "speed": 80.0}


@pytest.fixture
def boxes(bridge: Bridge, node: RosNode, tmp_path: Path) -> Iterator[Server]:
    node.subscribe("/test_recipe", "geometry_msgs/msg/Vector3")
    node.advertise("/test_recipe_now", "geometry_msgs/msg/Vector3")
    with live_server(bridge, tmp_path, OF_TOPIC) as mine:
        until(lambda: mine.widget("boxes")["enabled"], "the node hears")
        until(lambda: node.endpoints("/test_recipe"), "the node sees who publishes")
        until(lambda: node.subscribers("/test_recipe_now"), "the panel listens")
        yield mine
        node.withdraw("/test_recipe_now")


def loaded(cell: Server, node: RosNode, reported: dict[str, float]) -> dict[str, Any]:
    """The receipt of a load: the node reports these values when it has heard the message."""
    made = cell.http.post("/recipes/boxes/create", json={"name": "Box", "values": BOX})
    assert made.json()["done"], made.text
    press = {"inputs": {"boxes": "box@1"}}
    before = len(node.heard("/test_recipe"))
    with ThreadPoolExecutor() as pool:
        pressed = pool.submit(partial(cell.http.post, "/widgets/boxes", json=press))
        until(lambda: len(node.heard("/test_recipe")) > before, "the node heard the recipe")
        node.publish("/test_recipe_now", reported)
        receipt: dict[str, Any] = pressed.result().json()
    return receipt


def test_a_recipe_is_sent_in_one_message_and_read_back_on_a_topic(boxes: Server, node: RosNode) -> None:
    receipt = loaded(boxes, node, {"x": 0.4, "y": 80.0, "z": 0.0})
    assert (receipt["outcome"], receipt["code"]) == ("confirmed", "recipe_loaded"), receipt
    assert node.heard("/test_recipe")[-1] == {"x": 0.4, "y": 80.0, "z": 0.0}


def test_a_value_that_the_node_reports_otherwise_is_named(boxes: Server, node: RosNode) -> None:
    receipt = loaded(boxes, node, {"x": 0.4, "y": 60.0, "z": 0.0})
    assert (receipt["outcome"], receipt["code"]) == ("rejected", "recipe_not_taken"), receipt
    assert "Speed" in receipt["reason"]
    assert "Length" not in receipt["reason"]


def called(cell: Server, robot: CycloneRobot, reported: bool) -> dict[str, Any]:
    """The receipt of a load by a service of the node, which reports this value then."""
    make(cell, "Slow", {"enabled": True})
    before = len(robot.requests("/set_enabled"))
    with ThreadPoolExecutor() as pool:
        pressed = pool.submit(load, cell, "slow@1")
        until(lambda: len(robot.requests("/set_enabled")) > before, "the node was called")
        robot.publish(topic="/enabled_now", fields={"data": reported})
        receipt = pressed.result()
    assert robot.requests("/set_enabled")[-1] == {"data": True}
    return receipt


@pytest.fixture
def enabling(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    robot.answer_set_enabled(success=True)
    robot.advertise(topic="/enabled_now", type="std_msgs/msg/Bool")
    panel = PANEL.partition("[[recipe]]")[0] + OF_SERVICE + READ_BACK
    with live_server(cyclone_bridge, tmp_path, panel) as mine:
        until(lambda: mine.widget("tunes")["enabled"], "the service can be called")
        until(lambda: robot.subscribers(topic="/enabled_now"), "the panel listens")
        yield mine


def test_a_recipe_is_loaded_by_a_service_and_read_back(enabling: Server, robot: CycloneRobot) -> None:
    receipt = called(enabling, robot, reported=True)
    assert (receipt["outcome"], receipt["code"]) == ("confirmed", "recipe_loaded"), receipt
    assert "the node says True" in receipt["reason"]


def test_a_value_that_is_reported_otherwise_after_the_call_is_named(
    enabling: Server, robot: CycloneRobot
) -> None:
    receipt = called(enabling, robot, reported=False)
    assert (receipt["outcome"], receipt["code"]) == ("rejected", "recipe_not_taken"), receipt
    assert "Enabled" in receipt["reason"]


def test_a_service_on_fast_dds_locks_the_load(bridge: Bridge, node: RosNode, tmp_path: Path) -> None:
    node.serve("/load_program", "rcl_interfaces/srv/ListParameters", {"result": {"names": ["ok"]}})
    with live_server(bridge, tmp_path, OF_NODES_SERVICE) as mine:
        until(lambda: "runs on Fast DDS" in mine.widget("programs")["reason"], "the reason is known")
        program = {"name": "Wrap", "values": {"program": "wrap", "layers": 6}}
        assert mine.http.post("/recipes/programs/create", json=program).json()["done"]
        receipt = mine.http.post("/widgets/programs", json={"inputs": {"programs": "wrap@1"}}).json()
        assert receipt["outcome"] == "refused", receipt
    assert node.requested("/load_program") == []


def test_a_recipe_is_loaded_by_a_call(
    cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path
) -> None:
    panel = PANEL.partition("[[recipe]]")[0] + OF_SERVICE
    with live_server(cyclone_bridge, tmp_path, panel) as mine:
        until(lambda: mine.widget("tunes")["enabled"], "the service can be called")
        make(mine, "Slow", {"enabled": True})
        receipt = load(mine, "slow@1")
        assert (receipt["outcome"], receipt["code"]) == ("succeeded", "recipe_sent"), receipt
        assert robot.requests("/set_enabled") == [{"data": True}]
        robot.answer_set_enabled(success=False, message="the door is open")
        refused = load(mine, "slow@1")
        assert refused["outcome"] == "rejected", refused
        assert "the door is open" in refused["reason"]
