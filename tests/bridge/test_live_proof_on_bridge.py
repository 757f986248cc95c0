"""The live proof at a real node, over the real bridge: a person presses at the panel, the node hears
it, and the proof measures it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server
from tests.tools.prove.person import Person

pytestmark = pytest.mark.promise("locks")

PANEL = """
title = "Cell"
mode = "live"
[[interlock]]
id = "guard"
label = "Guard door"
topic = "/guard"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
interlock = "guard"
"""


@pytest.fixture
def kiosk(bridge: Bridge, node: RosNode, tmp_path: Path) -> Iterator[Server]:
    node.advertise("/guard", "std_msgs/msg/Bool")
    node.subscribe("/start", "std_msgs/msg/Bool")
    with live_server(bridge, tmp_path, PANEL, KIOSK_DATA=str(tmp_path / "data")) as mine:
        yield mine


def says(node: RosNode, kiosk: Server, *, permits: bool) -> None:
    """The node publishes until the panel shows it."""

    def shown() -> bool:
        node.publish("/guard", {"data": permits})
        return bool(kiosk.snapshot()["interlocks"]["guard"]["enabled"]) is permits

    until(shown, f"permits: {permits}", every_s=0.2)


def test_steps_are_measured_at_a_real_node(kiosk: Server, node: RosNode, tmp_path: Path) -> None:
    person = Person(tmp_path / "cell.toml", kiosk.url)
    try:
        assert person.step() == "interlock guard, permits"
        says(node, kiosk, permits=True)
        person.sees(["start"])
        person.ticks()
        assert person.step() == "interlock guard, forbids"
        person.hears('"Guard door" permits')
        says(node, kiosk, permits=False)
        person.sees(["start"])
        person.ticks()
        for _ in ("other_type", "never_seen"):
            person.step()
            person.types("sno other node here\n")
        assert person.step() == 'control start ("Start"), press'
        says(node, kiosk, permits=True)

        def heard() -> bool:
            """The bridge may discover the subscription late: what was sent before never arrives."""
            kiosk.http.post("/widgets/start", json={"inputs": {}})
            return True in node.heard_data("/start")

        until(heard, "the press arrives at the node", every_s=1)
        person.sees(["start"])
        person.ticks()
        assert person.step() == "the link to the robot is cut"
        person.types("sno cable here\n")
        assert person.ends() == 0, person.said
    finally:
        person.close()
