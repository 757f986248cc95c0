"""What surrounds the arm and changes without a command: compressed air, the motor's temperature, a door
that someone opens. Pure, with a seeded generator of random numbers."""

import math
from random import Random
from typing import Final

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
