"""The story of a stop: what changed in the minute before it, and what was first. Pure functions over
events, which come from the operator's log, the alarms' history and the journal of changes
(`app/cell/stops/sources.py`).

The rule for the first cause is documented in docs/how-to/stops.md; where it does not decide, the story
says so.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal, NamedTuple

from app.cell.view.times import span_text
from app.system.clock import format_time
from app.system.texts import TextLike, number, say

BEFORE_S: Final = 60.0  # of a stop that its story has
AFTER_S: Final = 5.0
MOST_EVENTS: Final = 10_000  # that a story is made from; the newest before the stop
SHORT_EVENTS: Final = 10  # that the page shows first

GAP_S: Final = 10.0  # a longer time without a cause separates what happened before from the stop
RETURNED_S: Final = 2.0  # what was well again so long before the stop is no cause
BOUNCE_S: Final = 1.0  # changes to and fro within this time are one
ROUTINE: Final = 3  # a condition that was not met so often before the stop is part of the cycle
SAME_STAMP_S: Final = 0.001  # two stamps of one clock that differ by less are not ordered
SAME_ARRIVAL_S: Final = 0.05  # nor are two arrivals

Sort = Literal[
    "state", "interlock", "condition", "alarm", "link", "node", "publisher", "clock",
    "press", "refused", "goal", "control", "recipe", "server",
]  # fmt: skip
StopSort = Literal["state", "alarm", "goal", "link"]
Source = tuple[str, str]  # a topic and its field
# Of several events about one value the first of these names it best.
NAMED_BEST: Final[Sequence[Sort]] = ("alarm", "link", "node", "publisher", "interlock", "condition")
# What an operator or the robot does in each cycle: no cause where it comes again and again.
CYCLIC: Final[Collection[Sort]] = frozenset({"condition", "interlock"})


class Event(NamedTuple):
    """Something that changed. `at` is when the panel received it, in seconds since the epoch; `sent`
    the time that the robot's peer put on it, on the panel's clock, None where that is not known.
    `began_s` is how long before `at` it began: the delay of an alarm.

    `id` is that of the interlock, condition, alarm or control, or the name of a topic or node.
    `breaks`: it may stop the machine; `heals`: that is over. `sources` are the values that it is about.
    `follows` is the id of the alarm of its group that was first, "" for none. `by` is who acted."""

    at: float
    sort: Sort
    id: str
    text: TextLike
    detail: TextLike = ""
    before: TextLike = ""
    after: TextLike = ""
    sent: float | None = None
    began_s: float = 0.0
    breaks: bool = False
    heals: bool = False
    sources: frozenset[Source] = frozenset()
    follows: str = ""
    priority: int = 0
    by: str = ""

    @property
    def begun(self) -> float:
        """When it happened: by the robot's stamp where there is one."""
        return (self.at if self.sent is None else self.sent) - self.began_s


class Stop(NamedTuple):
    """A stop of a robot ("" for the only one), with its number in the store of its `sort`. `text` is
    the state, the alarm, the goal's control or the link. `end` is when it was over, None where it is
    not known to be."""

    at: float
    robot: str
    sort: StopSort
    number: int
    id: str
    text: TextLike
    sent: float | None = None
    sources: frozenset[Source] = frozenset()
    end: float | None = None

    @property
    def key(self) -> str:
        """Its name in addresses."""
        return f"{self.sort}-{self.number}"

    @property
    def begun(self) -> float:
        return self.at if self.sent is None else self.sent


Why = Literal["none_named", "same_moment", "restarted", "too_many"]


@dataclass(frozen=True, slots=True)
class Line:
    """An event of a story, `offset_s` after its zero: the first cause, or else the stop."""

    event: Event
    offset_s: float
    is_first: bool = False
    is_before: bool = False


@dataclass(frozen=True, slots=True)
class Story:
    """`first` is the first cause; None where it can't be told, and `why` says why. `tied` are then
    those that were first together. `by_stamps`: all that was compared has stamps of the robot.
    `is_complete`: all that changed is in `lines`; else those nearest the stop are."""

    stop: Stop
    lines: tuple[Line, ...]
    first: Event | None
    why: Why | None
    tied: tuple[Event, ...] = ()
    by_stamps: bool = False
    is_complete: bool = True

    @property
    def zero(self) -> float:
        """The time from which its lines are counted, in seconds since the epoch."""
        return self.first.begun if self.first else self.stop.begun

    @property
    def sentence(self) -> TextLike:
        """What happened, in a sentence."""
        time, stop = format_time(self.stop.at), self.stop.text
        if self.first is None:
            tied = tuple(event.text for event in self.tied)
            return say(UNTOLD[self.why or "none_named"], time=time, stop=stop, causes=tied)
        later = self.following
        if later is None:
            return say("story_by", time=time, stop=stop, cause=self.first.text)
        span = self.span_text(later.begun - self.first.begun)
        return say(
            "story_by_before", time=time, stop=stop, cause=self.first.text, span=span, next=later.text
        )

    @property
    def following(self) -> Event | None:
        """What followed from the first cause; None where nothing is known to."""
        first = self.first
        if first is None:
            return None
        later = (line.event for line in self.lines if line.event.breaks and line.event.id != first.id)
        return next((event for event in later if event.begun > first.begun), None)

    def span_text(self, seconds: float) -> TextLike:
        """A short time with no more digits than the clocks agree on."""
        if self.by_stamps and seconds < 1.0:
            return number(f"{max(1, round(seconds * 1000))}", "ms")
        return number(f"{seconds:.1f}", "s") if seconds < 10.0 else span_text(seconds)

    def short(self, most: int = SHORT_EVENTS) -> tuple[Line, ...]:
        """The lines that tell most, in their order: what breaks and the stop, then what people did, the
        nearest to the zero first."""

        def rank(line: Line) -> tuple[bool, bool, float]:
            event = line.event
            matters = event.breaks or event.sort in ("state", "goal", "press", "refused")
            return not line.is_first, not matters, abs(line.offset_s)

        chosen = sorted(self.lines, key=rank)[:most]
        return tuple(line for line in self.lines if line in chosen)


