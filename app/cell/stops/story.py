"""The story of a stop: what changed in the minute before it, and what was first. Pure functions over
events, which come from the operator's log, the alarms' history and the journal of changes
(`app/cell/stops/sources.py`).

The rule for the first cause is documented in docs/how-to/stops.md; where it does not decide, the story
says so.
"""

import math
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
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
USUAL: Final = 1.5  # times as long a phase of the cycle may be that is over
BOUNCE_S: Final = 1.0  # changes to and fro within this time are one
ROUTINE: Final = 3  # a condition that was not met so often before the stop is part of the cycle
SAME_STAMP_S: Final = 0.001  # two stamps of one clock that differ by less are not ordered
SAME_ARRIVAL_S: Final = 0.05  # nor are two arrivals
APART_S: Final = 1.0  # nor what two clocks have stamped: how far they are apart is only estimated
LATE_ALARM_S: Final = 0.25  # by so much an alarm may be raised later than its message arrived

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
    the time that a peer of the robot put on it, on the panel's clock, None where that is not known;
    `clock` says which peer. `began_s` is how long before `at` it began: the delay of an alarm.

    `id` is that of the interlock, condition, alarm or control, or the name of a topic or node.
    `breaks`: it may stop the machine; `heals`: that is over. `sources` are the values that it is about.
    `follows` is the id of the alarm of its group that was first, "" for none. `by` is who acted. A
    state heals if it ends a stop, or production goes on."""

    at: float
    sort: Sort
    id: str
    text: TextLike
    detail: TextLike = ""
    before: TextLike = ""
    after: TextLike = ""
    sent: float | None = None
    clock: str = ""
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
    clock: str = ""
    sources: frozenset[Source] = frozenset()
    end: float | None = None

    @property
    def key(self) -> str:
        """Its name in addresses."""
        return f"{self.sort}-{self.number}"

    @property
    def begun(self) -> float:
        return self.at if self.sent is None else self.sent


Why = Literal["none_named", "same_moment", "cycle", "restarted", "cut", "too_many"]


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
    `is_complete`: all that changed is in `lines`; else those nearest the stop are. `effects` are ids
    of what only follows from a stop."""

    stop: Stop
    lines: tuple[Line, ...]
    first: Event | None
    why: Why | None
    tied: tuple[Event, ...] = ()
    by_stamps: bool = False
    is_complete: bool = True
    effects: frozenset[str] = frozenset()

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
        is_told_apart = self.by_stamps or (later and later.begun - self.first.begun >= SAME_ARRIVAL_S)
        if later is None or not is_told_apart:
            return say("story_by", time=time, stop=stop, cause=self.first.text)
        span = self.span_text(later.begun - self.first.begun)
        return say(
            "story_by_before", time=time, stop=stop, cause=self.first.text, span=span, next=later.text
        )

    @property
    def following(self) -> Event | None:
        """What followed from the first cause, beside what follows from each stop; None where nothing is
        known to."""
        first = self.first
        if first is None:
            return None
        known = {first.id, *self.effects}
        later = (line.event for line in self.lines if line.event.breaks and line.event.id not in known)
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
    "cycle": "story_untold_cycle",
    "restarted": "story_untold_restarted",
    "cut": "story_untold_cut",
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
    known = list(_as_their_values(events))
    by_stamps = (stop.sent is not None or stop.sort != "state") and all(
        event.sent is not None
        for event in _possible(
            stop, known, _Values(sorted(known, key=lambda each: each.begun)), effects
        )
    )
    if not by_stamps:
        stop = stop._replace(sent=None)
        known = [event._replace(sent=None) for event in known]
    begun = stop.begun
    within = [e for e in known if begun - BEFORE_S <= e.begun <= begun + AFTER_S]
    ordered = sorted(within, key=lambda event: event.begun)
    values = _Values(ordered)
    chain = causes(stop, ordered, values, effects)
    tied = _first_together(chain)
    first = _named_best(tied) if tied else None
    why: Why | None = None
    if not are_complete:
        first, tied, why = None, (), "too_many"
    elif cut := _cut_before(stop, ordered):
        first, tied, why = None, (), cut
    elif not tied:
        why = "none_named"
    elif unusual := tuple(event for event in tied if _is_routine(event, values)):
        first, tied, why = None, unusual, "cycle"
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
        by_stamps and bool(chain),
        are_complete and len(ordered) <= MOST_EVENTS,
        frozenset(effects),
    )


def _as_their_values(events: Iterable[Event]) -> Iterator[Event]:
    """The events, of which alarms have the times of the interlock or condition that changed by the same
    message: alarms have no stamps, and are raised some time after its arrival."""
    every = list(events)
    changes: defaultdict[Source, list[Event]] = defaultdict(list)
    for event in every:
        if event.sort in CYCLIC and event.breaks:
            for source in event.sources:
                changes[source].append(event)
    for event in every:
        change = _change_of(event, changes) if event.sort == "alarm" and event.breaks else None
        if change is None:
            yield event
        else:
            yield event._replace(at=change.at, sent=change.sent, clock=change.clock, began_s=0.0)


def _change_of(alarm: Event, changes: Mapping[Source, Sequence[Event]]) -> Event | None:
    """The change of an interlock or condition by the message that raised an alarm."""
    of_sources = (change for source in alarm.sources for change in changes.get(source, ()))
    begun = alarm.at - alarm.began_s
    return next((c for c in of_sources if -SAME_ARRIVAL_S <= begun - c.at <= LATE_ALARM_S), None)


