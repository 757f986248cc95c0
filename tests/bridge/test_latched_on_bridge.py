"""Latched publications of the panel on the real bridge: subscribers that come late get the last one."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from tests.support.parts import Bridge, RosNode, Server, has_heard, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("offline")

STRING = "std_msgs/msg/String"
PANEL = """
title = "Cell"
languages = ["en"]

[[page]]
id = "main"
title = "Main"

[[page.widget]]
id = "message"
kind = "text"
label = "Message"

[[page.widget]]
id = "mode"
kind = "publish"
label = "Mode"
topic = "/mode"
type = "std_msgs/msg/String"
message = { data = "{message}" }
qos = { durability = "transient_local", depth = 1 }

[[page.widget]]
id = "shown"
kind = "readout"
label = "Mode"
topic = "/mode"
type = "std_msgs/msg/String"
qos = { durability = "transient_local", depth = 1 }
"""


@pytest.fixture
def kiosk(own_bridge: Bridge, tmp_path: Path) -> Iterator[Server]:
    with live_server(own_bridge, tmp_path, PANEL) as mine:
        yield mine


@pytest.fixture
def late(own_bridge: Bridge) -> Iterator[Callable[[str], RosNode]]:
    """Starts nodes that subscribe to the topic, and ends them after the test."""
    nodes: list[RosNode] = []

    def subscribed(name: str) -> RosNode:
        node = RosNode(own_bridge.domain, name)
        nodes.append(node)
        node.subscribe("/mode", STRING, durability="transient_local", depth=1)
        return node

    yield subscribed
    for node in nodes:
        node.end()


def test_late_subscribers_get_the_last_message_also_the_first_of_them(
    kiosk: Server, late: Callable[[str], RosNode]
) -> None:
    for mode in ("manual", "automatic"):
        assert kiosk.press("mode", mode).json()["outcome"] == "unknown"  # no node subscribes yet
    first = late("first")
    until(lambda: first.heard_data("/mode"), "the first subscriber gets it")
    second = late("second")
    until(lambda: second.heard_data("/mode"), "the second subscriber gets it")
    assert kiosk.press("mode", "off").json()["outcome"] == "published"
    for node in (first, second):
        until(partial(has_heard, node, "/mode", 2), "both get the next one")
        assert node.heard_data("/mode") == ["automatic", "off"]
    assert kiosk.widget("shown")["text"] == "—"  # the panel's own message is not the robot's


def test_lost_connection_repeats_no_command(
    kiosk: Server, own_bridge: Bridge, late: Callable[[str], RosNode]
) -> None:
    kiosk.press("mode", "automatic")
    own_bridge.kill()
    until(lambda: not kiosk.ready(), "the connection is lost")
    own_bridge.start()
    until(kiosk.ready, "the connection is back")
    node = late("late")
    until(lambda: sent(kiosk) and node.heard_data("/mode"), "the next one arrives", every_s=0.5)
    assert set(node.heard_data("/mode")) == {"off"}


def sent(kiosk: Server) -> bool:
    return bool(kiosk.press("mode", "off").json()["outcome"] in ("published", "unknown"))
