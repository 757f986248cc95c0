"""What the server may use at its start, for a first page and for messages, counted without clocks.

Each test fails when a figure is more than `GROWTH` above what is written here. Who makes one smaller
writes the new figure; who needs more says why in the commit. Times beside their floors are those of
`python -m bench.light`.
"""

from collections.abc import Mapping
from typing import Final

GROWTH: Final = 1.05

FIGURES: Final[Mapping[str, int]] = {
    # 2026-11-30
    "modules of the server, shipped panel": 322,
    "modules of the server, three widgets": 307,
    "all modules, shipped panel": 926,
    "all modules, three widgets": 911,
    "first page, shipped panel: requests": 12,
    "first page, shipped panel: bytes": 53_700,
    "first page, three widgets: requests": 8,
    "first page, three widgets: bytes": 38_600,
    "wake-ups for 1,000 messages that no one looks at": 0,
    "wake-ups for 1,000 messages in 20 frames": 20,
    "wake-ups for 1,000 permissions, a turn after each": 1000,
    "calls of a published press": 705,
    "calls of a service's press, drawn": 1324,
    "calls of a sign-in": 393,
}
# What a figure must not exceed, however it has grown.
MOST: Final[Mapping[str, int]] = {
    "first page, shipped panel: requests": 12,
    "first page, shipped panel: bytes": 60_000,
    "first page, three widgets: requests": 12,
    "first page, three widgets: bytes": 45_000,
    "calls of a service's press, drawn": 1500,
    "calls of a sign-in": 2500,
}


def check(name: str, measured: int) -> None:
    """AssertionError for a figure that has grown by more than it may."""
    written = FIGURES[name]
    most = min(GROWTH * written, MOST.get(name, GROWTH * written))
    assert measured <= most, f"{name}: {measured}, and {written} is written in tests/budgets.py"
