"""The test rig: a bridge, two nodes, and a kiosk server with a panel for them.

`robot` publishes the permissions and is the node that fails; `ears` receives what the panel sends, and
keeps running.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from tests.support.form import MEASURES
from tests.support.parts import ENOUGH_S, ROOT, Bridge, RosNode, Server, until, zenoh_file

BOOL: Final = "std_msgs/msg/Bool"
TEXT: Final = "std_msgs/msg/String"
PULSE_S: Final = 0.1
MAX_AGE_S: Final = 0.5

PANEL: Final = """
title = "Faults"

[[interlock]]
id = "kept"            # published once, valid until something fails
topic = "/kept"
type = "std_msgs/msg/Bool"
field = "data"

[[interlock]]
id = "pulsed"          # published periodically
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


def limit(seconds: float) -> float:
    """A time limit, exact in `make faults`, which measures. Elsewhere the tests run beside each other,
    so the limits are loose; `tests/faults/test_faults_on_bridge.py` checks the times."""
    return seconds if MEASURES else seconds + ENOUGH_S


def ears(domain: int) -> RosNode:
    """A node that receives everything that the panel sends."""
    node = RosNode(domain, "ears")
    listening(node)
    return node


def listening(node: RosNode) -> None:
    """The node subscribes to everything that the panel sends."""
    for topic in SENT_ON.values():
        node.subscribe(topic, TEXT, depth=1000)


def permitting(node: RosNode) -> None:
    """The node publishes both permissions: one once and latched, one every `PULSE_S`."""
    node.advertise("/kept", BOOL, durability="transient_local", depth=1)
    node.publish("/kept", {"data": True})
    node.advertise("/pulsed", BOOL)
    node.every("/pulsed", {"data": True}, PULSE_S)


def kiosk(endpoint: str, folder: Path, port: int = 0, panel: str = PANEL, **environment: str) -> Server:
    """A kiosk server as users start it, which writes its stacks when it is aborted."""
    path = folder / "faults.toml"
    path.write_text(panel)
    zenoh = str(zenoh_file(folder, endpoint))
    settings = {"KIOSK_PANEL": str(path), "KIOSK_ZENOH": zenoh, "PYTHONFAULTHANDLER": "1"}
    return Server(ROOT, port, EXACT_LIVENESS="1", **settings, **environment)


class Rig:
    """Bridge and nodes; the bridge listens on `endpoint`."""

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
        """A kiosk server on the rig, with all permissions given."""
        server = kiosk(endpoint or self.endpoint, folder, 0, panel, **environment)
        try:
            until_permitted(server)
            yield server
        finally:
            if server.process.running:
                server.end()

    def end(self) -> None:
        self.bridge.end()
        self.robot.end()
        self.ears.end()


def until_permitted(server: Server) -> None:
    """Waits until every button of the panel is enabled."""
    until(
        lambda: all(server.widget(name)["enabled"] for name in SENT_ON),
        "everything is permitted",
        every_s=0.05,
    )
