"""The story `palletizing`: a cell in which an arm stacks boxes on a pallet. Pure, stepped with time."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from math import nan
from random import Random
from typing import Any, Final

from app.panel.demo import PALLETIZING, Story
from app.tools.simulator.known_types import JOINTS, Moment, header
from app.tools.simulator.parameters import NODE, NodeParameters
from app.tools.simulator.robot import (
    CANCEL_OK,
    CANCEL_TOO_LATE,
    CANCEL_UNKNOWN,
    CANCELED,
    EVERY_GOAL,
    EXECUTING,
    KEPT_GOALS,
    SUCCEEDED,
)
from app.tools.simulator.story import (
    PlayedStory,
    StoryTopic,
    StoryTopics,
    diagnostic_status,
    log_fields,
)

# One cycle of the arm, by the part of it that is done (0 to 1): pure.

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


# The states of the palletizing cell, and why it refuses a command, in words.


class State(StrEnum):
    """What the cell does."""

    RUNNING = "RUNNING"
    PAUSED = "PAUSED"
    WAITING = "WAITING"
    FAULT = "FAULT"
    MANUAL = "MANUAL"
    STOPPED = "STOPPED"


class Reason(StrEnum):
    """Why the cell waits or has a fault."""

    NONE = ""
    PALLET_FULL = "PALLET_FULL"
    AIR_LOW = "AIR_LOW"
    GUARD_DOOR = "GUARD_DOOR"


REFUSED: Final = {
    State.RUNNING: "The cell runs. Press Pause or Stop.",
    State.PAUSED: "The cell is paused.",
    State.WAITING: "The cell waits, and goes on by itself.",
    State.FAULT: "The cell has a fault. Close the guard door, then press Reset.",
    State.MANUAL: "The belt is moved by hand. Release its button.",
    State.STOPPED: "The cell is stopped.",
}
DOOR_OPEN: Final = "The guard door is open. Close it."
AIR_IS_LOW: Final = "The air pressure is low. Wait until it is above 5.2 bar."
GOES_OUT: Final = "A pallet goes out. Wait until it is out."
NO_FAULT: Final = "The cell has no fault."
NOT_FULL: Final = "The pallet is not full."
HELD_ON: Final = "Stop was pressed. Release the button, then hold it again."


# What surrounds the arm and changes without a command: compressed air, the motor's temperature, a door
# that someone opens. Pure, with a seeded generator of random numbers.

LOW_BAR: Final = 5.0
ENOUGH_BAR: Final = 5.2  # above this, air that was low is enough again
USUAL_BAR: Final = 5.6
DIP_BAR: Final = 0.95
DIP_RAMP_S: Final = 5.0
DIP_S: Final = 22.0  # of the whole dip, with both ramps
FIRST_DIP_S: Final = 45.0
DIPS_S: Final = (150.0, 300.0)  # between two dips

FIRST_DOOR_S: Final = 100.0  # of running
DOORS_S: Final = (240.0, 480.0)  # of running, between two openings
OPEN_S: Final = 12.0

COLD_C: Final = 31.0
WARM_C: Final = 52.0
WARMING_S: Final = 150.0


class AirSupply:
    """Air at the inlet. It falls now and then; `is_enough` has a deadband."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._dip_at = FIRST_DIP_S
        self.bar = USUAL_BAR
        self.is_enough = True

    def step(self, t: float) -> None:
        if t >= self._dip_at + DIP_S:
            self._dip_at = t + self._random.uniform(*DIPS_S)
        ripple = 0.10 * math.sin(t / 6) + 0.04 * math.sin(t / 1.7)
        self.bar = USUAL_BAR + ripple - DIP_BAR * self._depth(t)
        self.is_enough = self.bar > (LOW_BAR if self.is_enough else ENOUGH_BAR)

    def _depth(self, t: float) -> float:
        since = t - self._dip_at
        return max(0.0, min(1.0, since / DIP_RAMP_S, (DIP_S - since) / DIP_RAMP_S))


