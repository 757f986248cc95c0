"""Presses that a person confirms, through a real bridge to an rclpy node: with the PIN the message
arrives once, without it nothing does."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.support.confirmed import PANEL, add_users
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server
from tests.support.users import Browsers, log_rows

pytestmark = pytest.mark.promise("users")

LIVE = PANEL.replace('mode = "demo"', 'mode = "live"').partition("[demo.")[0]


@pytest.fixture
def node(own_bridge: Bridge) -> Iterator[RosNode]:
    mine = RosNode(own_bridge.domain)
    mine.advertise("/operation_enabled", "std_msgs/msg/Bool")
    mine.every("/operation_enabled", {"data": True}, 0.1)
    mine.subscribe("/heat", "std_msgs/msg/Float64")
    yield mine
    mine.end()


@pytest.fixture
def kiosk(own_bridge: Bridge, node: RosNode, tmp_path: Path) -> Iterator[Server]:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_users(data)
    with live_server(own_bridge, tmp_path, LIVE, KIOSK_DATA=str(data)) as mine:
        permitted = "the robot permits"
        until(lambda: mine.snapshot()["interlocks"]["operation"]["enabled"], permitted)
        yield mine


def confirmed(client: httpx.Client, heat: float, pin: str = "2580") -> httpx.Response:
    return client.post("/widgets/start/confirm", json={"inputs": {"heat": heat}, "pin": pin})


def pressed(client: httpx.Client, heat: float, token: str) -> str:
    body = {"inputs": {"heat": heat}, "confirmation": token}
    return str(client.post("/widgets/start", json=body).json()["outcome"])


def press(client: httpx.Client, heat: float) -> str:
    """The outcome of a press with its PIN."""
    return pressed(client, heat, confirmed(client, heat).json()["confirmation"])


def test_with_the_pin_it_arrives_once_and_without_it_nothing_does(kiosk: Server, node: RosNode) -> None:
    browsers = Browsers()
    client = browsers.signed_in(kiosk.url, "M. Sato", pin="2580")

    def discovered() -> bool:
        """The bridge may discover the subscription late: what was sent before never arrives."""
        return press(client, 20) == "published" and 20.0 in node.heard_data("/heat")

    until(discovered, "presses reach the node", every_s=1)
    assert pressed(client, 666, "") == "refused"
    wrong = confirmed(client, 666, pin="9999")
    assert wrong.json()["code"] == "confirm_wrong_pin"
    assert pressed(client, 666, wrong.json().get("confirmation", "guess")) == "refused"
    token = confirmed(client, 300).json()["confirmation"]
    assert pressed(client, 666, token) == "refused"  # a confirmation of other values
    token = confirmed(client, 300).json()["confirmation"]
    assert pressed(client, 300, token) == "published"
    assert pressed(client, 300, token) == "refused"  # and of one press
    assert press(client, 400) == "published"
    until(lambda: 400.0 in node.heard_data("/heat"), "the last press arrives")
    heard = [value for value in node.heard_data("/heat") if value != 20.0]
    assert heard == [300.0, 400.0]  # nothing between them, and nothing before
    said = [row["reason"] for row in log_rows(client) if row["widget"] == "start"]
    assert sum("Confirmed by M. Sato with the PIN." in reason for reason in said) >= 2
    browsers.close()
