"""Robots and panels that meet at Zenoh routers, with real bridges and nodes: one robot on two panels,
robots of one panel at several routers, and namespaces behind a router that is not the panel's."""

import itertools
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import ROOT, Bridge, RosNode, Server, client_file, free_port, until
from tests.support.rmw import LinkedRouters, Router

pytestmark = pytest.mark.promise("control")

NUMBERS: Final = itertools.count()  # of presses
TEXT: Final = "std_msgs/msg/String"
PANEL: Final = """
title = "Cell"
interlock = [{ id = "operation", topic = "/operation_enabled" }]
[control]
required = true
{robots}
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "message"
kind = "text"
label = "Message"
[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "{message}" }
interlock = "operation"
[[page.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/heard"
type = "std_msgs/msg/String"
"""
ROBOT: Final = """
[[robot]]
id = "r{number}"
name = "Robot {number}"
namespace = "/robot{number}"
connect = ["{endpoint}"]
"""


@pytest.fixture
def stack() -> Iterator[ExitStack]:
    with ExitStack() as mine:
        yield mine


@pytest.fixture
def routers(tmp_path: Path, stack: ExitStack) -> LinkedRouters:
    mine = LinkedRouters(tmp_path)
    mine.start()
    stack.callback(mine.end)
    return mine


class Robot:
    """A node behind a bridge with a namespace, at some routers; it permits, and says its name."""

    def __init__(
        self, stack: ExitStack, domain: int, endpoints: list[str], namespace: str = "/"
    ) -> None:
        connect = str(endpoints).replace("'", '"')
        bridge = Bridge(domain, namespace, options=[f"connect/endpoints={connect}"])
        bridge.start()
        stack.callback(bridge.end)
        self.node = RosNode(domain)
        stack.callback(self.node.end)
        self.node.subscribe("/operation", TEXT, depth=100)
        self.node.advertise("/operation_enabled", "std_msgs/msg/Bool", durability="transient_local")
        self.node.advertise("/heard", TEXT, durability="transient_local")
        self.permit(True)

    def permit(self, permitted: bool) -> None:
        self.node.publish("/operation_enabled", {"data": permitted})

    def tell(self, text: str) -> None:
        self.node.publish("/heard", {"data": text})

    def heard(self) -> list[str]:
        return list(self.node.heard_data("/operation"))


def panel(stack: ExitStack, folder: Path, endpoints: list[str], robots: str = "") -> Server:
    folder.mkdir(exist_ok=True)
    file = folder / "cell.toml"
    file.write_text(PANEL.replace("{robots}", robots))
    zenoh = client_file(folder, *endpoints)
    environment = {"KIOSK_PANEL": str(file), "KIOSK_ZENOH": str(zenoh), "KIOSK_MODE": "live"}
    return stack.enter_context(Server(ROOT, free_port(), **environment))


def press(server: Server, word: str) -> dict[str, Any]:
    """The receipt."""
    body = {"inputs": {"message": word}, "id": f"press-{next(NUMBERS)}"}
    receipt: dict[str, Any] = server.http.post(f"{server.base}/widgets/say", json=body).json()
    return receipt


def take_control(server: Server) -> None:
    """The first answer brings the cookie by which a browser has control. Waits for the robot's
    permission, which counts after control."""
    take = f"{server.base}/control/take"
    until(lambda: server.http.post(take, json={}).json()["done"], "control is taken")
    until(lambda: server.widget("say")["enabled"], "the robot permits it")


def shows(server: Server, text: str) -> bool:
    return bool(server.widget("heard")["text"] == text)


def is_locked(server: Server) -> bool:
    return not server.widget("say")["enabled"]


def is_permitted(server: Server) -> bool:
    """Whether nothing but control is missing."""
    return str(press(server, "early")["code"]) == "control_free"


