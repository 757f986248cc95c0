"""The stories that a simulated robot can play: the names that belong together, with their types."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final, Literal

StoryName = Literal["palletizing"]
Use = Literal["topic", "publication", "service", "action"]  # how a panel uses a name

BOOL: Final = "std_msgs/msg/Bool"
COUNT: Final = "std_msgs/msg/UInt32"
NUMBER: Final = "std_msgs/msg/Float32"
TEXT: Final = "std_msgs/msg/String"
TRIGGER: Final = "std_srvs/srv/Trigger"
SWITCH: Final = "std_srvs/srv/SetBool"


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
        "/cell/last_cycle": NUMBER,
        "/cell/minutes_left": NUMBER,
        "/cell/rate": COUNT,
        "/cell/shift_boxes": COUNT,
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

STORIES: Final[Mapping[StoryName, Story]] = {"palletizing": PALLETIZING}
