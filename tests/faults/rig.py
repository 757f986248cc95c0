"""The parts that faults are tried on: a bridge, two nodes, a kiosk with a panel for it.

`robot` says what is permitted and is the one that breaks; `ears` hears what the kiosk sends, and stays.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from tests.support.parts import ENOUGH_S, ROOT, Bridge, RosNode, Server, until, zenoh_file

LONG: Final = os.environ.get("FAULTS") == "long"
BOOL: Final = "std_msgs/msg/Bool"
TEXT: Final = "std_msgs/msg/String"
PULSE_S: Final = 0.1
MAX_AGE_S: Final = 0.5

PANEL: Final = """
title = "Faults"

[[interlock]]
id = "kept"            # said once, and believed until something breaks
topic = "/kept"
type = "std_msgs/msg/Bool"
field = "data"

[[interlock]]
id = "pulsed"          # said again and again
topic = "/pulsed"
type = "std_msgs/msg/Bool"
field = "data"
max_age_s = 0.5
require_publisher = true

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "message"
kind = "text"
label = "Message"
max_length = 80

[[page.widget]]
id = "free"
kind = "publish"
label = "Free"
topic = "/free"
type = "std_msgs/msg/String"
message = { data = "{message}" }
qos = { depth = 1000 }   # with 10, DDS loses what a busy reader has not fetched

[[page.widget]]
id = "guarded"
kind = "publish"
label = "Guarded"
topic = "/guarded"
type = "std_msgs/msg/String"
message = { data = "{message}" }
qos = { depth = 1000 }
interlock = "kept"

[[page.widget]]
id = "paced"
kind = "publish"
label = "Paced"
topic = "/paced"
type = "std_msgs/msg/String"
message = { data = "{message}" }
qos = { depth = 1000 }
interlock = "pulsed"

[[page.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/heard"
type = "std_msgs/msg/String"
"""
SENT_ON: Final = {"free": "/free", "guarded": "/guarded", "paced": "/paced"}
LISTENED_TO: Final = ("kept", "pulsed", "heard")


def several(short: int, long: int) -> int:
    """How often, or how long: by the form of the suite."""
    return long if LONG else short


def limit(seconds: float) -> float:
    """A limit of time as it is in the long form, which measures. The short one runs beside other tests:
    what happens counts there, and `tests/faults/test_faults_on_bridge.py` asserts the times."""
    return seconds if LONG else seconds + ENOUGH_S


def ears(domain: int) -> RosNode:
    """A node that hears all that the panel sends."""
    node = RosNode(domain, "ears")
    for topic in SENT_ON.values():
        node.subscribe(topic, TEXT, depth=1000)
    return node


def permitting(node: RosNode) -> None:
    """It permits both: once, so that it is kept; and every tenth of a second."""
    node.advertise("/kept", BOOL, durability="transient_local", depth=1)
    node.publish("/kept", {"data": True})
    node.advertise("/pulsed", BOOL)
    node.every("/pulsed", {"data": True}, PULSE_S)


def kiosk(endpoint: str, folder: Path, port: int = 0, panel: str = PANEL, **environment: str) -> Server:
    """A kiosk as users start it, which writes its stacks when it is aborted."""
    path = folder / "faults.toml"
    path.write_text(panel)
    zenoh = str(zenoh_file(folder, endpoint))
    given = {"KIOSK_PANEL": str(path), "KIOSK_ZENOH": zenoh, "PYTHONFAULTHANDLER": "1"}
    return Server(ROOT, port, **given, **environment)


class Rig:
    """Bridge and nodes, behind `endpoint`."""

    def __init__(self, domain: int, ip: str = "127.0.0.1") -> None:
        self.bridge = Bridge(domain)
        self.bridge.endpoint = f"tcp/{ip}:{self.bridge.port}"
        self.bridge.start()
        self.ears = ears(domain)
        self.robot = RosNode(domain, "robot")
        permitting(self.robot)

    @property
    def endpoint(self) -> str:
        return self.bridge.endpoint

    def arrivals(self, widget: str) -> list[tuple[float, str]]:
        """(monotonic seconds, text) of what the robot received from a widget."""
        return [(at, text) for at, text in self.ears.arrivals(SENT_ON[widget])]

    @contextmanager
    def serving(
        self, folder: Path, endpoint: str = "", panel: str = PANEL, **environment: str
    ) -> Iterator[Server]:
        """A kiosk on it that permits everything."""
        server = kiosk(endpoint or self.endpoint, folder, 0, panel, **environment)
        try:
            permitted(server)
            yield server
        finally:
            if server.process.running:
                server.end()

    def end(self) -> None:
        self.bridge.end()
        self.robot.end()
        self.ears.end()


def permitted(server: Server) -> None:
    """Waits until every button of the panel is open."""
    until(
        lambda: all(server.widget(name)["enabled"] for name in SENT_ON),
        "everything is permitted",
        every_s=0.05,
    )
