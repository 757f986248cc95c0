"""The attack: a Zenoh session that is none of the robot's says through a real bridge that operation is
permitted. One without a timestamp is stamped by the bridge, like all that comes through it: against it
only access control helps, see `test_tls_on_bridge.py`."""

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import zenoh

from tests.support.cyclone import encoded
from tests.support.panel_text import CELL, LOCKED_START
from tests.support.parts import Bridge, RosNode, until
from tests.support.servers import live_server

BOOL = "std_msgs/msg/Bool"


def test_what_another_session_has_stamped_permits_nothing(own_bridge: Bridge, tmp_path: Path) -> None:
    panel = f"{CELL}{LOCKED_START}".replace('namespace = "/cell9"', "")
    node = RosNode(own_bridge.domain)
    try:
        node.advertise("/operation_enabled", BOOL)
        node.subscribe("/start", BOOL)
        with live_server(own_bridge, tmp_path, panel) as kiosk:
            until(lambda: not kiosk.widget("start")["enabled"], "nothing permits")
            with closing(stranger(own_bridge.endpoint)) as other:
                enables: Any = other.declare_publisher("operation_enabled")
                until(lambda: enables.matching_status.matching, "it sees who reads the permission")
                enables.put(encoded(BOOL, True))
                until(lambda: "another Zenoh session" in kiosk.widget("start")["reason"], "it is named")
                assert kiosk.press("start", inputs={}).json()["outcome"] == "refused"
            node.every("/operation_enabled", {"data": True}, 0.2)  # the bridge may discover it late
            until(lambda: kiosk.widget("start")["enabled"], "the robot's own value counts")
            assert node.heard("/start") == []
    finally:
        node.end()


def stranger(endpoint: str) -> zenoh.Session:
    config = zenoh.Config()
    for place, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "timestamping/enabled": True,
    }.items():
        config.insert_json5(place, json.dumps(value))
    return zenoh.open(config)
