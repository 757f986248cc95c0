"""The palletizing cell as a state machine: pure, stepped with time.

A command returns "" if it is done, else why the cell refuses it, in words. A fault is latched: it ends
when the guard door is closed and the cell is reset. Start then goes on with the box at which the arm
stopped. Nothing moves while the guard door is open.
"""

from collections import deque
from random import Random
from typing import Final

from app.simulator.palletizing import cycle
from app.simulator.palletizing.states import (
    AIR_IS_LOW,
    DOOR_OPEN,
    GOES_OUT,
    HELD_ON,
    NO_FAULT,
    NOT_FULL,
    REFUSED,
    Reason,
    State,
)
from app.simulator.palletizing.surroundings import AirSupply, GuardDoor, Motor

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
FIRST_RATE: Final = 1148  # boxes in the hour before
SPEED_MM_S: Final = 120.0


# Levels of rcl_interfaces/msg/Log.
INFO, WARN, ERROR = 20, 30, 40


class PalletizingCell:
    """The cell. `notes` has what it says since the last call, as (level, text) of a ROS log."""

    def __init__(self, seed: int = 0) -> None:
        self._random = Random(seed)
        self.air = AirSupply(Random(self._random.random()))
        self.door = GuardDoor(Random(self._random.random()))
        self.motor = Motor()
        self.t = 0.0
        self.state, self.reason = State.RUNNING, Reason.NONE
        self.boxes, self.pallet = FIRST_BOXES, FIRST_PALLET
        self.part = 0.0  # of the cycle
        self.cycle_s = self.last_cycle_s = cycle.CYCLE_S
        self.pauses = False  # after this box
        self.out_s: float | None = None  # since when a pallet goes out
        self.light = False
        self.order, self.next_order = "4711", "4711"
        self.speed_mm_s = SPEED_MM_S
        self._light_at, self._light_wanted = 0.0, False
        self._jog, self._jog_until, self._before_jog = 0.0, 0.0, State.STOPPED
        self._jog_barred = False  # by a stop, until the button is released
        spacing = HOUR_S / FIRST_RATE
        self._placed = deque(-HOUR_S + spacing * (number + 1) for number in range(FIRST_RATE))
        self._notes = [(INFO, f"runs, box {self.boxes + 1} is next")]

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
        return cycle.holds_box(self.part)

    @property
    def belt_mm_s(self) -> float:
        """The speed of the belt: negative towards the infeed."""
        if self.state is State.MANUAL:
            return self._jog * self.speed_mm_s
        return self.speed_mm_s if self.arm_moves and cycle.belt_feeds(self.part) else 0.0

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
    def left_s(self) -> float:
        """Seconds until the pallet is full, at the speed of the last cycle."""
        return (BOXES - self.boxes) * self.last_cycle_s

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
        if before < cycle.PLACED <= self.part:
            self.boxes += 1
            self._placed.append(self.t)
            self._note(f"box {self.boxes} placed")
        if self.part >= 1:
            self._end_cycle()

    def _end_cycle(self) -> None:
        self.part, self.last_cycle_s = 0.0, self.cycle_s
        self.cycle_s = cycle.CYCLE_S * (1 + self._random.uniform(-JITTER, JITTER))
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
            self._note(f"waiting: {reason.replace('_', ' ').lower()}", WARN)
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
        self._note("guard door 1 opened", ERROR)

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

    def _note(self, text: str, level: int = INFO) -> None:
        self._notes.append((level, text))
