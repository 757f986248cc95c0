"""Topics that are published as best effort, on the real bridge: a display reads them, an interlock does
not."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.support.parts import Bridge, RosNode, Server, publish_until, until
from tests.support.servers import live_server

BOOL = "std_msgs/msg/Bool"
STRING = "std_msgs/msg/String"
PANEL = """
title = "Cell"
languages = ["en"]

[[interlock]]
id = "operation"
topic = "/ready"
type = "std_msgs/msg/Bool"

[[page]]
id = "main"
title = "Main"

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
"""
SAID = "The robot publishes {} as best effort, but this panel requires reliable."


@pytest.fixture
def publish(own_node: RosNode) -> Callable[[str], None]:
    """Advertises the topic of the words, replacing an earlier publisher."""
    return lambda reliability: own_node.advertise("/words", STRING, reliability=reliability)


def shows(kiosk: Server, text: str) -> bool:
    return bool(kiosk.widget("words")["text"] == text)


def notes(kiosk: Server, note: str) -> bool:
    return bool(kiosk.widget("words")["note"] == note)


def test_best_effort_publisher_is_read_by_a_display_and_reported_by_an_interlock(
    own_bridge: Bridge, own_node: RosNode, publish: Callable[[str], None], tmp_path: Path
) -> None:
    with live_server(own_bridge, tmp_path, PANEL) as kiosk:
        publish("best_effort")
        publish_until(own_node, "/words", {"data": "seen"}, partial(shows, kiosk, "seen"))
        own_node.advertise("/ready", BOOL, reliability="best_effort")
        own_node.every("/ready", {"data": True}, 0.1)
        said = SAID.format("/ready")
        until(lambda: kiosk.widget("go")["reason"] == said, "the interlock says it")
        assert kiosk.snapshot()["link"]["node"]["reason"].startswith(said)
        publish("reliable")  # what reads best effort reads reliable too
        publish_until(own_node, "/words", {"data": "reliable"}, partial(shows, kiosk, "reliable"))


def test_a_publisher_that_becomes_best_effort_is_named_and_its_successor_read(
    own_bridge: Bridge, own_node: RosNode, publish: Callable[[str], None], tmp_path: Path
) -> None:
    """The bridge's reader stays reliable while its route is in use."""
    with live_server(own_bridge, tmp_path, PANEL) as kiosk:
        publish("reliable")
        publish_until(own_node, "/words", {"data": "first"}, partial(shows, kiosk, "first"))
        publish("best_effort")
        until(partial(notes, kiosk, SAID.format("/words")), "the display says it")
        publish("best_effort")
        publish_until(own_node, "/words", {"data": "third"}, partial(shows, kiosk, "third"))
