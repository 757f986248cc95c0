"""One kiosk for several robots: each press reaches the one that was on the screen, and no other."""

import json
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
import zenoh
from playwright.sync_api import Page, expect
from websockets.exceptions import InvalidStatus

from app.panel import load_panel
from app.system.errors import PanelError
from tests.support.builders import faults_text
from tests.support.parts import (
    ENOUGH_S,
    REFERENCE,
    ROOT,
    Bridge,
    Process,
    RosNode,
    Server,
    free_port,
    has_heard,
    live,
    until,
)
from tests.support.servers import ready

pytestmark = pytest.mark.promise("control")

MANY = 10
PANEL = REFERENCE.read_text()
TEXT = "std_msgs/msg/String"


def panel_file(folder: Path, *robots: str) -> Path:
    """The shipped panel, for several robots: their tables without the heading."""
    tables = "".join(f"[[robot]]\n{robot}\n" for robot in robots)
    path = folder / "robots.toml"
    path.write_text(
        PANEL.replace('namespace = ""\n', "").replace("[[interlock]]", f"{tables}[[interlock]]", 1)
    )
    return path


def entry(number: int, connect: str | None = None) -> str:
    where = "" if connect is None else f'connect = ["{connect}"]\n'
    return f'id = "r{number}"\nname = "Robot {number}"\nnamespace = "/robot{number}"\n{where}'


