"""A panel with a hold, the robot that permits it, and the ends of holds in the server's log."""

import re
from pathlib import Path
from typing import Final

from tests.support.panel_text import OPERATION
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

PAGES: Final = """
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "speed"
kind = "slider"
label = "Speed"
min = 0
max = 1
step = 0.1
default = 0.5
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "geometry_msgs/msg/Point"
message = { x = "{speed}", y = 0, z = 0 }
release = { x = 0, y = 0, z = 0 }
rate_hz = 50
interlock = "operation"
"""
PANEL: Final = f'title = "Jog"\n{OPERATION}{PAGES}'
TOPIC: Final = "/jog"
PATIENT: Final = "tests.support.apps.patient:app"  # its leases are those that a busy machine keeps
TRIES: Final = 5  # on a machine that stands still a hold ends, as it should, before its test does
QUIET_S: Final = 0.4  # longer than a lease: what comes after it would show
ENDED: Final = re.compile(r"hold \w+ of \w+ by .* ended after .* \((\w+)\): (.*)")


def jogging(bridge: Bridge, node: RosNode, folder: Path, app: str = "app.main:app") -> Server:
    """A server with this panel and a robot that permits."""
    mine = live_server(bridge, folder, PANEL, app=app)
    permit(mine, node, True)
    return mine


def permit(
    server: Server,
    node: RosNode,
    permitted: bool,
    topic: str = "/operation_enabled",
    widget: str = "jog",
) -> None:
    """The robot publishes on the interlock's topic until the hold is open, or locked."""

    def says() -> bool:
        node.publish(topic, {"data": permitted})
        return bool(server.widget(widget)["enabled"]) is permitted

    until(says, f"permitted: {permitted}", every_s=0.2)


def ended(server: Server) -> list[tuple[str, str]]:
    """(code, sentence) of every end in the log."""
    matches = map(ENDED.search, list(server.process.lines))
    return [(match[1], match[2]) for match in matches if match]


def codes(server: Server, after: int = 0) -> list[str]:
    """The codes of the ends after the given number of ends."""
    return [code for code, _ in ended(server)[after:]]


def has_ended(server: Server, ends: int) -> bool:
    return len(ended(server)) > ends
