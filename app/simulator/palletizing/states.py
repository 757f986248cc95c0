"""The states of the palletizing cell, and why it refuses a command, in words."""

from enum import StrEnum
from typing import Final


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
