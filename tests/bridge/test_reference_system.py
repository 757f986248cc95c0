"""The reference system on the real parts: bridge, rclpy nodes, the server as users start it, with the
shipped panel; and the same on a router with a node on rmw_zenoh."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from socket import create_connection

import pytest
import zenoh

from tests.support.form import several
from tests.support.parts import REFERENCE, Bridge, RosNode, Server, arrives, has_heard, live, until
from tests.support.rmw import RmwNode, Router
from tests.support.samples import TEXTS

pytestmark = pytest.mark.promise("locks")

STARTS = several(6, 100)
STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


@pytest.fixture(scope="module", params=["bridge", "rmw_zenoh"])
def dialect(request: pytest.FixtureRequest) -> str:
    """The tests run on robots of each kind. The panel file does not say which it is."""
    return str(request.param)


@pytest.fixture(scope="module")
def way(dialect: str, domain: int, request: pytest.FixtureRequest) -> Iterator[Bridge]:
    """The bridge that tests share, or the router of nodes on rmw_zenoh."""
    if dialect == "bridge":
        yield request.getfixturevalue("bridge")
        return
    router = Router()
    router.start()
    yield router
    router.end()


@pytest.fixture(scope="module")
def robot(dialect: str, way: Bridge, request: pytest.FixtureRequest) -> Iterator[RosNode]:
    """The robot's system_controller: subscribes to the panel's topics."""
    if dialect == "bridge":
        yield request.getfixturevalue("node")
        return
    node = RmwNode(way)
    for topic in ("/operation", "/operation1", "/operation2"):
        node.subscribe(topic, "std_msgs/msg/String")
    node.subscribe("/rosout", "rcl_interfaces/msg/Log", depth=1000)
    yield node
    node.end()


@pytest.fixture
def own_way(dialect: str, domain: int, request: pytest.FixtureRequest) -> Iterator[Bridge]:
    """One which a test may end and start again."""
    if dialect == "bridge":
        yield request.getfixturevalue("own_bridge")
        return
    router = Router()
    router.start()
    yield router
    router.end()


@pytest.fixture
def own_robot(dialect: str, own_way: Bridge, request: pytest.FixtureRequest) -> Iterator[RosNode]:
    """A node on `own_way`."""
    if dialect == "bridge":
        yield request.getfixturevalue("own_node")
        return
    node = RmwNode(own_way)
    yield node
    node.end()


@pytest.fixture
def server(way: Bridge, robot: RosNode, tmp_path: Path) -> Iterator[Server]:
    """A server for one test, on the shared bridge."""
    mine = live(way.endpoint, tmp_path, KIOSK_PANEL=str(REFERENCE))
    yield mine
    mine.end()


def permit(server: Server, robot: RosNode, value: bool = True) -> None:
    """By a publisher that goes again at once. What that says may be lost: then another one says it."""

    def says_so() -> bool:
        robot.once("/operation_enabled", "std_msgs/msg/Bool", {"data": value})
        shown = server.widget("operation2")
        return bool(shown["enabled"] if value else "does not permit" in (shown["reason"] or ""))

    until(says_so, f"permitted: {value}")


def test_a_node_sees_web_ui(shared_server: Server, robot: RosNode) -> None:
    until(lambda: "/web_ui" in robot.nodes(), "/web_ui in the list of nodes")


@pytest.mark.long("every screen")
@pytest.mark.parametrize("text", TEXTS)
def test_a_press_reaches_the_robot_with_its_text_intact(
    shared_server: Server, robot: RosNode, text: str
) -> None:
    before = len(robot.heard("/operation"))
    answer = shared_server.press("operation", text)
    assert (answer.status_code, answer.json()["outcome"]) == (200, "published")
    until(lambda: len(robot.heard("/operation")) > before, "the robot heard it")
    assert robot.heard_data("/operation")[before:] == [text]


@contextmanager
def known(way: Bridge, robot: RosNode, folder: Path) -> Iterator[Server]:
    """A kiosk on a bridge that knows what the node listens to."""
    mine = live(way.endpoint, folder, KIOSK_PANEL=str(REFERENCE))
    try:
        until(mine.ready, "ready")
        until(partial(arrives, mine, robot), "the bridge knows what the node listens to", every_s=0.1)
        yield mine
    finally:
        mine.end()


@pytest.fixture(scope="module")
def shared_server(
    way: Bridge, robot: RosNode, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    with known(way, robot, tmp_path_factory.mktemp("shared")) as mine:
        yield mine


def test_the_graph_has_the_topic_before_the_first_press(server: Server, robot: RosNode) -> None:
    until(server.ready, "ready")
    until(lambda: robot.endpoints("/operation1"), "a publisher of /operation1")
    assert robot.topics()["/operation1"] == ["std_msgs/msg/String"]
    for endpoint in robot.endpoints("/operation1"):  # on rmw_zenoh each panel is a node of its own
        assert endpoint["type"] == "std_msgs/msg/String"
        assert endpoint["reliability"] == "reliable"
        assert STRING_HASH.removeprefix("RIHS01_") in endpoint["hash"].lower()


def test_two_publishers_of_one_type_have_a_topic_each(server: Server, robot: RosNode) -> None:
    until(server.ready, "ready")
    permit(server, robot)
    heard_on_1, two = len(robot.heard("/operation1")), len(robot.heard("/operation2"))
    assert server.press("operation1", "to one").json()["outcome"] == "published"
    assert server.press("operation2", "to two").json()["outcome"] == "published"
    until(lambda: len(robot.heard("/operation2")) > two, "heard on /operation2")
    until(lambda: len(robot.heard("/operation1")) > heard_on_1, "heard on /operation1")
    assert robot.heard_data("/operation1")[heard_on_1:] == ["to one"]
    assert robot.heard_data("/operation2")[two:] == ["to two"]


def test_unknown_permission_locks_and_says_what_is_missing(server: Server) -> None:
    until(server.ready, "ready")
    shown = server.widget("operation1")
    assert shown["enabled"] is False
    assert "is not known yet" in shown["reason"]
    assert server.widget("operation")["enabled"] is True  # it has no interlock
    refused = server.press("operation1", "too soon")
    assert refused.status_code == 409
    assert refused.json()["outcome"] == "refused"
    assert "is not known yet" in refused.json()["reason"]


def test_a_value_published_once_counts_after_its_publisher_is_gone(
    server: Server, robot: RosNode
) -> None:
    until(server.ready, "ready")
    with server.stream() as stream:
        stream.next("snapshot")
        permit(server, robot, True)
        name, data, _ = stream.next("operation-enabled-updated")
        assert (name, data) == ("operation-enabled-updated", {"enabled": True, "reason": None})
        permit(server, robot, False)  # by another publisher, which may be seen before it says anything
        _, data, _ = stream.next("operation-enabled-updated")
        assert data["enabled"] is False
    refused = server.press("operation2", "forged")
    assert refused.status_code == 409
    assert "does not permit" in refused.json()["reason"]
    permit(server, robot, True)
    until(lambda: not robot.endpoints("/operation_enabled"), "its publisher is gone")
    assert server.widget("operation2")["enabled"] is True
    assert server.press("operation2", "still").json()["outcome"] == "published"


def test_a_page_loaded_later_shows_the_true_state_in_its_html(server: Server, robot: RosNode) -> None:
    until(server.ready, "ready")
    locked = re.compile(r'formaction="/widgets/operation1"[^>]* disabled')
    assert locked.search(server.http.get("/pages/operation").text)
    permit(server, robot, True)
    assert not locked.search(server.http.get("/pages/operation").text)
    permit(server, robot, False)
    html = server.http.get("/pages/operation").text
    assert locked.search(html)
    assert "The robot does not permit operation" in html


@pytest.mark.parametrize("robot_first", [True, False])
def test_a_transient_local_value_arrives_in_either_order_of_start(
    own_way: Bridge,
    own_robot: RosNode,
    tmp_path: Path,
    servers: Callable[[Server], Server],
    robot_first: bool,
) -> None:
    def robot_speaks() -> None:
        latched = {"durability": "transient_local", "depth": 1}
        own_robot.advertise("/operation_enabled", "std_msgs/msg/Bool", **latched)
        own_robot.publish("/operation_enabled", {"data": True})

    if robot_first:
        robot_speaks()
    kiosk = servers(live(own_way.endpoint, tmp_path, KIOSK_PANEL=str(REFERENCE)))
    until(kiosk.ready, "ready")
    if not robot_first:
        robot_speaks()
    until(lambda: kiosk.widget("operation1")["enabled"], "the last value came")


def test_the_first_press_after_each_start_is_received(
    own_way: Bridge, own_robot: RosNode, tmp_path: Path
) -> None:
    own_robot.subscribe("/operation", "std_msgs/msg/String")
    texts = [f"first {number}" for number in range(STARTS)]
    with known(own_way, own_robot, tmp_path):
        pass
    before = len(own_robot.heard("/operation"))
    for number, text in enumerate(texts):
        kiosk = live(own_way.endpoint, tmp_path, KIOSK_PANEL=str(REFERENCE))
        try:
            until(kiosk.ready, "ready", every_s=0.001)
            assert kiosk.press("operation", text).json()["outcome"] == "published"
            until(partial(has_heard, own_robot, "/operation", before + number + 1), "heard")
        finally:
            kiosk.end()
    assert own_robot.heard_data("/operation")[before:] == texts


def test_a_press_without_a_subscriber_is_unknown_and_says_so(
    own_way: Bridge, own_robot: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(live(own_way.endpoint, tmp_path, KIOSK_PANEL=str(REFERENCE)))
    until(kiosk.ready, "ready")
    answer = kiosk.press("operation", "anybody?")
    assert answer.status_code == 200
    assert answer.json()["outcome"] == "unknown"
    assert "no node is known to receive it" in answer.json()["reason"]


def test_logs_are_in_ros_format_and_on_rosout(server: Server, robot: RosNode) -> None:
    until(server.ready, "ready")
    until(partial(arrives, server, robot), "the bridge knows what the node listens to", every_s=0.1)
    line = re.compile(r"\[(INFO|WARN|ERROR|FATAL)\] \[\d{10}\.\d{9}\] \[web_ui\]: .+|  .*")
    assert all(line.fullmatch(text) for text in server.process.lines)
    server.press("operation", "typed in", id="for-the-log")
    entry = on_rosout(robot, "press for-the-log of operation by a program (127.0.0.1): published: Sent")
    assert (entry["name"], entry["level"]) == ("web_ui", 20)
    assert server.process.count("typed in")


def on_rosout(robot: RosNode, text: str) -> dict[str, object]:
    """The message there with this text, when it has come."""
    lines: list[dict[str, object]] = until(
        lambda: [m for m in robot.heard("/rosout") if text in str(m["msg"])], f"{text} on /rosout"
    )
    return lines[0]


def test_typed_text_and_uvicorn_lines_are_not_on_rosout(server: Server, robot: RosNode) -> None:
    until(server.ready, "ready")
    before = len(robot.heard("/rosout"))
    head = "POST /widgets/operation HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    with create_connection(("127.0.0.1", server.port)) as client:
        client.sendall(f"{head}Content-Length: 100\r\n\r\n{{".encode())  # and drops it
    with server.socket() as press_socket:
        press_socket.press(widget="operation", inputs={"message": "typed in" * 20}, id="bad")
        press_socket.press(widget="operation", inputs={"message": "typed in"}, id="good")
    server.press("operation", "typed in", id="good")
    server.press("operation", "typed in otherwise", id="good")
    server.press("operation", "typed in", id="the-last")
    on_rosout(robot, "press the-last of operation by a program (127.0.0.1): ")
    said = [str(message["msg"]) for message in robot.heard("/rosout")[before:]]
    assert [text for text in said if text.startswith("press bad of operation by ")] == [
        "press bad of operation by a program (127.0.0.1): refused"
    ]
    never = ("typed in", "Traceback", "ClientDisconnect", "WebSocket", "connection open")
    assert [text for text in said if any(words in text for words in never)] == []


def test_debug_is_hidden_unless_asked_for(
    way: Bridge, robot: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    quiet = servers(live(way.endpoint, tmp_path, KIOSK_PANEL=str(REFERENCE)))
    loud = servers(live(way.endpoint, tmp_path, KIOSK_LOG_LEVEL="debug"))
    for kiosk in (quiet, loud):
        kiosk.http.get("/")
    until(lambda: '"GET / HTTP/1.1"' in loud.process.text, "the request is logged")
    assert '"GET / HTTP/1.1"' not in quiet.process.text


@pytest.mark.parametrize("robot_first", [True, False])
def test_type_that_differs_on_the_robot_locks_and_is_named(
    own_way: Bridge,
    own_robot: RosNode,
    tmp_path: Path,
    servers: Callable[[Server], Server],
    robot_first: bool,
) -> None:
    def robot_joins() -> None:
        own_robot.subscribe("/operation", "std_msgs/msg/Bool")
        own_robot.advertise("/operation_enabled", "std_msgs/msg/String")

    if robot_first:
        robot_joins()
    kiosk = servers(live(own_way.endpoint, tmp_path, KIOSK_PANEL=str(REFERENCE)))
    until(kiosk.answers, "answers")
    if not robot_first:
        until(kiosk.ready, "ready: a bridge's routes have the kiosk's types")
        robot_joins()

    def wrong(widget: str) -> bool:
        return "is std_msgs/msg/" in (kiosk.widget(widget)["reason"] or "")

    until(lambda: wrong("operation") and wrong("operation1"), "both mismatches are shown")
    assert "std_msgs/msg/Bool on the robot" in kiosk.widget("operation")["reason"]
    assert "std_msgs/msg/String on the robot" in kiosk.widget("operation1")["reason"]
    assert kiosk.press("operation", "x").status_code == 409
    assert not kiosk.widget("operation2")["enabled"]


def test_a_namespaced_robot(domain: int, tmp_path: Path, servers: Callable[[Server], Server]) -> None:
    named = Bridge(domain + 2, namespace="/robot1")
    named.start()
    robot = RosNode(named.domain)
    try:
        robot.subscribe("/operation", "std_msgs/msg/String")
        panel = tmp_path / "panel.toml"
        text = REFERENCE.read_text()
        panel.write_text(text.replace('namespace = ""', 'namespace = "/robot1"'))
        kiosk = servers(live(named.endpoint, tmp_path, KIOSK_PANEL=str(panel)))
        until(kiosk.ready, "ready")
        until(partial(arrives, kiosk, robot), "robot1 hears a press")
    finally:
        robot.end()
        named.end()


def test_a_route_that_another_program_made_with_a_wrong_type_locks(
    own_bridge: Bridge, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{own_bridge.endpoint}"]')
    with zenoh.open(config) as other:
        key = f"@/{other.zid()}/@ros2_lv/MP/operation/std_msgs§msg§Bool/:::"
        token = other.liveliness().declare_token(key)
        routes = "@/*/ros2/route/topic/sub/operation"
        until(lambda: list(other.get(routes, timeout=1)), "the wrong route is there")
        kiosk = servers(live(own_bridge.endpoint, tmp_path, KIOSK_PANEL=str(REFERENCE)))
        until(
            lambda: "std_msgs/msg/Bool on the robot" in (kiosk.widget("operation")["reason"] or ""),
            "locked for the route's type",
        )
        assert kiosk.press("operation", "x").status_code == 409
        token.undeclare()
        until(lambda: kiosk.widget("operation")["enabled"], "open again")