UNTOLD: Final[dict[Why, str]] = {
    "none_named": "story_untold",
    "same_moment": "story_untold_together",
    "restarted": "story_untold_restarted",
    "too_many": "story_untold_too_many",
}


def story_of(
    stop: Stop,
    events: Iterable[Event],
    effects: Collection[str] = (),
    *,
    are_complete: bool = True,
) -> Story:
    """The story of a stop, from what changed around it. `effects` are ids of what only follows from a
    stop, as the panel file says. If the events are not complete, what was first can't be told."""
    begun = stop.begun
    within = [e for e in events if begun - BEFORE_S <= e.begun <= begun + AFTER_S]
    ordered = sorted(within, key=lambda event: event.begun)
    chain = causes(stop, ordered, effects)
    tied = _first_together(chain)
    first = _named_best(tied) if tied else None
    why: Why | None = None
    if not are_complete:
        first, tied, why = None, (), "too_many"
    elif any(e.sort == "server" and begun - GAP_S <= e.begun <= begun for e in ordered):
        first, tied, why = None, (), "restarted"
    elif not tied:
        why = "none_named"
    elif first is None:
        why = "same_moment"
    zero = first.begun if first else begun
    nearest = sorted(ordered, key=lambda event: abs(event.begun - begun))[:MOST_EVENTS]
    return Story(
        stop,
        tuple(
            Line(event, event.begun - zero, event is first, event.begun < zero)
            for event in sorted(nearest, key=lambda event: event.begun)
        ),
        first,
        why,
        () if first else tied,
        bool(chain) and all(event.sent is not None for event in chain),
        are_complete and len(ordered) <= MOST_EVENTS,
    )


def causes(stop: Stop, ordered: Sequence[Event], effects: Collection[str]) -> tuple[Event, ...]:
    """The events that may have caused a stop, from the first on: what the panel names and what broke,
    still stands at the stop, and is not separated from it by a longer time."""
    possible = [
        event
        for event in ordered
        if event.breaks
        and event.id not in effects
        and not event.follows
        and not _is_stop_itself(event, stop)
        and event.begun <= stop.begun + _resolution(event.sent is not None and stop.sent is not None)
        and not _is_over(event, ordered, stop)
    ]
    routine = _routine(ordered, stop)
    chain: list[Event] = []
    upper = stop.begun
    for event in reversed([event for event in possible if (event.sort, event.id) not in routine]):
        if upper - event.begun > GAP_S:
            break
        chain.append(event)
        upper = min(upper, event.begun)
    return tuple(reversed(chain))


def _is_stop_itself(event: Event, stop: Stop) -> bool:
    """Whether an event is the stop, or is read from the same value as the stop's state. An alarm and a
    lost link are their own cause where nothing else was before."""
    if stop.sort == "state":
        is_of_value = event.sort in ("alarm", "interlock", "condition")
        return event.sort == "state" or (is_of_value and bool(event.sources & stop.sources))
    return event.sort in ("state", "goal")


def _is_over(event: Event, ordered: Sequence[Event], stop: Stop) -> bool:
    """Whether it was well again some time before the stop."""
    return any(
        other.heals and (other.sort, other.id) == (event.sort, event.id)
        for other in ordered
        if event.begun < other.begun < stop.begun - RETURNED_S
    )


def _routine(ordered: Sequence[Event], stop: Stop) -> frozenset[tuple[Sort, str]]:
    """What was not met again and again before the stop."""
    times: defaultdict[tuple[Sort, str], list[float]] = defaultdict(list)
    for event in ordered:
        if event.breaks and event.sort in CYCLIC and event.begun <= stop.begun:
            times[event.sort, event.id].append(event.begun)

    def often(begun: Sequence[float]) -> int:
        return 1 + sum(later - earlier > BOUNCE_S for earlier, later in pairwise(begun))

    return frozenset(name for name, begun in times.items() if often(begun) >= ROUTINE)


def _first_together(chain: Sequence[Event]) -> tuple[Event, ...]:
    """The first of them, with those that can't be told from it by their times."""
    if not chain:
        return ()
    first = chain[0]
    return tuple(
        event
        for event in chain
        if event.begun - first.begun < _resolution(event.sent is not None and first.sent is not None)
        or _is_same(event, first)
    )


def _is_same(event: Event, first: Event) -> bool:
    """Whether two events tell of one change: an alarm and an interlock of one value."""
    return bool(event.sources & first.sources) and event.sort != first.sort


def _resolution(is_stamped: bool) -> float:
    return SAME_STAMP_S if is_stamped else SAME_ARRIVAL_S


def _named_best(tied: Sequence[Event]) -> Event | None:
    """The event that names the change best, if all of them tell of one; else None."""
    linked, open_events = [tied[0]], list(tied[1:])
    while known := [event for event in open_events if any(event.sources & e.sources for e in linked)]:
        linked += known
        open_events = [event for event in open_events if event not in known]
    if open_events:
        return None
    return min(linked, key=lambda event: _rank(event.sort))


def _rank(sort: Sort) -> int:
    return NAMED_BEST.index(sort) if sort in NAMED_BEST else len(NAMED_BEST)
