"""What is asked of the rows of `bench/light.py`."""

from collections.abc import Mapping
from typing import Any, Final

# What is asked: of the floor, or in the unit of the row.
ASKED: Final[Mapping[str, float]] = {
    "start, three widgets": 1.8,
    "start, shipped panel": 1.8,
    "a press": 3.5,
    "1 kHz on a shown topic": 2.1,
    "100 Hz on a shown topic": 2.5,
    "200 topics at 20 Hz, unseen": 1.3,
    "memory at rest, three widgets": 65,
    "idle, shipped panel": 2,
    "idle, 50 robots": 4,
    "kiosk, to the waiting page": 0.3,
    "kiosk, to a live button": 2,
}
ABSOLUTE: Final = ("MiB", "%", "s by the clock")  # units in which is asked; else a ratio to the floor


def asked(row: Mapping[str, Any]) -> str:
    """What is asked of a row, with its unit, and whether it was reached."""
    unit = row["unit"] if row["unit"] in ABSOLUTE else "×"
    return f"{row['asked']:g} {unit}" + ("" if row["reached"] else ": missed")
