"""The real bridge with what `operator-panel bridge-config` writes: the panel works through it, and
nothing else of the robot comes through."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.tools.cli.command import main
from tests.support import cyclone
from tests.support.cyclone import Client, CycloneRobot
from tests.support.panel_text import ADD, CELL, COUNT, LOCKED_START, SPEED
from tests.support.parts import Bridge, RosNode, Server, live, until

cyclone_robots = cyclone.cyclone_robots

FIBONACCI = COUNT.replace("/count", "/fibonacci")
SPEED_OF_ROBOT = SPEED.replace("/arm", "/cyclone_robot")
PANEL = f"{CELL}{LOCKED_START}{ADD}{FIBONACCI}{SPEED_OF_ROBOT}"


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(PANEL)
    return path


@pytest.fixture
def bridge(domain: int, panel: Path, tmp_path: Path) -> Iterator[Bridge]:
    """With the written configuration, in a domain of its own."""
    mine, file = Bridge(domain + 2), tmp_path / "bridge.json5"
    options = ["--domain", str(mine.domain), "--listen", mine.endpoint, "-o", str(file)]
    assert main(["bridge-config", str(panel), *options]) == 0
    mine.configure(file)
    mine.start()
    yield mine
    mine.end()


def test_generated_config_forwards_the_panels_topics_only(
    bridge: Bridge,
    panel: Path,
    tmp_path: Path,
    cyclone_robots: Callable[..., CycloneRobot],
    servers: Callable[[Server], Server],
) -> None:
    node = RosNode(bridge.domain)
    cyclone_robots(bridge.domain).fibonacci(step_s=30)
    client = Client(bridge.endpoint)
    try:
        node.advertise("/operation_enabled", "std_msgs/msg/Bool")
        node.every("/operation_enabled", {"data": True}, 0.2)
        node.advertise("/secret", "std_msgs/msg/Bool")
        node.subscribe("/start", "std_msgs/msg/Bool")
        kiosk = servers(live(bridge.endpoint, tmp_path, KIOSK_PANEL=str(panel)))
        names = ("start", "add", "count")
        until(lambda: all(kiosk.widget(name)["enabled"] for name in names), "they are open")
        pressed = {name: kiosk.press(name, inputs={}).json() for name in names}
        assert {name: receipt["outcome"] for name, receipt in pressed.items()} == {
            "start": "published",
            "add": "succeeded",
            "count": "accepted",
        }
        until(lambda: node.heard_data("/start") == [True], "the robot has it")
        until(lambda: "0.5" in str(kiosk.widget("speed")), "the parameter was read")
        known = {token.split("/", 1)[1].partition("/std_msgs")[0] for token in client.tokens()}
        assert "cell9/operation_enabled" in known
        assert not any("secret" in name for name in known)
        assert not any("set_enabled" in name for name in known)
    finally:
        client.close()
        node.end()
