"""Two real nodes publish on one topic of a real bridge: parts of a list, or each another value."""

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server
from tests.tools.doctor.setups import Setup

STATE: Final = "sensor_msgs/msg/JointState"
LOOKS: Final = 100
PANEL: Final = """
title = "Cell"
mode = "live"

[[interlock]]
id = "lift"
topic = "/joint_states"
type = "sensor_msgs/msg/JointState"
field = "position[name=lift]"
max = 0.5
max_age_s = 5

[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = { data = true }
interlock = "lift"
[[page.widget]]
id = "arm"
kind = "joints"
label = "Arm"
max_age_s = 5
joint = [
  { name = "lift", unit = "m", min = 0, max = 1 },
  { name = "finger", unit = "m", min = 0, max = 1 },
]
[[page.widget]]
id = "past"
kind = "trend"
label = "Past"
disk = false

[[page.widget.pen]]
label = "Finger"
topic = "/joint_states"
type = "sensor_msgs/msg/JointState"
field = "position[name=finger]"
"""


@pytest.fixture
def nodes(domain: int, own_bridge: Bridge) -> Iterator[Callable[[str], RosNode]]:
    """Starts nodes behind `own_bridge`."""
    with ExitStack() as stack:

        def started(name: str) -> RosNode:
            node = RosNode(own_bridge.domain, name)
            stack.callback(node.end)
            return node

        yield started


def joint(name: str, position: float) -> dict[str, Any]:
    return {"name": [name], "position": [position]}


def test_joints_of_two_nodes_do_not_disturb_each_other(
    own_bridge: Bridge, nodes: Callable[[str], RosNode], tmp_path: Path
) -> None:
    lift, finger = nodes("lift"), nodes("finger")
    for node, name in ((lift, "lift"), (finger, "finger")):
        node.advertise("/joint_states", STATE)
        node.every("/joint_states", joint(name, 0.25), 0.05)
    with live_server(own_bridge, tmp_path, PANEL) as kiosk:
        until(lambda: kiosk.widget("go")["enabled"], "the lift's position is received")
        both = ["normal", "normal"]
        until(lambda: kiosk.widget("arm")["joint_levels"] == both, "both parts are received")
        until(lambda: [value for value in past(kiosk) if value is not None], "the trend has begun")
        assert looks(kiosk) == {(True, ("+0.2", "+0.2"))}
        shown = past(kiosk)  # with gaps only where it begins, and where a node stood still
        assert shown.count(None) < len(shown) / 4
        lift.end()
        until(lambda: not kiosk.widget("go")["enabled"], "the lift's position is old")
        assert kiosk.widget("go")["reason"].startswith(
            "Locked: position[name=lift] on /joint_states is"
        )
        arm = kiosk.widget("arm")
        assert (arm["state"], arm["joint_levels"]) == ("live", ["missing", "normal"])
    # Else the bridge may not find the second node: `deploy/fastdds.xml`.
    assert "invalid type object" not in own_bridge.process.text


PERMIT: Final = """
title = "Cell"
mode = "live"

[[interlock]]
id = "loose"
label = "Door"
topic = "/permit"
type = "std_msgs/msg/Bool"

[[interlock]]
id = "strict"
topic = "/permit"
type = "std_msgs/msg/Bool"
publishers = "one"

[[page]]
id = "one"
title = "One"
""" + "".join(
    f"""
[[page.widget]]
id = "{lock}_go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
interlock = "{lock}"
"""
    for lock in ("loose", "strict")
)


def test_second_publisher_of_a_single_publisher_interlock_locks_and_is_named(
    own_bridge: Bridge, nodes: Callable[[str], RosNode], tmp_path: Path
) -> None:
    door, robot = nodes("door"), nodes("robot")
    door.advertise("/permit", "std_msgs/msg/Bool")
    door.every("/permit", {"data": True}, 0.05)
    with live_server(own_bridge, tmp_path, PERMIT) as kiosk:
        until(lambda: kiosk.widget("strict_go")["enabled"], "one publisher permits")
        robot.advertise("/permit", "std_msgs/msg/Bool")
        robot.every("/permit", {"data": False}, 0.05)
        until(lambda: not kiosk.widget("strict_go")["enabled"], "there are two")
        named = "/permit is published by /door, /robot."
        strict = "Locked: /permit has 2 publishers. Only one node may publish this permission."
        until(lambda: kiosk.widget("strict_go")["reason"] == f"{strict} {named}", "both are named")
        assert {permission[0] for permission in permissions(kiosk)} == {False}
        until(
            lambda: "Door is published by /door, /robot." in (kiosk.widget("loose_go")["reason"] or ""),
            "the flapping one names both",
        )
        assert findings(own_bridge, tmp_path) == ["/door, /robot"]
        robot.end()
        until(lambda: kiosk.widget("strict_go")["enabled"], "one is left")


def permissions(kiosk: Server) -> set[Any]:
    """(strict, loose) permissions, looked at so often."""
    seen = set()
    for _ in range(LOOKS):
        widgets = kiosk.snapshot()["widgets"]
        seen.add((widgets["strict_go"]["enabled"], widgets["loose_go"]["enabled"]))
    return seen


def findings(bridge: Bridge, folder: Path) -> list[str]:
    """The nodes that `doctor` names as publishers of a permission."""
    reported = Setup(folder).findings(PERMIT, bridge.endpoint)
    return [
        str(finding.details["nodes"]) for finding in reported if finding.code == "permission_publishers"
    ]


def looks(kiosk: Server) -> set[Any]:
    """What the page shows, looked at so often."""
    seen = set()
    for _ in range(LOOKS):
        widgets = kiosk.snapshot()["widgets"]
        seen.add((widgets["go"]["enabled"], tuple(widgets["arm"]["joint_values"])))
        time.sleep(0.01)
    return seen


def past(kiosk: Server) -> list[float | None]:
    """The values of the trend; None stands for a gap."""
    trend = kiosk.http.get("/widgets/past/trend", params={"span_s": 60}).json()
    return list(trend["pens"][0])