class GuardDoor:
    """The guard door. Someone opens it now and then while the cell runs, and closes it again; a door
    that was opened by command stays open until the command to close it."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._opens_in = FIRST_DOOR_S
        self._closes_at: float | None = None
        self.is_open = False

    def step(self, t: float, dt: float, *, running: bool) -> None:
        if self._closes_at is not None and t >= self._closes_at:
            self.move(opened=False)
        elif running and not self.is_open:
            self._opens_in -= dt
            if self._opens_in <= 0:
                self._opens_in = self._random.uniform(*DOORS_S)
                self.is_open, self._closes_at = True, t + OPEN_S

    def move(self, *, opened: bool) -> None:
        """Opens or closes it by command."""
        self.is_open, self._closes_at = opened, None


class Motor:
    """The temperature of the arm's motor, which rises while the arm moves."""

    def __init__(self) -> None:
        self.celsius = 47.0

    def step(self, dt: float, *, moving: bool) -> None:
        target = WARM_C if moving else COLD_C
        self.celsius += (target - self.celsius) * dt / WARMING_S


# The palletizing cell as a state machine: pure, stepped with time.
#
# A command returns "" if it is done, else why the cell refuses it, in words. A fault is latched: it
# ends when the guard door is closed and the cell is reset. Start then goes on with the box at which the
# arm stopped. Nothing moves while the guard door is open. With `heals_s` someone does all this so long
# after the last command.

BOXES: Final = 144  # of a full pallet
LAYER: Final = 24
LAYERS: Final = BOXES // LAYER
SLICE_S: Final = 0.1  # the cell is stepped in slices, so that a late step leaves nothing out
LONGEST_STEP_S: Final = 5.0  # a machine that slept goes on where it was
JITTER: Final = 0.04  # of a cycle's duration
JOG_S: Final = 0.3  # the belt stops without a message for so long
OUT_S: Final = 6.0  # a pallet goes out
LIGHT_S: Final = 0.4  # until the lamp reports what it was switched to
HOUR_S: Final = 3600.0
FIRST_BOXES: Final = 87
FIRST_PALLET: Final = 11
BOXES_FOR_A_REJECT: Final = 90
FIRST_RATE: Final = 1148  # boxes in the hour before
SPEED_MM_S: Final = 120.0


# Levels of rcl_interfaces/msg/Log.
LOG_INFO, LOG_WARN, LOG_ERROR = 20, 30, 40


