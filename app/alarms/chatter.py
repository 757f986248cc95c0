"""Alarms that chatter, and the delay that would calm them. Pure functions.

An alarm chatters if it is raised three times in a minute.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from app.alarms.delays import DelayedCondition, Delays

CHATTER_RAISES: Final = 3
CHATTER_S: Final = 60.0
STEP_S: Final = 0.1  # of a delay below `WHOLE_FROM_S`, else 1 s
WHOLE_FROM_S: Final = 2.0
NO_DELAYS: Final = Delays()


class Activation(NamedTuple):
    """From when to when an alarm was active, in seconds; inf if it did not return before it was raised
    again, or at all."""

    raised: float
    returned: float = math.inf


class Suggestion(NamedTuple):
    """With a delay of so many seconds the burst would have been `raises`."""

    delay_s: float
    raises: int


class Burst(NamedTuple):
    """Raises of one alarm of which each is within a minute of others: from `first` on, `span_s` long.
    `on_delay` and `off_delay` are the least that leave one raise or none; None where no delay does."""

    first: float
    span_s: float
    raises: int
    on_delay: Suggestion | None
    off_delay: Suggestion | None


def activations(events: Iterable[tuple[float, str]]) -> list[Activation]:
    """From times and events of one alarm, in their order: `raised` and `returned`."""
    intervals: list[Activation] = []
    for at, event in events:
        if event == "raised":
            intervals.append(Activation(at))
        elif event == "returned" and intervals and intervals[-1].returned == math.inf:
            intervals[-1] = Activation(intervals[-1].raised, at)
    return intervals


def worst_burst(active: Sequence[Activation], delays: Delays = NO_DELAYS) -> Burst | None:
    """The burst with the most raises; None if the alarm does not chatter. `delays` are those that it
    has now."""
    bursts = list(_bursts(active))
    if not bursts:
        return None
    worst = max(bursts, key=len)
    heard = _heard(worst, delays)
    return Burst(
        worst[0].raised,
        worst[-1].raised - worst[0].raised,
        len(worst),
        _least(heard, delays, [end - begin for begin, end in heard], "on_s"),
        _least(heard, delays, [after - end for (_, end), (after, _) in pairwise(heard)], "off_s"),
    )


def _bursts(active: Sequence[Activation]) -> Iterable[Sequence[Activation]]:
    """The longest sequences in which each raise is one of three in a minute."""
    begin, end = 0, -1
    for last in range(CHATTER_RAISES - 1, len(active)):
        first = last - CHATTER_RAISES + 1
        if not 0 <= active[last].raised - active[first].raised <= CHATTER_S:
            continue
        if first > end:
            yield from [active[begin : end + 1]] if end >= 0 else []
            begin = first
        end = last
    yield from [active[begin : end + 1]] if end >= 0 else []


def _heard(active: Iterable[Activation], delays: Delays) -> list[Activation]:
    """When the condition was met, before the delays that the alarm has."""
    return [
        Activation(raised - delays.on_s, max(raised, returned - delays.off_s))
        for raised, returned in active
    ]


def _least(
    heard: Sequence[Activation], delays: Delays, lengths: Iterable[float], name: str
) -> Suggestion | None:
    """The least delay, just above one of the lengths, that leaves one raise or none. None if the alarm
    was raised again without a return, as its level rose."""
    if any(end == math.inf for _, end in heard[:-1]):
        return None
    for length in sorted({length for length in lengths if math.isfinite(length)}):
        delay_s = _above(length)
        raises = count_raises(heard, delays._replace(**{name: delay_s}))
        if raises <= 1 and delay_s > getattr(delays, name):
            return Suggestion(delay_s, raises)
    return None


def _above(length: float) -> float:
    step = STEP_S if length < WHOLE_FROM_S else 1.0
    return round((math.floor(length / step) + 1) * step, 1)


def count_raises(heard: Iterable[Activation], delays: Delays) -> int:
    """How often a condition that was met at these times is raised with some delays."""
    condition, raises = DelayedCondition(), 0
    for begin, end in heard:
        for at, met in ((begin, True), (end, False)):
            waited = condition.at(at, delays)
            changed = waited.heard(met, at, delays) if at < math.inf else waited
            raises += (waited.active > condition.active) + (changed.active > waited.active)
            condition = changed
    return raises
