"""The real bridge over TLS, with what `operator-panel pki` and `bridge-config --tls` write: the panel
works, who has no certificate does not get in, and who has another one can say nothing."""

import json
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Final

import pytest
import zenoh

from app.tools.cli.command import main
from tests.support import cyclone
from tests.support.certificates import tls_session
from tests.support.cyclone import CycloneRobot, encoded
from tests.support.panel_text import ADD, CELL, COUNT, LOCKED_START, SPEED
from tests.support.parts import ROOT, Bridge, RosNode, Server, until

pytestmark = pytest.mark.promise("neighbours")

cyclone_robots = cyclone.cyclone_robots

FIBONACCI = COUNT.replace("/count", "/fibonacci")
SPEED_OF_ROBOT = SPEED.replace("/arm", "/cyclone_robot")
HEARD = """
[[page.widget]]
id = "pressure"
kind = "readout"
label = "Pressure"
topic = "/pressure"
type = "std_msgs/msg/Float64"
field = "data"
"""
PANEL = f"{CELL}{LOCKED_START}{ADD}{FIBONACCI}{SPEED_OF_ROBOT}{HEARD}"
# A session sends only what it knows a subscriber of. With this rule everyone is told of all.
TOLD_OF_ALL: Final = {
    "id": "told",
    "permission": "allow",
    "flows": ["egress"],
    "messages": ["declare_subscriber", "declare_queryable"],
    "key_exprs": ["**"],
}


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(PANEL)
    return path


@pytest.fixture
def bridge(domain: int, panel: Path, tmp_path: Path) -> Iterator[Bridge]:
    """With the written files; it tells everyone of all subscribers, so that a stranger tries."""
    mine, file, folder = Bridge(domain + 2), tmp_path / "bridge.json5", tmp_path / "pki"
    mine.endpoint = mine.endpoint.replace("tcp/", "tls/")
    assert main(["pki", "new", str(folder), "--panel", str(panel), "--connect", mine.endpoint]) == 0
    assert main(["pki", "add", str(folder), "other", "--client"]) == 0
    options = ["--domain", str(mine.domain), "--listen", mine.endpoint, "--tls", str(folder)]
    assert main(["bridge-config", str(panel), *options, "-o", str(file)]) == 0
    config = zenoh.Config.from_file(file)
    access = json.loads(config.get_json("access_control"))
    access["rules"].append(TOLD_OF_ALL)
    access["subjects"].append({"id": "everyone"})
    access["policies"].append({"rules": ["told"], "subjects": ["everyone"]})
    config.insert_json5("access_control", json.dumps(access))
    file.write_text(str(config))
    mine.configure(file)
    mine.start()
    yield mine
    mine.end()


@pytest.fixture
def kiosk(bridge: Bridge, panel: Path, tmp_path: Path, servers: Callable[[Server], Server]) -> Server:
    zenoh_file = str(tmp_path / "pki/zenoh.json5")
    return servers(Server(ROOT, 0, KIOSK_MODE="live", KIOSK_ZENOH=zenoh_file, KIOSK_PANEL=str(panel)))


def test_the_panel_works_over_tls(
    bridge: Bridge, kiosk: Server, cyclone_robots: Callable[..., CycloneRobot]
) -> None:
    node = RosNode(bridge.domain)
    cyclone_robots(bridge.domain).fibonacci(step_s=30)
    try:
        node.advertise("/operation_enabled", "std_msgs/msg/Bool")
        node.every("/operation_enabled", {"data": True}, 0.2)
        node.subscribe("/start", "std_msgs/msg/Bool")
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
    finally:
        node.end()


def test_who_has_no_certificate_of_the_cell_does_not_get_in(bridge: Bridge, tmp_path: Path) -> None:
    elsewhere = tmp_path / "elsewhere"
    assert main(["pki", "new", str(elsewhere)]) == 0
    (elsewhere / "ca.pem").write_bytes((tmp_path / "pki/ca.pem").read_bytes())
    for folder, name in ((tmp_path / "pki", ""), (elsewhere, "kiosk")):
        with pytest.raises(zenoh.ZError):
            tls_session(bridge.endpoint, folder, name).close()
    with closing(tls_session(bridge.endpoint, tmp_path / "pki", "kiosk")) as mine:
        assert list(mine.info.routers_zid()) != []


def test_another_certificate_forges_neither_a_permission_nor_a_press(
    bridge: Bridge, kiosk: Server, tmp_path: Path
) -> None:
    node, folder = RosNode(bridge.domain), tmp_path / "pki"
    true = encoded("std_msgs/msg/Bool", True)
    heard: list[str] = []

    def hear(sample: zenoh.Sample) -> None:
        heard.append(str(sample.key_expr))

    try:
        node.advertise("/operation_enabled", "std_msgs/msg/Bool")
        node.every("/operation_enabled", {"data": False}, 0.2)
        node.advertise("/pressure", "std_msgs/msg/Float64")
        node.advertise("/secret", "std_msgs/msg/Bool")
        node.every("/secret", {"data": True}, 0.05)
        node.subscribe("/start", "std_msgs/msg/Bool")
        until(lambda: "operation" in str(kiosk.widget("start")), "the panel shows the robot's state")
        until(lambda: not kiosk.widget("start")["enabled"], "it is locked")
        with closing(tls_session(bridge.endpoint, folder, "other")) as other:
            starts: Any = other.declare_publisher("cell9/start")
            until(lambda: starts.matching_status.matching, "it sees who reads the command")
            held = other.declare_subscriber("**", hear, allowed_origin=zenoh.Locality.REMOTE)
            starts.put(true)
            enables: Any = other.declare_publisher("cell9/operation_enabled")
            until(lambda: enables.matching_status.matching, "it sees who reads the permission")
            for _ in range(20):
                enables.put(true)
                assert not kiosk.widget("start")["enabled"]
            del held
        with closing(tls_session(bridge.endpoint, folder, "kiosk")) as stolen:
            read = stolen.declare_subscriber("**", hear, allowed_origin=zenoh.Locality.REMOTE)
            values = stolen.declare_subscriber("cell9/pressure", lambda sample: heard.append("value"))
            permission: Any = stolen.declare_publisher("cell9/operation_enabled")
            until(lambda: permission.matching_status.matching, "it sees who reads the permission")
            permission.put(true)
            command: Any = stolen.declare_publisher("cell9/start")
            until(lambda: command.matching_status.matching, "it sees who reads the command")
            command.put(true)
            node.every("/pressure", {"data": 41.5}, 0.05)
            until(lambda: node.heard_data("/start") == [True], "the panel's own command arrives")
            until(lambda: "41.5" in str(kiosk.widget("pressure")), "the panel has what came later")
            until(lambda: "value" in heard, "and so has the other session")
            del read, values
        assert not kiosk.widget("start")["enabled"]
        assert node.heard_data("/start") == [True]
        assert not any("secret" in key or "operation" in key for key in heard)
    finally:
        node.end()