def _cut_before(stop: Stop, ordered: Sequence[Event]) -> Why | None:
    """Why nothing is known of the time right before a stop: the server was started, or the link was
    cut, and what changed in that time arrived at its end."""
    near = [event for event in ordered if stop.begun - GAP_S <= event.begun <= stop.begun]
    if any(event.sort == "server" for event in near):
        return "restarted"
    is_cut = stop.sort != "link" and any(event.sort == "link" and event.heals for event in near)
    return "cut" if is_cut else None


Phase = tuple[float, float]


class _Values:
    """The events by their sort and id; states together, as one ends another."""

    def __init__(self, ordered: Iterable[Event]) -> None:
        self._events: defaultdict[tuple[Sort, str], list[Event]] = defaultdict(list)
        self._heals: defaultdict[tuple[Sort, str], list[float]] = defaultdict(list)
        self._phases: dict[tuple[Sort, str], list[Phase]] = {}
        for event in ordered:
            name = (event.sort, "" if event.sort == "state" else event.id)
            self._events[name].append(event)
            if event.heals:
                self._heals[name].append(event.begun)

    def is_well_between(self, sort: Sort, name: str, since: float, until: float) -> bool:
        """Whether it was well again between two times."""
        heals = self._heals.get((sort, name), [])
        number = bisect_right(heals, since)
        return number < len(heals) and heals[number] < until

    def phases(self, event: Event) -> list[Phase]:
        """From when to when its condition was not met, up to the phase of this event; infinity for one
        that has not ended. What is shorter apart than a contact bounces is one."""
        name = event.sort, event.id
        if name not in self._phases:
            self._phases[name] = list(_phases(self._events[name]))
        phases = self._phases[name]
        return phases[: bisect_right(phases, (event.begun, math.inf))]


def _phases(ordered: Iterable[Event]) -> Iterator[Phase]:
    begun, end = -math.inf, -math.inf
    for event in ordered:
        if event.breaks and event.begun - begun > BOUNCE_S:
            if begun > -math.inf:
                yield begun, end
            begun, end = event.begun, math.inf
        elif event.breaks:
            end = math.inf
        elif event.heals and end == math.inf:
            end = event.begun
    if begun > -math.inf:
        yield begun, end


def _possible(
    stop: Stop, events: Iterable[Event], values: _Values, effects: Collection[str]
) -> list[Event]:
    """The events that may have caused a stop: what breaks, and still stands at the stop."""
    return [
        event
        for event in events
        if event.breaks
        and event.id not in effects
        and not event.follows
        and not _is_stop_itself(event, stop)
        and event.begun <= stop.begun + _resolution(event, stop)
        and not _is_over(event, values, stop)
    ]


def causes(
    stop: Stop, ordered: Sequence[Event], values: _Values, effects: Collection[str]
) -> tuple[Event, ...]:
    """The events that may have caused a stop, from the first on: what the panel names and what broke,
    still stands at the stop, and is not separated from it by a longer time."""
    possible = _possible(stop, ordered, values, effects)
    chain: list[Event] = []
    upper = stop.begun
    for event in reversed(possible):
        later = next((other.begun for other in reversed(chain) if other.id != event.id), stop.begun)
        if _is_routine(event, values) and _is_usual(event, values, later):
            continue
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


def _is_over(event: Event, values: _Values, stop: Stop) -> bool:
    """Whether it was well again some time before the stop; or was a press, after which the machine went
    on."""
    if event.sort == "press":
        return values.is_well_between("state", "", event.begun, stop.begun)
    return values.is_well_between(event.sort, event.id, event.begun, stop.begun - RETURNED_S)


# What comes in each cycle.


def _is_routine(event: Event, values: _Values) -> bool:
    """Whether a condition was not met again and again before the stop."""
    return event.sort in CYCLIC and len(values.phases(event)) >= ROUTINE


def _is_usual(event: Event, values: _Values, until: float) -> bool:
    """Whether a condition that comes in each cycle was not met for as long as usual, until another
    cause or the stop. If it was for longer, it may be the cause; what was met again in the meantime may
    have been for a little longer, as no two cycles are equal."""
    *earlier, (begun, end) = values.phases(event)
    longest = max((end - begun for begun, end in earlier if end < math.inf), default=0.0)
    return min(end, until) - begun <= (longest if end > until else USUAL * longest)


def _first_together(chain: Sequence[Event]) -> tuple[Event, ...]:
    """The first of them, with those that can't be told from it by their times."""
    if not chain:
        return ()
    first = chain[0]
    return tuple(
        event
        for event in chain
        if event.begun - first.begun < _resolution(first, event) or _is_same(event, first)
    )


def _is_same(event: Event, first: Event) -> bool:
    """Whether two events tell of one change: an alarm and an interlock of one value."""
    return bool(event.sources & first.sources) and event.sort != first.sort


def _resolution(first: Event, later: Event | Stop) -> float:
    """By how much the second must be later to be told from the first."""
    if first.clock != later.clock and first.clock and later.clock:
        return APART_S
    if first.sent is not None and later.sent is not None:
        return SAME_STAMP_S
    if first.sort != "alarm" and later.sort == "alarm":
        return LATE_ALARM_S
    return SAME_ARRIVAL_S


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
