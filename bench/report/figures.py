"""Statistics of measurements. Pure."""

import math
import statistics
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

LINEAR_AT_MOST: Final = 1.25  # times what a unit costs at the beginning


def percentile(values: Sequence[float], percent: float) -> float:
    """The percentile, interpolated linearly as in numpy; NaN without values."""
    if not values:
        return math.nan
    ordered = sorted(values)
    place = (len(ordered) - 1) * percent / 100
    low = math.floor(place)
    high = min(low + 1, len(ordered) - 1)
    return ordered[low] + (ordered[high] - ordered[low]) * (place - low)


def median(values: Sequence[float]) -> float:
    """The median; NaN without values."""
    return statistics.median(values) if values else math.nan


@dataclass(frozen=True)
class Matched:
    """The latencies of matched events in ms, and the number of lost events."""

    ms: tuple[float, ...]
    lost: int


def toggles_matched(
    said: Sequence[tuple[float, bool]], shown: Sequence[tuple[float, bool]], slack_ms: float = 0.5
) -> Matched:
    """Matches each change by the robot to its display; times in ms, in order.

    A change is lost if the next display came only after the same value had been published again.
    `slack_ms` is the tolerance between the clocks.
    """
    left = deque(shown)
    delays: list[float] = []
    for turn, (at, value) in enumerate(said):
        while left and left[0][0] < at - slack_ms:  # of a change that counts as lost
            left.popleft()
        missing = len(said) - turn - len(left)
        again = said[turn + 2][0] if turn + 2 < len(said) else math.inf
        if not left or (missing > 0 and left[0][0] >= again - slack_ms) or left[0][1] != value:
            continue
        delays.append(left.popleft()[0] - at)
    return Matched(tuple(delays), len(said) - len(delays))


def presses_matched(
    released: Mapping[str, float], heard: Sequence[tuple[float, str]]
) -> tuple[Matched, int]:
    """Matches each press to its arrival at the robot (ms); also returns the number of duplicates."""
    first: dict[str, float] = {}
    for at, text in heard:
        first.setdefault(text, at)
    ms = tuple(first[text] - at for text, at in released.items() if text in first)
    ours = [text for _, text in heard if text in released]
    return Matched(ms, len(released) - len(ms)), len(ours) - len(set(ours))


def shown_after(
    shown: Sequence[tuple[float, float]], went_on_ns: float, old_s: float
) -> tuple[float, int]:
    """For values that a page showed after a stall, given as (shown, put) in ns: the age of the first
    one at the end of the stall (ms), and the number of values older than `old_s` at that time."""
    ages = [went_on_ns - put for at, put in shown if at >= went_on_ns]
    return (ages[0] / 1e6 if ages else math.nan), sum(age > old_s * 1e9 for age in ages)


@dataclass(frozen=True)
class Slope:
    """The growth of a cost: per unit in total, in the first and in the second half of the range."""

    per_unit: float
    first: float
    second: float
    linear: bool


def slope(points: Sequence[tuple[float, float]], noise: float) -> Slope:
    """The slope of a cost. `noise` is the difference of two measurements of the same cost; less is no
    growth.

    Linear or better means: the second half of the range costs per unit at most a quarter more than the
    first, or the difference is within the noise.
    """
    xs, ys = zip(*sorted(points), strict=True)
    whole = statistics.linear_regression(xs, ys).slope
    (x0, y0), (x1, y1) = (xs[0], ys[0]), (xs[-1], ys[-1])
    middle = min(range(1, len(xs) - 1), key=lambda i: abs(xs[i] - (x0 + x1) / 2))
    first = (ys[middle] - y0) / (xs[middle] - x0)
    second = (y1 - ys[middle]) / (x1 - xs[middle])
    allowed = max(first, 0.0) * LINEAR_AT_MOST + noise / (x1 - xs[middle])
    return Slope(whole, first, second, second <= allowed)


def ratio(ours: float, theirs: float) -> float:
    """The ratio; NaN if `theirs` is 0 or NaN."""
    return ours / theirs if theirs and not math.isnan(theirs) else math.nan
