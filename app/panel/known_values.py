"""What numbers of well-known messages mean, as sentences: the states of a battery, and the error codes
of Nav2, which every robot with Nav2 has alike."""

from collections.abc import Mapping
from typing import Any, Final

from app.system.texts import Text, say

NAV2: Final = "nav2_msgs/"
ERROR_CODE: Final = "error_code"

# (type, field) → value → code of the sentence. The fields of an action are those of its parts.
KNOWN_VALUES: Final[Mapping[tuple[str, str], Mapping[int, str]]] = {
    ("sensor_msgs/msg/BatteryState", "power_supply_status"): {
        0: "battery_status_unknown",
        1: "battery_charging",
        2: "battery_discharging",
        3: "battery_not_charging",
        4: "battery_full",
    },
    ("sensor_msgs/msg/BatteryState", "power_supply_health"): {
        0: "battery_health_unknown",
        1: "battery_good",
        2: "battery_overheated",
        3: "battery_dead",
        4: "battery_overvoltage",
        5: "battery_failed",
        6: "battery_cold",
        7: "battery_watchdog_expired",
        8: "battery_timer_expired",
    },
    ("nav2_msgs/msg/CollisionMonitorState", "action_type"): {
        0: "collision_none",
        1: "collision_stop",
        2: "collision_slow",
        3: "collision_approach",
        4: "collision_limit",
    },
    ("nav2_msgs/action/DockRobot", "state"): {
        0: "dock_not_begun",
        1: "dock_driving",
        2: "dock_looking",
        3: "dock_docking",
        4: "dock_waiting_for_charge",
        5: "dock_again",
    },
}

# Nav2's navigators pass on the codes of planners and controllers, so a code means the same in each
# action, since Iron. What says nothing, such as UNKNOWN, has no sentence.
_ERRORS: Final[Mapping[str, tuple[int, ...]]] = {
    "nav2_blocked": (104, 105, 106, 703, 714, 723),
    "nav2_no_way": (103, 208, 308, 402, 403, 405, 503, 504, 505),
    "nav2_goal_occupied": (206, 306),
    "nav2_goal_outside_map": (204, 304),
    "nav2_start_occupied": (205, 305),
    "nav2_start_outside_map": (203, 303),
    "nav2_no_transform": (102, 202, 302, 401, 702, 712, 722, 732, 9002, 9102),
    "nav2_too_slow": (107, 108, 207, 307, 404, 502, 701, 711, 721, 731, 741, 907, 9003, 9103),
    "nav2_misconfigured": (101, 201, 301, 407, 501, 713, 724, 9001, 9101),
    "nav2_no_waypoint": (309, 602),
    "nav2_waypoint_missed": (603,),
    "nav2_task_failed": (406, 601),
    "nav2_dock_unknown": (901, 902),
    "nav2_dock_not_reached": (903, 905),
    "nav2_dock_not_seen": (904,),
    "nav2_no_charge": (906,),
}
NAV2_ERRORS: Final[Mapping[int, str]] = {
    number: sentence for sentence, numbers in _ERRORS.items() for number in numbers
}
# Actions whose codes mean something else.
OWN_ERRORS: Final[Mapping[str, Mapping[int, str]]] = {
    "nav2_msgs/action/FollowObject": {
        901: "nav2_no_transform",
        903: "nav2_blocked",
        904: "nav2_too_slow",
    },
}


def known_value(type_name: str, field: str, value: Any) -> Text | None:
    """What a value of this field means, None if that is not known. An error code is in its sentence."""
    if isinstance(value, bool) or not isinstance(value, int):
        return None
    if code := KNOWN_VALUES.get((type_name, field), {}).get(value):
        return say(code)
    if not type_name.startswith(NAV2) or field.rpartition(".")[2] != ERROR_CODE:
        return None
    sentence = OWN_ERRORS.get(type_name, NAV2_ERRORS).get(value)
    return None if sentence is None else say(sentence, error=str(value))
