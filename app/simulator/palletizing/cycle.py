"""One cycle of the arm, by the part of it that is done (0 to 1): pure."""

import math
from bisect import bisect_right
from typing import Final

CYCLE_S: Final = 3.0  # of 12 s in a real cell, so that a visitor sees boxes arrive
PHASES: Final = ("PICK", "LIFT", "SWING", "PLACE", "RETURN")
STARTS: Final = (0.0, 0.18, 0.32, 0.58, 0.76)  # of the phases, as parts of the cycle
GRASPED: Final = 0.12  # the gripper has the box
PLACED: Final = 0.70  # the box is on the pallet
FED: Final = 0.66  # until here the belt brings the next box

# Degrees of the six joints at the start of each phase, and at the end of the last one.
POSES: Final = (
    (-62.0, 38.0, -22.0, 0.0, 74.0, -62.0),
    (-62.0, 47.0, -30.0, 0.0, 73.0, -62.0),
    (-62.0, 8.0, 6.0, 0.0, 76.0, -62.0),
    (71.0, 12.0, 4.0, 0.0, 74.0, 71.0),
    (71.0, 52.0, -34.0, 0.0, 72.0, 71.0),
    (-62.0, 38.0, -22.0, 0.0, 74.0, -62.0),
)
LAYER_DEG: Final = 3.4  # by which joint 2 stays higher for each layer that is there already
PLACE_POSE: Final = 4


def phase_at(part: float) -> str:
    """The name of the phase."""
    return PHASES[bisect_right(STARTS, part) - 1]


def holds_box(part: float) -> bool:
    """Whether the gripper holds a box."""
    return GRASPED <= part < PLACED


def belt_feeds(part: float) -> bool:
    """Whether the belt brings the next box to the arm."""
    return GRASPED <= part < FED


def joints_at(part: float, layer: int) -> list[float]:
    """The joints in radians, while layers 1 to `layer` - 1 are on the pallet."""
    index = bisect_right(STARTS, part) - 1
    end = STARTS[index + 1] if index + 1 < len(STARTS) else 1.0
    done = (part - STARTS[index]) / (end - STARTS[index])
    eased = done * done * (3 - 2 * done)
    before, after = _pose(index, layer), _pose(index + 1, layer)
    return [math.radians(a + (b - a) * eased) for a, b in zip(before, after, strict=True)]


def _pose(index: int, layer: int) -> tuple[float, ...]:
    pose = POSES[index]
    if index != PLACE_POSE:
        return pose
    return (pose[0], pose[1] - LAYER_DEG * (layer - 1), *pose[2:])