@pytest.fixture(scope="module")
def ten(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Ten demo robots behind one server."""
    folder = tmp_path_factory.mktemp("ten")
    path = panel_file(folder, *(entry(number + 1) for number in range(MANY)))
    with ready(Server(ROOT, KIOSK_PANEL=str(path))) as mine:
        yield mine


def heard(server: Server) -> str:
    return str(server.widget("last_heard")["text"])


def shows(server: Server, text: str) -> bool:
    return heard(server) == text


def permitted(server: Server) -> bool:
    return bool(server.widget("operation1")["enabled"])


def test_each_of_ten_robots_gets_its_own_presses(ten: Server) -> None:
    robots = [ten.robot(f"r{number + 1}") for number in range(MANY)]
    for number, robot in enumerate(robots):
        robot = robot.by(("post", "socket")[number % 2])
        assert robot.press("operation", f"for {number}").json()["outcome"] == "published"
    for number, robot in enumerate(robots):
        wanted = f"for {number} (/operation)"
        until(partial(shows, robot, wanted), f"robot {number} heard it")


def test_a_page_is_of_one_robot_and_leads_to_the_others(ten: Server) -> None:
    html = ten.http.get("/robots/r3/pages/operation").text
    assert "<h1><b>Robot 3</b> <span>Robot cell 1</span></h1>" in html
    assert 'formaction="/robots/r3/widgets/operation"' in html
    assert 'formaction="/widgets/' not in html
    for number in range(1, MANY + 1):
        assert f'href="/robots/r{number}/pages/operation"' in html


@pytest.mark.parametrize("path", ["/", "/pages/operation"])
def test_a_page_without_a_robot_leads_to_the_first(ten: Server, path: str) -> None:
    answer = ten.http.get(path)
    assert (answer.status_code, answer.headers["location"]) == (303, f"/robots/r1{path}")


def test_single_robot_with_its_own_path_is_not_shown_as_several(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(Server(ROOT, KIOSK_PANEL=str(panel_file(tmp_path, entry(1)))))
    until(kiosk.ready, "ready")
    error = kiosk.press("operation", "whose?").json()["error"]
    assert error == "this panel has a robot with a path of its own: begin with /robots/r1/"


def test_press_without_a_robots_name_is_refused(ten: Server) -> None:
    answer = ten.press("operation", "whose?")
    assert answer.status_code == 404
    assert "several robots: begin with /robots/r1/" in answer.json()["error"]
    unknown = ten.robot("r99").press("operation", "whose?")
    assert unknown.status_code == 404
    assert 'no robot "r99"' in unknown.json()["error"]
    for absent in (ten, ten.robot("r99")):
        with pytest.raises(InvalidStatus), absent.socket():
            raise AssertionError("it opened")
    for number in range(MANY):
        assert "whose?" not in heard(ten.robot(f"r{number + 1}"))


def test_press_seen_on_the_page_of_another_robot_is_refused(ten: Server, way: str) -> None:
    ten = ten.by(way)
    event_id = ten.robot("r1").snapshot()["id"]
    answer = ten.robot("r2").press("operation", "not this one", seen=event_id)
    assert (answer.status_code, answer.json()["outcome"]) == (409, "refused")
    assert "another robot" in answer.json()["reason"]
    assert ten.robot("r1").press("operation", "this one", seen=event_id).status_code == 200


def test_a_form_leads_back_to_its_robot(ten: Server) -> None:
    answer = ten.http.post("/robots/r4/widgets/operation", data={"message": "by form"})
    assert answer.status_code == 303
    assert answer.headers["location"].startswith("/robots/r4/pages/operation?receipt=")
    assert "Sent" in ten.http.get(answer.headers["location"]).text


@pytest.fixture
def two(
    domain: int, tmp_path: Path, servers: Callable[[Server], Server]
) -> Iterator[tuple[Server, list[Bridge], list[RosNode]]]:
    """Two robots, each on a domain of its own behind a bridge of its own."""
    bridges = [Bridge(domain + 4 + n, f"/robot{n + 1}") for n in range(2)]
    nodes = []
    try:
        for bridge in bridges:
            bridge.start()
            nodes.append(RosNode(bridge.domain))
            nodes[-1].subscribe("/operation1", TEXT)
            nodes[-1].advertise(
                "/operation_enabled", "std_msgs/msg/Bool", durability="transient_local", depth=1
            )
        path = panel_file(tmp_path, *(entry(n + 1, b.endpoint) for n, b in enumerate(bridges)))
        kiosk = servers(live("tcp/127.0.0.1:1", tmp_path, KIOSK_PANEL=str(path)))
        until(kiosk.ready, "both robots are ready")
        for node in nodes:
            until(partial(node.endpoints, "/operation1"), "the robot sees who publishes")
        yield kiosk, bridges, nodes
    finally:
        for node in nodes:
            node.end()
        for bridge in bridges:
            bridge.end()


def test_each_of_two_robots_has_its_own_bridge_permission_and_presses(
    two: tuple[Server, list[Bridge], list[RosNode]], page: Page
) -> None:
    kiosk, bridges, nodes = two
    first, second = kiosk.robot("r1"), kiosk.robot("r2")
    nodes[0].publish("/operation_enabled", {"data": True})
    until(lambda: first.widget("operation1")["enabled"], "the first permits")
    assert "is not known yet" in second.widget("operation1")["reason"]
    assert second.press("operation1", "no").status_code == 409
    assert first.press("operation1", "one").json()["outcome"] == "published"
    nodes[1].publish("/operation_enabled", {"data": True})
    until(lambda: second.widget("operation1")["enabled"], "the second permits")
    assert second.press("operation1", "two").json()["outcome"] == "published"
    until(lambda: all(has_heard(node, "/operation1", 1) for node in nodes), "both heard")
    assert [node.heard_data("/operation1") for node in nodes] == [["one"], ["two"]]

    page.goto(f"{kiosk.url}/robots/r2/")
    lost, there = page.locator('[data-robot="r1"]'), page.locator('[data-robot="r2"]')
    expect(lost).to_have_attribute("data-state", "ok")
    bridges[0].kill()
    expect(lost).to_have_attribute("data-state", "bad")
    expect(there).to_have_attribute("data-state", "ok")
    expect(page.get_by_role("button", name="Publish1")).to_be_enabled()
    assert first.press("operation1", "late").status_code == 503
    assert kiosk.http.get("/readyz").json()["robots"] == {"r1": "link_unreachable", "r2": "permitted"}
    bridges[0].start()
    until(kiosk.ready, "joined again")
    assert second.widget("operation1")["enabled"]
    assert nodes[0].heard_data("/operation1") == ["one"]


def test_a_frozen_bridge_of_one_robot_locks_that_robot_only(
    two: tuple[Server, list[Bridge], list[RosNode]],
) -> None:
    kiosk, bridges, nodes = two
    robots = [kiosk.robot("r1"), kiosk.robot("r2")]
    for node, robot in zip(nodes, robots, strict=True):
        node.publish("/operation_enabled", {"data": True})
        until(partial(permitted, robot), "permitted")
    bridges[1].freeze()
    until(lambda: not robots[1].widget("operation1")["enabled"], "locked")
    assert robots[0].widget("operation1")["enabled"]
    bridges[1].thaw()
    nodes[1].publish("/operation_enabled", {"data": False})
    until(lambda: "does not permit" in (robots[1].widget("operation1")["reason"] or ""), "heard")
    assert robots[0].widget("operation1")["enabled"]


def test_one_bridge_may_carry_robots_with_different_namespaces(
    bridge: Bridge, node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    for topic in ("/robot1/operation", "/robot2/operation"):
        node.subscribe(topic, TEXT)
    path = panel_file(tmp_path, entry(1), entry(2))
    kiosk = servers(live(bridge.endpoint, tmp_path, KIOSK_PANEL=str(path)))
    until(kiosk.ready, "ready")
    second = kiosk.robot("r2")
    until(partial(node.endpoints, "/robot2/operation"), "the robot sees who publishes")
    # The node listens since a moment ago: until the bridge knows, a press says that no one hears it.
    until(
        lambda: second.press("operation", "second").json()["outcome"] == "published", "heard", 10, 0.2
    )
    until(lambda: has_heard(node, "/robot2/operation", 1), "the second heard it")
    assert set(node.heard_data("/robot2/operation")) == {"second"}
    assert node.heard("/robot1/operation") == []


def test_a_bridge_with_another_namespace_is_not_this_robots(
    domain: int, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    other = Bridge(domain + 4, "/robot2")
    other.start()
    try:
        path = panel_file(tmp_path, entry(1), entry(2))
        kiosk = servers(live(other.endpoint, tmp_path, KIOSK_PANEL=str(path)))
        until(lambda: kiosk.robot("r2").widget("operation")["enabled"], "the bridge of robot 2")
        first = kiosk.robot("r1")
        until(lambda: "no ROS 2 bridge of its" in (first.widget("operation")["reason"] or ""), "locked")
        assert first.press("operation", "whose?").status_code == 503
    finally:
        other.end()


def test_faults_of_robot_tables_are_reported(tmp_path: Path) -> None:
    other = 'id = "r{n}"\nname = "{name}"\nnamespace = "{namespace}"'
    path = panel_file(
        tmp_path,
        entry(1),
        entry(1),  # a copy: that it has the same name and place, too, goes without saying
        other.format(n=3, name="R3", namespace="a b"),
        other.format(n=4, name="Robot 1", namespace="/robot4"),
        other.format(n=5, name="R5", namespace="/robot1"),
    )
    with pytest.raises(PanelError) as caught:
        load_panel(path)
    assert faults_text(caught.value).splitlines() == [
        'robot[1].id: "r1" is already the id of robot[0], line 8',
        'robot[2].namespace: "a b" is not a ROS 2 namespace: it must be like /robot1',
        'robot[3].name: "Robot 1" is already the name of robot[0], line 8',
        "robot[4].namespace: robot[0] has the same namespace and endpoints: it would be the same robot",
    ]


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/robot1:7447", "tcp/192.0.2.7:1", "udp/[::1]:65535", "tls/robot1.local:7447#iface=eth0",
        "quic/robot1:7447?rel=1", "ws/robot1:80?prio=1-7;rel=0#iface=lo;x=1", "unixsock-stream//tmp/r1",
    ],
)  # fmt: skip
def test_endpoints_that_zenoh_takes_are_taken(tmp_path: Path, endpoint: str) -> None:
    (robot,) = load_panel(panel_file(tmp_path, entry(1, endpoint))).robots
    assert robot.connect == (endpoint,)
    zenoh.Config().insert_json5("connect/endpoints", json.dumps([endpoint]))


@pytest.mark.parametrize(
    "endpoint",
    [
        "robot1:7447", "robot1", "", "tcp/", "tcp/robot1", "tcp/robot1:", "tcp/:7447",
        "tcp//robot1:7447", "tcp/robot1:0", "tcp/robot1:65536", "tcp/robot1:port", "tcp/robot 1:7447",
        " tcp/robot1:7447", "TCP/robot1:7447", "http://robot1:7447", "serial//dev/ttyS0",
        "tcp/robot1:7447?", "tcp/robot1:7447#",
        "unixsock-stream/",
    ],
)  # fmt: skip
def test_an_endpoint_that_is_none_is_a_fault_of_the_panel(tmp_path: Path, endpoint: str) -> None:
    with pytest.raises(PanelError) as caught:
        load_panel(panel_file(tmp_path, entry(1, "tcp/robot1:7447"), entry(2, endpoint)))
    assert faults_text(caught.value) == (
        f'robot[1].connect[0]: "{endpoint}" is not a Zenoh endpoint: it must be like tcp/robot1:7447'
    )


def test_an_endpoint_that_is_none_ends_the_start_in_words(tmp_path: Path) -> None:
    path = panel_file(tmp_path, entry(1, "robot1:7447"))
    command = [sys.executable, "-m", "uvicorn", "app.main:app", "--port", str(free_port())]
    kiosk = Process(command, {"KIOSK_PANEL": str(path), "KIOSK_MODE": "live"}, cwd=ROOT)
    try:
        assert kiosk.wait(ENOUGH_S) != 0
    finally:
        kiosk.end()
    assert '"robot1:7447" is not a Zenoh endpoint: it must be like tcp/robot1:7447' in kiosk.text
    assert "Traceback" not in kiosk.text
