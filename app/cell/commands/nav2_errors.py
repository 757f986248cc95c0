"""The error codes of Nav2's actions as sentences: pure.

Source: nav2_msgs of ROS 2 jazzy, the codes of FollowPath (100), ComputePathToPose (200),
ComputePathThroughPoses (300), DockRobot (900) and the navigators (9000). Those of 200 and 300 have the
same order.
"""

from collections.abc import Mapping
from typing import Final

from app.panel.response_text import response_paths
from app.panel.widgets.service_action import Action
from app.ros.messages import Interfaces
from app.system.texts import Text, say

PACKAGE: Final = "nav2_msgs/"
CODE, MESSAGE = "error_code", "error_msg"  # fields of the result; the message is there since kilted
_PLANNER: Final[Mapping[int, str]] = {
    1: "nav2_misconfigured",
    2: "nav2_no_transform",
    3: "nav2_start_outside_map",
    4: "nav2_goal_outside_map",
    5: "nav2_start_occupied",
    6: "nav2_goal_occupied",
    7: "nav2_too_slow",
    8: "nav2_no_way",
}
SENTENCES: Final[Mapping[int, str]] = {
    101: "nav2_misconfigured",
    102: "nav2_no_transform",
    103: "nav2_no_way",
    104: "nav2_blocked",
    105: "nav2_blocked",
    106: "nav2_blocked",
    107: "nav2_too_slow",
    **{200 + code: sentence for code, sentence in _PLANNER.items()},
    **{300 + code: sentence for code, sentence in _PLANNER.items()},
    901: "nav2_dock_unknown",
    902: "nav2_dock_unknown",
    903: "nav2_dock_not_reached",
    904: "nav2_dock_not_seen",
    905: "nav2_dock_not_reached",
    906: "nav2_no_charge",
    907: "nav2_too_slow",
    9001: "nav2_misconfigured",
    9002: "nav2_no_transform",
    9003: "nav2_too_slow",
}


def code_path(action: Action, interfaces: Interfaces) -> str | None:
    """The field of the result that has Nav2's code; None of an action without one, or whose `result`
    shows it itself."""
    if not action.type.startswith(PACKAGE):
        return None
    result = interfaces.structures[interfaces.action_types(action.type).result]
    has_code = any(field.name == CODE for field in result.fields)
    return CODE if has_code and not {CODE, MESSAGE} & {*response_paths(action.result)} else None


def sentence_of(code: object) -> Text | None:
    """What happened and what to do; None for a code that says neither."""
    named = SENTENCES.get(code) if isinstance(code, int) else None
    return None if named is None else say(named, error=str(code))