def test_one_robot_on_two_panels_at_two_routers(
    domain: int, routers: LinkedRouters, stack: ExitStack, tmp_path: Path
) -> None:
    robot = Robot(stack, domain + 2, routers.endpoints)
    first, second = (
        panel(stack, tmp_path / f"panel{number}", [endpoint])
        for number, endpoint in enumerate(routers.endpoints)
    )
    for server in (first, second):
        until(partial(is_permitted, server), "control alone is missing")
    robot.tell("both")
    for server in (first, second):
        until(partial(shows, server, "both"), "both see it")
    # Control is of a panel: who has it at one has it at no other, and takes it from no one there.
    take_control(first)
    assert press(first, "of the first")["outcome"] == "published"
    assert press(second, "without")["code"] == "control_free"
    take_control(second)
    assert press(second, "of the second")["outcome"] == "published"
    assert press(first, "again")["outcome"] == "published"
    words = {"of the first", "of the second", "again"}
    until(lambda: words <= set(robot.heard()), "all have arrived")
    assert sorted(robot.heard()) == sorted(words), "each once"
    # What the robot forbids is locked at both.
    robot.permit(False)
    for server in (first, second):
        until(partial(is_locked, server), "both are locked")
        assert press(server, "locked")["code"] == "interlock_not_permitted"
    robot.permit(True)
    # A router ends with one of the panels at it: the other goes on.
    routers.routers[0].kill()
    until(lambda: press(first, "cut")["outcome"] == "refused", "the first panel is locked")
    until(lambda: press(second, "still")["outcome"] == "published", "the second goes on")
    until(lambda: "still" in robot.heard(), "it has arrived")
    assert not {"without", "locked", "cut", "early"} & set(robot.heard())


def test_robots_of_one_panel_at_several_routers(domain: int, stack: ExitStack, tmp_path: Path) -> None:
    """The routers do not know each other; the robots have the same topics in their own domains."""
    places = [Router(), Router()]
    for place in places:
        place.start()
        stack.callback(place.end)
    ends = [place.endpoint for place in places]
    robots = [Robot(stack, domain + 3 + at, [end], f"/robot{at + 1}") for at, end in enumerate(ends)]
    tables = "".join(ROBOT.format(number=at, endpoint=end) for at, end in enumerate(ends, 1))
    server = panel(stack, tmp_path, ends, tables)
    _each_robot_is_its_own(server, robots)
    places[0].kill()
    first, second = (server.robot(f"r{number}") for number in (1, 2))
    until(lambda: press(first, "cut")["outcome"] == "refused", "the first robot is locked")
    assert press(second, "still")["outcome"] == "published"
    until(lambda: "still" in robots[1].heard(), "it has arrived")
    places[0].start()
    until(lambda: press(first, "again")["outcome"] == "published", "it is there again")
    until(lambda: "again" in robots[0].heard(), "it has arrived")
    assert "cut" not in robots[0].heard()


def test_namespaces_pass_between_routers(
    domain: int, routers: LinkedRouters, stack: ExitStack, tmp_path: Path
) -> None:
    """Both robots are reached at the second router; the first robot's bridge is at the first."""
    here = routers.endpoints[1]
    robots = [
        Robot(stack, domain + 5 + at, [end], f"/robot{at + 1}")
        for at, end in enumerate(routers.endpoints)
    ]
    tables = "".join(ROBOT.format(number=number, endpoint=here) for number in (1, 2))
    server = panel(stack, tmp_path, [here], tables)
    _each_robot_is_its_own(server, robots)
    routers.routers[0].kill()
    first, second = (server.robot(f"r{number}") for number in (1, 2))
    until(lambda: press(first, "cut")["outcome"] == "refused", "the first robot is locked")
    assert press(second, "still")["outcome"] == "published"
    until(lambda: "still" in robots[1].heard(), "it has arrived")
    assert "cut" not in robots[0].heard()


def _each_robot_is_its_own(server: Server, robots: list[Robot]) -> None:
    """Each gets its own presses and is shown with its own values; its permission is its own."""
    pages = [server.robot(f"r{number}") for number, _ in enumerate(robots, 1)]
    for number, (page, robot) in enumerate(zip(pages, robots, strict=True), 1):
        until(partial(is_permitted, page), "control alone is missing")
        robot.tell(f"robot {number}")
        take_control(page)
        assert press(page, f"for {number}")["outcome"] == "published"
    for number, (page, robot) in enumerate(zip(pages, robots, strict=True), 1):
        until(partial(shows, page, f"robot {number}"), "its own value")
        until(robot.heard, "the press has arrived")
        assert robot.heard() == [f"for {number}"]
    robots[0].permit(False)
    until(partial(is_locked, pages[0]), "the first robot forbids it")
    assert pages[1].widget("say")["enabled"]
    robots[0].permit(True)
    until(lambda: pages[0].widget("say")["enabled"], "it permits it again")
