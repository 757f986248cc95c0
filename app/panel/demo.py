"""What a simulated robot does: the `[demo]` table of a panel file, and stories."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field

from app.panel.base import Description, Seconds
from app.ros.messages.validation import format_value

# The `[demo]` table of a panel file: what the simulated robot does with single names.

RANGE_LENGTH: Final = 2


def _check_range(value: Any) -> tuple[float, ...]:
    """The lowest and the highest value."""
    numbers = isinstance(value, list | tuple) and len(value) == RANGE_LENGTH
    if not numbers or not all(_is_finite(limit) for limit in value):
        raise ValueError(
            f"must be the lowest and the highest value, like [0, 100], not {format_value(value)}"
        )
    low, high = value
    if high <= low:
        lowest, highest = format_value(low), format_value(high)
        raise ValueError(f"the highest value ({highest}) must be more than the lowest ({lowest})")
    return low, high


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _check_values(value: Any) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple) or not value:
        raise ValueError(f"must be a list of one value at least, not {format_value(value)}")
    for element in value:
        if not isinstance(element, bool | int | float | str):
            raise ValueError(
                f"must be numbers, true or false, or texts; {format_value(element)} is none of them"
            )
    return tuple(value)


# Of numbers as the message has them, before a readout's `scale` and `offset`.
Range = Annotated[tuple[float, ...], BeforeValidator(_check_range)]


class DemoEntry(Description):
    """What the simulated robot does with one topic, service, action or node.

    Of a topic: `range` and `values` are of all fields that the panel shows, `ranges` of one each, and
    `message` fixes other fields. `silent`: the robot does not have it at all.
    """

    silent: bool = False
    range: Range | None = None
    ranges: Mapping[str, Range] = Field(default_factory=dict)
    values: Annotated[tuple[Any, ...], BeforeValidator(_check_values)] | None = None
    message: Mapping[str, Any] = Field(default_factory=dict)
    period_s: Seconds | None = None
    hz: Annotated[float, Field(ge=0.1, le=100)] | None = None
    response: Mapping[str, Any] = Field(default_factory=dict)
    result: Mapping[str, Any] = Field(default_factory=dict)
    duration_s: Seconds | None = None
    parameters: Mapping[str, Any] = Field(default_factory=dict)


NO_ENTRY: Final = DemoEntry()


# The stories that a simulated robot can play: the names that belong together, with their types.

StoryName = Literal["palletizing", "driving"]
Use = Literal["topic", "publication", "service", "action"]  # how a panel uses a name

BOOL: Final = "std_msgs/msg/Bool"
COUNT: Final = "std_msgs/msg/UInt32"
NUMBER: Final = "std_msgs/msg/Float32"
TEXT: Final = "std_msgs/msg/String"
TRIGGER: Final = "std_srvs/srv/Trigger"
SWITCH: Final = "std_srvs/srv/SetBool"
SPEED_LIMIT: Final = "nav2_msgs/msg/SpeedLimit"


@dataclass(frozen=True, slots=True, kw_only=True)
class Story:
    """Name → type of what the robot publishes, subscribes to and serves in a story."""

    publishes: Mapping[str, str]
    subscribes: Mapping[str, str]
    services: Mapping[str, str]
    actions: Mapping[str, str]

    @property
    def types(self) -> Iterator[tuple[Use, str, str]]:
        """(use, name, type) of each name."""
        uses: tuple[tuple[Use, Mapping[str, str]], ...] = (
            ("topic", self.publishes),
            ("publication", self.subscribes),
            ("service", self.services),
            ("action", self.actions),
        )
        for use, names in uses:
            for name, type_name in names.items():
                yield use, name, type_name


PALLETIZING: Final = Story(
    publishes={
        "/cell/state": TEXT,
        "/cell/reason": TEXT,
        "/cell/mode": TEXT,
        "/cell/order": TEXT,
        "/cell/next_order": TEXT,
        "/cell/phase": TEXT,
        "/cell/moving": BOOL,
        "/cell/pallet": COUNT,
        "/boxes": COUNT,
        "/cell/layer": COUNT,
        "/cell/pallet_full": BOOL,
        "/cell/pallet_in_place": BOOL,
        "/cell/last_cycle": NUMBER,
        "/cell/minutes_left": NUMBER,
        "/cell/rate": COUNT,
        "/cell/shift_boxes": COUNT,
        "/cell/rejects": COUNT,
        "/guard_locked": BOOL,
        "/cell/no_fault": BOOL,
        "/cell/air_enough": BOOL,
        "/operation_enabled": BOOL,
        "/cell/start_permitted": BOOL,
        "/cell/pause_permitted": BOOL,
        "/cell/reset_permitted": BOOL,
        "/cell/jog_permitted": BOOL,
        "/cell/pallet_permitted": BOOL,
        "/gripper_closed": BOOL,
        "/vacuum": NUMBER,
        "/air_pressure": "sensor_msgs/msg/FluidPressure",
        "/motor_temperature": "sensor_msgs/msg/Temperature",
        "/joint_states": "sensor_msgs/msg/JointState",
        "/cell/belt_speed": NUMBER,
        "/cell/light": BOOL,
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        "/rosout": "rcl_interfaces/msg/Log",
    },
    subscribes={
        "/cell/stop": "std_msgs/msg/Empty",
        "/cell/belt_jog": NUMBER,
        "/cell/recipe": TEXT,
    },
    services={
        "/cell/start": TRIGGER,
        "/cell/pause": TRIGGER,
        "/reset": TRIGGER,
        "/light": SWITCH,
        "/cell/guard_door": SWITCH,
    },
    actions={"/pallet_out": "example_interfaces/action/Fibonacci"},
)

DRIVING: Final = Story(
    publishes={
        "/map": "nav_msgs/msg/OccupancyGrid",
        "/tf": "tf2_msgs/msg/TFMessage",
        "/tf_static": "tf2_msgs/msg/TFMessage",
        "/amcl_pose": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/odom": "nav_msgs/msg/Odometry",
        "/scan": "sensor_msgs/msg/LaserScan",
        "/plan": "nav_msgs/msg/Path",
        "/local_costmap/published_footprint": "geometry_msgs/msg/PolygonStamped",
        "/local_costmap/costmap": "nav_msgs/msg/OccupancyGrid",
        "/battery_state": "sensor_msgs/msg/BatteryState",
        "/battery_hours_left": NUMBER,
        "/robot_state": TEXT,
        "/robot_mode": TEXT,
        "/robot_place": TEXT,
        "/moving": BOOL,
        "/docked": BOOL,
        "/way_blocked": BOOL,
        "/obstacle": BOOL,
        "/speed_limit": SPEED_LIMIT,
        "/collision_monitor_state": "nav2_msgs/msg/CollisionMonitorState",
        "/safety/estop_released": BOOL,
        "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
        "/rosout": "rcl_interfaces/msg/Log",
    },
    subscribes={
        "/stop": "std_msgs/msg/Empty",
        "/cmd_vel_teleop": "geometry_msgs/msg/TwistStamped",
        "/initialpose": "geometry_msgs/msg/PoseWithCovarianceStamped",
        "/speed_limit": SPEED_LIMIT,
    },
    services={"/manual_mode": SWITCH, "/obstacle": SWITCH},
    actions={
        "/follow_waypoints": "nav2_msgs/action/FollowWaypoints",
        "/navigate_through_poses": "nav2_msgs/action/NavigateThroughPoses",
        "/navigate_to_pose": "nav2_msgs/action/NavigateToPose",
        "/dock_robot": "nav2_msgs/action/DockRobot",
        "/undock_robot": "nav2_msgs/action/UndockRobot",
    },
)

STORIES: Final[Mapping[StoryName, Story]] = {"palletizing": PALLETIZING, "driving": DRIVING}
