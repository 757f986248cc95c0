"""Small real things that unit tests are made of: a panel, a robot that is there, what it says."""

from collections.abc import Mapping
from typing import Any, Final

from app import keys
from app.interfaces import interfaces_of
from app.keys import Qos, TopicRole
from app.panel.model import Panel
from app.robot import Robot, Sample

Table = Mapping[str, Any]

INTERFACES: Final = interfaces_of("jazzy")
BOOL: Final = "std_msgs/msg/Bool"
TEXT: Final = "std_msgs/msg/String"
BRIDGE: Final = "b1"
KIOSK: Final = "c1"
ENABLED: Final = "/operation_enabled"
NOW: Final = 1000.0  # monotonic seconds
NOTHING: Final[Table] = {}

INTERLOCK: Final[Table] = {"id": "operation", "topic": ENABLED}
MESSAGE: Final[Table] = {"id": "message", "kind": "text", "label": "Message", "max_length": 8}
FREE: Final[Table] = {
    "id": "free",
    "kind": "publish",
    "label": "Free",
    "topic": "/free",
    "type": TEXT,
    "message": {"data": "{message}"},
}
GUARDED: Final[Table] = {**FREE, "id": "guarded", "topic": "/guarded", "interlock": "operation"}
HEARD: Final[Table] = {
    "id": "heard",
    "kind": "readout",
    "label": "Heard",
    "topic": "/heard",
    "type": TEXT,
}


def panel_of(*widgets: Table, interlock: Table = NOTHING, **more: Any) -> Panel:
    """A panel of one page; `interlock` changes the one that it has."""
    page = {"id": "one", "title": "One", "widget": list(widgets)}
    tables = {"title": "Cell", "interlock": [{**INTERLOCK, **interlock}], "page": [page]}
    return Panel.model_validate({**tables, **more})


def small_panel(interlock: Table = NOTHING, **more: Any) -> Panel:
    """One widget of each kind, and a button behind the interlock."""
    return panel_of(MESSAGE, FREE, GUARDED, HEARD, interlock=interlock, **more)


def robot_there(panel: Panel) -> Robot:
    """A robot that commands can reach: a link, a bridge, joined; it has said nothing yet."""
    robot = Robot(panel, INTERFACES, KIOSK)
    robot.link_up = True
    robot.settled_at = 0.0
    robot.graph.apply(keys.bridge_token(BRIDGE), True)
    return robot


def endpoint(
    robot: Robot,
    role: TopicRole,
    topic: str,
    type_name: str,
    zid: str = BRIDGE,
    alive: bool = True,
    qos: Qos | None = None,
) -> None:
    """A publisher ("MP") or subscriber ("MS") appears behind a bridge, or ends."""
    type_hash = INTERFACES.type_hash(type_name)
    token = keys.token(zid, role, robot.key(topic), type_name, qos or Qos(), type_hash)
    robot.graph.apply(token, alive)


def says(
    robot: Robot,
    topic: str,
    data: Any,
    type_name: str = TEXT,
    *,
    at: float = NOW,
    seq: int = 1,
    source: str | None = BRIDGE,
) -> None:
    """The robot publishes a message whose only field is `data`."""
    payload = INTERFACES.encode(type_name, {"data": data})
    robot.take(robot.key(topic), Sample(payload, seq, at, at, source))


def permits(robot: Robot, permitted: bool = True, *, at: float = NOW) -> None:
    """The robot says whether operation is permitted."""
    says(robot, ENABLED, permitted, BOOL, at=at)