class PalletizingCell:
    """The cell. `notes` has what it says since the last call, as (level, text) of a ROS log."""

    def __init__(self, seed: int = 0, heals_s: float | None = None) -> None:
        self._random = Random(seed)
        self.air = AirSupply(Random(self._random.random()))
        self.door = GuardDoor(Random(self._random.random()))
        self.motor = Motor()
        self.t = 0.0
        self.state, self.reason = State.RUNNING, Reason.NONE
        self.boxes, self.pallet = FIRST_BOXES, FIRST_PALLET
        self.part = 0.0  # of the cycle
        self.cycle_s = self.last_cycle_s = CYCLE_S
        self.pauses = False  # after this box
        self.out_s: float | None = None  # since when a pallet goes out
        self.light = False
        self.order, self.next_order = "4711", "4711"
        self.speed_mm_s = SPEED_MM_S
        self._light_at, self._light_wanted = 0.0, False
        self._heals_s, self._heals_at = heals_s, math.inf
        self._jog, self._jog_until, self._before_jog = 0.0, 0.0, State.STOPPED
        self._jog_barred = False  # by a stop, until the button is released
        spacing = HOUR_S / FIRST_RATE
        self._placed = deque(-HOUR_S + spacing * (number + 1) for number in range(FIRST_RATE))
        self._notes = [(LOG_INFO, f"runs, box {self.boxes + 1} is next")]

    # What it is.

    @property
    def layer(self) -> int:
        """The layer that the next box belongs to, from 1."""
        return min(self.boxes // LAYER + 1, LAYERS)

    @property
    def is_full(self) -> bool:
        return self.boxes >= BOXES

    @property
    def arm_moves(self) -> bool:
        return self.state is State.RUNNING

    @property
    def holds_box(self) -> bool:
        return holds_box(self.part)

    @property
    def belt_mm_s(self) -> float:
        """The speed of the belt: negative towards the infeed."""
        if self.state is State.MANUAL:
            return self._jog * self.speed_mm_s
        return self.speed_mm_s if self.arm_moves and belt_feeds(self.part) else 0.0

    @property
    def moves(self) -> bool:
        """Whether anything moves."""
        return self.arm_moves or self.belt_mm_s != 0 or self.out_s is not None

    @property
    def rate(self) -> int:
        """Boxes in the last hour."""
        return len(self._placed)

    @property
    def shift_boxes(self) -> int:
        return (self.pallet - 1) * BOXES + self.boxes

    @property
    def rejects(self) -> int:
        """Boxes of the shift that were sorted out: a damaged one now and then."""
        return self.shift_boxes // BOXES_FOR_A_REJECT

    @property
    def left_s(self) -> float:
        """Seconds until the pallet is full, at the speed of the last cycle."""
        return (BOXES - self.boxes) * self.last_cycle_s

    @property
    def goes_on(self) -> bool:
        """Whether it goes on without a command."""
        return self.state in (State.RUNNING, State.WAITING)

    @property
    def may_start(self) -> bool:
        return not self._refused_start()

    @property
    def may_jog(self) -> bool:
        return not self._refused_jog()

    @property
    def may_reset(self) -> bool:
        return self.state is State.FAULT and not self.door.is_open

    @property
    def may_move_pallet(self) -> bool:
        return not self._refused_pallet()

    def notes(self) -> list[tuple[int, str]]:
        notes, self._notes = self._notes, []
        return notes

    # Commands.

    def start(self) -> str:
        if refused := self._refused_start():
            return refused
        self.state, self.reason, self.pauses = State.RUNNING, Reason.NONE, False
        self._note(f"started with box {min(self.boxes + 1, BOXES)}")
        self._wait_or_run()
        return ""

    def pause(self) -> str:
        """The cell pauses when this box is placed and the arm is back."""
        if self.state is not State.RUNNING:
            return REFUSED[self.state]
        self.pauses = True
        return ""

    def stop(self) -> str:
        """Everything stops at once; of a fault, it goes on being one."""
        self.out_s, self.pauses, self._jog_barred = None, False, True
        if self.state is not State.FAULT:
            self.state, self.reason = State.STOPPED, Reason.NONE
            self._note("stopped")
        return ""

    def reset(self) -> str:
        self._wait_to_heal()
        if self.state is not State.FAULT:
            return NO_FAULT
        if self.door.is_open:
            return DOOR_OPEN
        self.state, self.reason = State.STOPPED, Reason.NONE
        self._note("reset")
        return ""

    def jog(self, direction: float) -> str:
        """Moves the belt until `JOG_S` after the last call; 0 stops it."""
        self._jog_barred = self._jog_barred and direction != 0 and self.t < self._jog_until
        self._jog, self._jog_until = max(-1.0, min(direction, 1.0)), self.t + JOG_S
        if direction == 0:
            self._end_jog()
            return ""
        if refused := HELD_ON if self._jog_barred else self._refused_jog():
            return refused
        if self.state is not State.MANUAL:
            self._before_jog, self.state = self.state, State.MANUAL
        return ""

    def move_pallet_out(self) -> str:
        refused = self._refused_pallet()
        if not refused:
            self.out_s = 0.0
        return refused

    def keep_pallet(self) -> None:
        """Cancels a pallet that goes out: it stays."""
        self.out_s = None

    def switch_light(self, *, on: bool) -> None:
        self._light_at, self._light_wanted = self.t + LIGHT_S, on

    def load_order(self, order: str) -> None:
        """The order of the next pallet."""
        self.next_order = order

    def move_door(self, *, opened: bool) -> None:
        self.door.move(opened=opened)
        self._wait_to_heal()

    # Time.

    def step(self, t: float) -> None:
        """Goes on to `t`, in seconds since the start."""
        self.t = max(self.t, t - LONGEST_STEP_S)
        while self.t < t - 1e-9:
            self._advance(min(SLICE_S, t - self.t))

    def _advance(self, dt: float) -> None:
        self.t += dt
        self.air.step(self.t)
        self.door.step(self.t, dt, running=self.state is State.RUNNING)
        if self.door.is_open and self.state is not State.FAULT:
            self._fail()
        if self.state is State.FAULT and self.t >= self._heals_at and self.air.is_enough:
            self._heal()
        self.motor.step(dt, moving=self.arm_moves)
        if self.t >= self._light_at:
            self.light = self._light_wanted
        if self.state is State.MANUAL and self.t >= self._jog_until:
            self._end_jog()
        if self.state is State.RUNNING:
            self._move_arm(dt)
        if self.out_s is not None:
            self._move_pallet(dt)
        if self.state is State.WAITING:
            self._wait_or_run()
        while self._placed and self._placed[0] <= self.t - HOUR_S:
            self._placed.popleft()

    def _move_arm(self, dt: float) -> None:
        before, self.part = self.part, self.part + dt / self.cycle_s
        if before < PLACED <= self.part:
            self.boxes += 1
            self._placed.append(self.t)
            self._note(f"box {self.boxes} placed")
        if self.part >= 1:
            self._end_cycle()

    def _end_cycle(self) -> None:
        self.part, self.last_cycle_s = 0.0, self.cycle_s
        self.cycle_s = CYCLE_S * (1 + self._random.uniform(-JITTER, JITTER))
        if self.pauses:
            self.state, self.pauses = State.PAUSED, False
            self._note("paused")
        else:
            self._wait_or_run()

    def _wait_or_run(self) -> None:
        """Between two boxes: waits for an empty pallet or for air, and runs as soon as there are."""
        if self.part > 0:
            return
        lack = Reason.NONE if self.air.is_enough else Reason.AIR_LOW
        reason = Reason.PALLET_FULL if self.is_full else lack
        if reason and reason is not self.reason:
            self._note(f"waiting: {reason.replace('_', ' ').lower()}", LOG_WARN)
        self.reason = reason
        self.state = State.WAITING if reason else State.RUNNING

    def _move_pallet(self, dt: float) -> None:
        self.out_s = (self.out_s or 0.0) + dt
        if self.out_s >= OUT_S:
            self._note(f"pallet {self.pallet} is out")
            self.boxes, self.pallet, self.out_s = 0, self.pallet + 1, None
            self.order = self.next_order

    def _fail(self) -> None:
        self.stop()
        self.state, self.reason = State.FAULT, Reason.GUARD_DOOR
        self._note("guard door 1 opened", LOG_ERROR)
        self._wait_to_heal()

    def _wait_to_heal(self) -> None:
        self._heals_at = math.inf if self._heals_s is None else self.t + self._heals_s

    def _heal(self) -> None:
        self.door.move(opened=False)
        self.reset()
        self.start()

    def _end_jog(self) -> None:
        if self.state is State.MANUAL:
            self.state = self._before_jog
        self._jog = 0.0

    def _refused_start(self) -> str:
        if self.out_s is not None:
            return GOES_OUT
        if self.state not in (State.PAUSED, State.STOPPED):
            return REFUSED[self.state]
        return "" if self.air.is_enough else AIR_IS_LOW

    def _refused_jog(self) -> str:
        if self.out_s is not None:
            return GOES_OUT
        return REFUSED[self.state] if self.state in (State.RUNNING, State.FAULT) else ""

    def _refused_pallet(self) -> str:
        if not self.is_full:
            return NOT_FULL
        if self.out_s is not None:
            return GOES_OUT
        refuses = self.state in (State.RUNNING, State.FAULT, State.MANUAL)
        return REFUSED[self.state] if refuses else ""

    def _note(self, text: str, level: int = LOG_INFO) -> None:
        self._notes.append((level, text))


# What the palletizing cell publishes: a row for each topic, with the fields of its message. Pure.

Fields = dict[str, Any]
PA_PER_BAR: Final = 1e5
HOLDING_KPA: Final = -71.0
OPEN_KPA: Final = -64.5
OK, WARN, ERROR = 0, 1, 2  # diagnostic_msgs/msg/DiagnosticStatus
HOT_C: Final = 60.0


CellTopic = StoryTopic["PalletizingCell"]


def vacuum_kpa(cell: PalletizingCell) -> float:
    """The vacuum at the gripper. An ejector makes it, so it is weaker when air is low."""
    full = HOLDING_KPA if cell.holds_box else OPEN_KPA
    return full * min(1.0, cell.air.bar / USUAL_BAR + 0.03)


def _stamped(name: str) -> Callable[[Any, Moment], Fields]:
    return lambda value, moment: {"header": header(moment), name: value}


def _joints(positions: list[float], moment: Moment) -> Fields:
    return {"header": header(moment), "name": list(JOINTS), "position": positions}


def _parts(cell: PalletizingCell) -> list[Fields]:
    """The statuses of the cell's parts: of each (level, name, message, values)."""
    return [diagnostic_status(*part) for part in _statuses(cell)]


Status = tuple[int, str, str, Mapping[str, str]]


def _statuses(cell: PalletizingCell) -> Iterator[Status]:
    hot = cell.motor.celsius > HOT_C
    opened, fault = cell.door.is_open, cell.state is State.FAULT
    does = "motors off" if fault else "moves" if cell.arm_moves else "stands"
    yield WARN if hot else OK, "Arm", does, {"motor": f"{cell.motor.celsius:.0f} °C"}
    said = "open" if opened else "closed, needs a reset" if fault else "locked"
    yield ERROR if opened else WARN if fault else OK, "Guard door 1", said, {}
    enough = cell.air.is_enough
    holds = f"holds box {cell.boxes + 1}" if cell.holds_box else "open"
    vacuum = {"vacuum": f"{vacuum_kpa(cell):.0f} kPa"}
    yield OK if enough else WARN, "Gripper", holds if enough else "vacuum is weak", vacuum
    pressure = {"pressure": f"{cell.air.bar:.1f} bar", "low": f"{LOW_BAR:.1f} bar"}
    yield OK if enough else WARN, "Air supply", "enough" if enough else "low", pressure
    full = cell.reason is Reason.PALLET_FULL
    yield WARN if full else OK, "Pallet", "full, waits" if full else f"{cell.boxes} boxes", {}


def _minutes_left(cell: PalletizingCell) -> float | None:
    """None while the cell does not go on by itself: no one knows when the pallet is full."""
    return round(cell.left_s / 60, 1) if cell.goes_on else None


MOVING: Final = 0.2  # seconds between the messages of what changes all the time

ROWS: Final[Mapping[str, CellTopic]] = {
    "/cell/state": CellTopic(lambda cell: cell.state.value),
    "/cell/reason": CellTopic(lambda cell: cell.reason.value),
    "/cell/mode": CellTopic(lambda cell: "MANUAL" if cell.state is State.MANUAL else "AUTOMATIC"),
    "/cell/order": CellTopic(lambda cell: cell.order),
    "/cell/next_order": CellTopic(lambda cell: cell.next_order),
    "/cell/phase": CellTopic(lambda cell: phase_at(cell.part)),
    "/cell/moving": CellTopic(lambda cell: cell.moves),
    "/cell/pallet": CellTopic(lambda cell: cell.pallet),
    "/boxes": CellTopic(lambda cell: cell.boxes),
    "/cell/layer": CellTopic(lambda cell: cell.layer),
    "/cell/pallet_full": CellTopic(lambda cell: cell.is_full and not cell.arm_moves),
    "/cell/pallet_in_place": CellTopic(lambda cell: cell.out_s is None),
    "/cell/last_cycle": CellTopic(lambda cell: round(cell.last_cycle_s, 2)),
    "/cell/minutes_left": CellTopic(
        _minutes_left, lambda value, _: {"data": nan if value is None else value}
    ),
    "/cell/rate": CellTopic(lambda cell: cell.rate),
    "/cell/shift_boxes": CellTopic(lambda cell: cell.shift_boxes),
    "/cell/rejects": CellTopic(lambda cell: cell.rejects),
    "/guard_locked": CellTopic(lambda cell: not cell.door.is_open),
    "/cell/no_fault": CellTopic(lambda cell: cell.state is not State.FAULT),
    "/cell/air_enough": CellTopic(lambda cell: cell.air.is_enough),
    "/operation_enabled": CellTopic(lambda cell: cell.state is not State.FAULT),
    "/cell/start_permitted": CellTopic(lambda cell: cell.may_start),
    "/cell/pause_permitted": CellTopic(lambda cell: cell.state is State.RUNNING),
    "/cell/reset_permitted": CellTopic(lambda cell: cell.may_reset),
    "/cell/jog_permitted": CellTopic(lambda cell: cell.may_jog),
    "/cell/pallet_permitted": CellTopic(lambda cell: cell.may_move_pallet),
    "/gripper_closed": CellTopic(lambda cell: cell.holds_box),
    "/vacuum": CellTopic(lambda cell: round(vacuum_kpa(cell), 1), least_s=MOVING, latched=False),
    "/air_pressure": CellTopic(
        lambda cell: round(cell.air.bar * PA_PER_BAR, -2),
        _stamped("fluid_pressure"),
        least_s=MOVING,
        latched=False,
    ),
    "/motor_temperature": CellTopic(
        lambda cell: round(cell.motor.celsius, 2), _stamped("temperature"), least_s=1.0, latched=False
    ),
    "/joint_states": CellTopic(
        lambda cell: joints_at(cell.part, cell.layer), _joints, least_s=MOVING, latched=False
    ),
    "/cell/belt_speed": CellTopic(lambda cell: cell.belt_mm_s),
    "/cell/light": CellTopic(lambda cell: cell.light),
    "/diagnostics": CellTopic(_parts, _stamped("status"), least_s=1.0, latched=False),
}


# The palletizing cell as a part of a simulated robot: its messages, commands and the action by which a
# full pallet goes out. Pure.

ABORTED: Final = 6  # action_msgs/msg/GoalStatus
LOG: Final = "/rosout"
STATE: Final = "/cell/state"
OUT: Final = "/pallet_out"


class PalletOut:
    """The action `/pallet_out`: one goal at a time. Its feedback and its result are the percentage that
    is done, as the only number of a sequence: ROS 2 itself has no action with a progress."""

    type = PALLETIZING.actions[OUT]

    def __init__(self, cell: PalletizingCell) -> None:
        self._cell = cell
        self._goals: dict[bytes, int] = {}
        self._running: bytes | None = None
        self._pallet = 0
        self._reported = -1

    def step(self) -> None:
        """Ends the running goal when its pallet is out, or stays."""
        if self._running is not None and self._cell.out_s is None:
            out = self._cell.pallet > self._pallet
            self._goals[self._running] = SUCCEEDED if out else ABORTED
            self._running = None

    def begin(self, goal_id: bytes, goal: Any) -> bool:
        if goal_id in self._goals or self._cell.move_pallet_out():
            return False
        self._goals[goal_id], self._running = EXECUTING, goal_id
        self._pallet, self._reported = self._cell.pallet, -1
        for old in list(self._goals)[:-KEPT_GOALS]:
            del self._goals[old]
        return True

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        if goal_id != EVERY_GOAL and goal_id not in self._goals:
            return CANCEL_UNKNOWN, []
        if self._running is None or goal_id not in (EVERY_GOAL, self._running):
            return CANCEL_OK if goal_id == EVERY_GOAL else CANCEL_TOO_LATE, []
        canceled, self._running = self._running, None
        self._cell.keep_pallet()
        self._goals[canceled] = CANCELED
        return CANCEL_OK, [canceled]

    def feedback(self) -> list[tuple[bytes, Fields]]:
        percent = self._percent()
        if self._running is None or percent == self._reported:
            return []
        self._reported = percent
        return [(self._running, {"sequence": [percent]})]

    def states(self) -> list[tuple[bytes, int]]:
        return list(self._goals.items())

    def result(self, goal_id: bytes) -> tuple[int, Fields] | None:
        status = self._goals.get(goal_id, 0)
        done = [100] if status == SUCCEEDED else []
        return None if status == EXECUTING else (status, {"sequence": done})

    def _percent(self) -> int:
        return round(100 * (self._cell.out_s or 0.0) / OUT_S)


class PlayedPalletizing(PlayedStory):
    """The story, for the `names` that the panel uses."""

    def __init__(self, names: Story, seed: int, heals_s: float | None = None) -> None:
        super().__init__(names)
        self.cell = PalletizingCell(seed, heals_s)
        self._out = PalletOut(self.cell)
        self.actions = {name: self._out for name in names.actions}
        self._topics = StoryTopics(self.cell, ROWS)
        self._services: Mapping[str, Callable[[Any], str]] = {
            "/cell/start": lambda _: self.cell.start(),
            "/cell/pause": lambda _: self.cell.pause(),
            "/reset": lambda _: self.cell.reset(),
            "/light": self._switch_light,
            "/cell/guard_door": self._move_door,
        }

    def is_latched(self, topic: str) -> bool:
        return self._topics.is_latched(topic)

    def configure(self, nodes: Mapping[str, NodeParameters]) -> None:
        """Its belt has the speed that the parameter of the node sets."""
        if NODE in nodes:
            self.cell.speed_mm_s = nodes[NODE].value("speed", SPEED_MM_S)

    def receive(self, topic: str, message: Any) -> None:
        match topic:
            case "/cell/stop":
                self.cell.stop()
            case "/cell/belt_jog":
                self.cell.jog(message.data)
            case "/cell/recipe":
                *_, order = message.data.split("; ", 4)
                self.cell.load_order(order)

    def serve(self, service: str, request: Any) -> Fields:
        refused = self._services[service](request)
        return {"success": not refused, "message": refused}

    def step(self, moment: Moment) -> Iterator[tuple[str, Fields]]:
        self.cell.step(moment.t)
        self._out.step()
        for level, text in self.cell.notes():
            if LOG in self.names.publishes:
                yield LOG, log_fields(level, text, moment, "cell")
        for topic in sorted(self.names.publishes, key=lambda topic: topic == STATE):  # it is the last
            if (fields := self._topics.due(topic, moment)) is not None:
                yield topic, fields

    def _switch_light(self, request: Any) -> str:
        self.cell.switch_light(on=request.data)
        return ""

    def _move_door(self, request: Any) -> str:
        self.cell.move_door(opened=request.data)
        return ""
