"""A robot of which the panel file does not say how it is reached."""

import asyncio
from typing import Any, cast

from app.cell.link.auto_peer import AutoPeer
from app.cell.link.peer import RobotContext, RobotSignals
from app.cell.permission.verdict import call_blocked, locked
from app.cell.robot.state import RobotState
from app.ros.dialects.auto_dialect import AutoDialect
from app.ros.dialects.bridge_dialect import server_token
from app.ros.dialects.dialect import any_hash
from app.ros.dialects.peer_traits import AUTO_TRAITS
from app.ros.zenoh.session import ZenohSession
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there

SET_BOOL = "std_srvs/srv/SetBool"
CALL = {"id": "set", "kind": "call", "label": "Set", "service": "/set", "type": SET_BOOL}
PANEL = panel_of(CALL)


async def auto_robot() -> RobotState:
    """With a bridge, a service behind it, and an `AutoPeer` that has not decided yet."""
    robot = robot_there(PANEL)
    robot.dialect, robot.traits = AutoDialect(0, any_hash), AUTO_TRAITS
    link = cast(ZenohSession, None)  # not used before the decision
    AutoPeer(RobotContext(PANEL, INTERFACES, robot, link, RobotSignals(), cast(Any, None)))
    robot.graph.apply_token(server_token(BRIDGE, "SS", "set", SET_BOOL), True, NOW)
    return robot


def test_no_server_is_called_before_it_is_known_what_the_robot_is() -> None:
    robot = asyncio.run(auto_robot())
    call: Any = next(widget for widget in PANEL.widgets() if widget.id == "set")
    assert call_blocked(call, robot, NOW + 60) == locked("service_connecting", name="/set")
