"""The figures of a shift, with the names of ISO 22400-2: how long the machine was planned to produce
and did, what it made, and for which reasons it stood still. Pure functions; docs/how-to/oee.md has each
formula.

Times are seconds since the epoch, durations seconds. What was not recorded is not known: it is counted
apart, and never guessed.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from typing import Any, Final, Literal, NamedTuple

from app.cell.alarms.report import CountRow, StatePeriod
from app.cell.stops.changes import Change
from app.cell.stops.story import Stop
from app.panel.values import same_value
from app.records.entry import Entry

Activity = Literal["running", "standing", "unknown"]
BandKind = Literal["running", "waiting", "fault", "planned", "unknown"]

COUNT_GAP_S: Final = 150.0  # counters are recorded each minute: what is further apart was not
NOT_ANSWERED: Final = ""  # in place of a reason's id
SHORT: Final = "-"  # stops of which no reason is asked
LONGEST_STOPS: Final = 10
MOST_OPEN: Final = 20  # stops without a reason that are asked together


class Span(NamedTuple):
    since: float
    until: float

    @property
    def seconds(self) -> float:
        return self.until - self.since


class Spell(NamedTuple):
    """From when to when the machine was in a state; `state` is the JSON of its text, shape and
    colour."""

    since: float
    until: float
    activity: Activity
    state: str


class Standstill(NamedTuple):
    """A time in which the machine did not run: the spans that are recorded, and the state in which it
    began. Not `is_over`: it goes on."""

    spans: tuple[Span, ...]
    state: str
    is_over: bool

    @property
    def since(self) -> float:
        return self.spans[0].since

    @property
    def until(self) -> float:
        return self.spans[-1].until


class AnsweredStop(NamedTuple):
    """A standstill with its name in addresses ("" without a record of what changed), and its newest
    answer."""

    standstill: Standstill
    key: str
    answer: "Answer | None"

    @property
    def reason(self) -> str:
        """The id of its reason."""
        return self.answer.reason if self.answer else NOT_ANSWERED


class StopTime(NamedTuple):
    """How long a stop was in a shift, without its breaks. `is_short`: its reason is not asked
    (`is_short_stop`), and none was given."""

    stop: AnsweredStop
    seconds: float
    is_short: bool


class RobotStop(NamedTuple):
    """A stop in a shift, of the robot with this id ("" for the only one)."""

    robot: str
    time: StopTime


class ReasonTime(NamedTuple):
    """A row of the Pareto: `share` is that of it and all rows above it, from 0 to 1."""

    reason: str
    seconds: float
    stops: int
    share: float


class Band(NamedTuple):
    since: float
    until: float
    kind: BandKind


class Plan(NamedTuple):
    """What the figures are computed with: `running` are the values of states that produce, `breaks`
    times of day, `planned` the ids of reasons that are no loss."""

    running: Sequence[Any]
    breaks: Sequence[str] = ()
    reason_after_s: float = 120.0
    ideal_cycle_s: float | None = None
    planned: frozenset[str] = frozenset()


@dataclass(frozen=True, slots=True)
class ShiftFigures:
    """The figures of a shift, up to now. None is what is not known: availability without a time that
    was planned, performance and quality without parts."""

    since: float
    until: float
    running_s: float  # actual production time, APT
    down_s: float  # actual unit down time, ADOT
    planned_s: float  # breaks and planned stops in which it stood still
    unknown_s: float  # without a record of the state
    counted_s: float  # of the actual production time, with a record of the counters
    produced: float | None  # produced quantity, PQ
    good: float | None  # good quantity, GQ
    performance: float | None
    stops: tuple[StopTime, ...]
    reasons: tuple[ReasonTime, ...]
    bands: tuple[Band, ...]

    @property
    def busy_s(self) -> float:
        """The planned busy time, PBT."""
        return self.running_s + self.down_s

    @property
    def availability(self) -> float | None:
        return self.running_s / self.busy_s if self.busy_s else None

    @property
    def quality(self) -> float | None:
        if self.good is None or not self.produced:
            return None
        return self.good / self.produced

    @property
    def oee(self) -> float | None:
        """The overall equipment effectiveness index."""
        parts = (self.availability, self.performance, self.quality)
        if any(part is None for part in parts):
            return None
        availability, performance, quality = (part or 0.0 for part in parts)
        return availability * performance * quality

    @property
    def longest(self) -> tuple[StopTime, ...]:
        return tuple(sorted(self.stops, key=lambda stop: -stop.seconds)[:LONGEST_STOPS])

    @property
    def open(self) -> tuple[StopTime, ...]:
        """The newest stops that are over and have no reason, in their order."""
        without = (
            stop
            for stop in self.stops
            if stop.stop.standstill.is_over
            and stop.stop.key
            and stop.stop.reason == NOT_ANSWERED
            and not stop.is_short
        )
        return tuple(without)[-MOST_OPEN:]


def open_stops(figures: Mapping[str, ShiftFigures]) -> list[RobotStop]:
    """The newest stops of all robots that are over and have no reason, in the order of their begin.
    `figures` are those of a shift by the robot's id."""
    stops = [RobotStop(robot, each) for robot, of_robot in figures.items() for each in of_robot.open]
    stops.sort(key=lambda stop: stop.time.stop.standstill.since)
    return stops[-MOST_OPEN:]


# Spans of time.


def overlaps(span: Span, others: Iterable[Span]) -> Iterator[Span]:
    """The parts of a span that are in others, which do not overlap each other."""
    for other in others:
        since, until = max(span.since, other.since), min(span.until, other.until)
        if since < until:
            yield Span(since, until)


def without(span: Span, others: Sequence[Span]) -> Iterator[Span]:
    """The parts of a span that are not in others, which are in their order."""
    since = span.since
    for other in overlaps(span, others):
        if since < other.since:
            yield Span(since, other.since)
        since = other.until
    if since < span.until:
        yield Span(since, span.until)


def total(spans: Iterable[Span]) -> float:
    return sum(span.seconds for span in spans)


def break_spans(span: Span, breaks: Iterable[str]) -> list[Span]:
    """The breaks in a time, by the server's clock: one that ends before it begins is over midnight."""
    first, last = (datetime.fromtimestamp(at).date() for at in span)
    spans: list[Span] = []
    for number in range(-1, (last - first).days + 1):
        day = first + timedelta(days=number)
        for written in breaks:
            begin, end = written.split("-")
            end_day = day if end > begin else day + timedelta(days=1)
            since = datetime.fromisoformat(f"{day}T{begin}").timestamp()
            spans += overlaps(
                span, [Span(since, datetime.fromisoformat(f"{end_day}T{end}").timestamp())]
            )
    return _merged(spans)


def _merged(spans: Iterable[Span]) -> list[Span]:
    merged: list[Span] = []
    for span in sorted(spans):
        if merged and span.since <= merged[-1].until:
            merged[-1] = Span(merged[-1].since, max(merged[-1].until, span.until))
        else:
            merged.append(span)
    return merged


# States, and the times in which the machine did not run.


def spells(periods: Iterable[StatePeriod], running: Sequence[Any]) -> list[Spell]:
    """The recorded periods; one whose value is not known is of no known activity."""
    return [
        Spell(since, until, _activity(json.loads(state).get("value"), running), state)
        for since, until, state in periods
    ]


def _activity(value: Any, running: Sequence[Any]) -> Activity:
    if value is None:
        return "unknown"
    return "running" if any(same_value(value, each) for each in running) else "standing"


def standstills(recorded: Iterable[Spell]) -> list[Standstill]:
    """The times in which the machine did not run. One that is standing before and after a time without
    a record has stood still once."""
    stops: list[Standstill] = []
    current: Standstill | None = None
    for spell in recorded:
        span = Span(spell.since, spell.until)
        if spell.activity == "standing" and current is None:
            current = Standstill((span,), spell.state, False)
        elif spell.activity == "standing" and current is not None:
            current = current._replace(spans=(*current.spans, span))
        elif spell.activity == "running" and current is not None:
            stops.append(current._replace(is_over=True))
            current = None
    return stops if current is None else [*stops, current]


# Counters.


COUNTERS: Final = {"good": "good", "bad": "bad", "all": "count"}  # `parts` → the column of a row


class Counted(NamedTuple):
    """By how much a counter has risen, and the spans in which that is recorded."""

    parts: float
    spans: list[Span]


def counted(rows: Sequence[CountRow], name: str, span: Span) -> Counted | None:
    """What a counter of some parts has counted in a time; None without a record. A number that is lower
    than the one before began at zero again. A rise belongs to the time of the row that has it. A row
    without any number is the beginning of a record: nothing is known of what was before it."""
    parts, spans = 0.0, []
    before: tuple[float, float] | None = None
    for row in rows:
        value = getattr(row, COUNTERS[name])
        if row.good is row.bad is row.count is None:
            before = None
        if value is None:
            continue
        if before is not None and span.since < row.at <= span.until:
            before_at, last = before
            if 0 < row.at - before_at <= COUNT_GAP_S:
                parts += value - last if value >= last else value
                spans.append(Span(max(before_at, span.since), row.at))
        before = (row.at, value)
    return Counted(parts, _merged(spans)) if spans else None


class Quantities(NamedTuple):
    """The produced and the good quantity, None for not known, and the spans in which all that is
    counted was recorded. `parts` are those for which performance is given: the good ones where nothing
    else is counted."""

    produced: float | None
    good: float | None
    parts: float | None
    spans: list[Span]


def quantities(rows: Sequence[CountRow], names: Iterable[str], span: Span) -> Quantities:
    """From the counters of these parts that the panel has: "all" is "good" and "bad" together where it
    is missing, "good" is "all" less "bad"."""
    known = {name: counted(rows, name, span) for name in names}
    parts = {name: each.parts for name, each in known.items() if each is not None}
    spans: list[Span] | None = None
    for each in known.values():
        own = each.spans if each else []
        spans = own if spans is None else [part for s in spans for part in overlaps(s, own)]
    produced, good = parts.get("all"), parts.get("good")
    if produced is None and {"good", "bad"} <= parts.keys():
        produced = parts["good"] + parts["bad"]
    if good is None and produced is not None and "bad" in parts:
        good = max(0.0, produced - parts["bad"])
    only_good = good if known.keys() == {"good"} else None
    return Quantities(produced, good, only_good if produced is None else produced, spans or [])


# The figures.


def shift_figures(
    span: Span,
    recorded: Sequence[Spell],
    stops: Sequence[AnsweredStop],
    quantity: Quantities,
    plan: Plan,
) -> ShiftFigures:
    """The figures of a shift. `recorded` are the spells around it, `stops` the standstills of these.

    A break counts as planned only while the machine does not run in it. Performance is that of the
    actual production time in which the counters were recorded.
    """
    breaks = break_spans(span, plan.breaks)
    running = list(_clipped(recorded, "running", span))
    times = [_stop_time(stop, span, breaks, plan) for stop in stops]
    lost = tuple(t for t in times if t.seconds > 0 and t.stop.reason not in plan.planned)
    down_s = sum(stop.seconds for stop in lost)
    standing = list(_clipped(recorded, "standing", span))
    known = _merged([*running, *standing])
    unknown = [part for gap in without(span, known) for part in without(gap, breaks)]
    running_s = total(running)
    counted_s = sum(total(overlaps(each, quantity.spans)) for each in running)
    performance = None
    if plan.ideal_cycle_s is not None and quantity.parts is not None and counted_s:
        performance = plan.ideal_cycle_s * quantity.parts / counted_s
    return ShiftFigures(
        since=span.since,
        until=span.until,
        running_s=running_s,
        down_s=down_s,
        planned_s=max(0.0, span.seconds - running_s - down_s - total(unknown)),
        unknown_s=total(unknown),
        counted_s=counted_s,
        produced=quantity.produced,
        good=quantity.good,
        performance=performance,
        stops=lost,
        reasons=tuple(pareto(lost)),
        bands=tuple(_bands(span, recorded, stops, breaks, plan)),
    )


def _clipped(recorded: Iterable[Spell], activity: Activity, span: Span) -> Iterator[Span]:
    spans = (Span(spell.since, spell.until) for spell in recorded if spell.activity == activity)
    return overlaps(span, spans)


def _stop_time(stop: AnsweredStop, span: Span, breaks: Sequence[Span], plan: Plan) -> StopTime:
    """Short is what is short in all, also where a part of it is in the shift."""

    parts = [part for each in stop.standstill.spans for part in overlaps(each, [span])]
    worked = total(rest for part in parts for rest in without(part, breaks))
    is_short = not stop.reason and is_short_stop(
        stop.standstill.spans, plan.breaks, plan.reason_after_s
    )
    return StopTime(stop, worked, is_short)


def is_short_stop(spans: Sequence[Span], breaks: Sequence[str], reason_after_s: float) -> bool:
    """Whether no reason is asked of a standstill: without its breaks it is shorter than
    `reason_after_s`."""
    if total(spans) < reason_after_s:
        return True
    worked = (rest for span in spans for rest in without(span, break_spans(span, breaks)))
    return total(worked) < reason_after_s


def pareto(stops: Iterable[StopTime]) -> Iterator[ReasonTime]:
    """The times by reason, the longest first."""
    seconds: dict[str, float] = {}
    numbers: dict[str, int] = {}
    for stop in stops:
        reason = SHORT if stop.is_short else stop.stop.reason
        seconds[reason] = seconds.get(reason, 0.0) + stop.seconds
        numbers[reason] = numbers.get(reason, 0) + 1
    whole, summed = sum(seconds.values()), 0.0
    for reason, lasted in sorted(seconds.items(), key=lambda item: -item[1]):
        summed += lasted
        yield ReasonTime(reason, lasted, numbers[reason], summed / whole)


def _bands(
    span: Span,
    recorded: Sequence[Spell],
    stops: Sequence[AnsweredStop],
    breaks: Sequence[Span],
    plan: Plan,
) -> Iterator[Band]:
    """The states over the shift, in their order; times without a record are bands of their own."""
    planned = _merged(
        [*breaks, *(each for s in stops if s.reason in plan.planned for each in s.standstill.spans)]
    )
    at = span.since
    for spell in recorded:
        for part in overlaps(span, [Span(spell.since, spell.until)]):
            if at < part.since:
                yield Band(at, part.since, "unknown")
            at = part.until
            if spell.activity != "standing":
                yield Band(*part, spell.activity)
                continue
            kind: BandKind = "fault" if _is_abnormal(spell.state) else "waiting"
            pieces = [Band(*piece, kind) for piece in without(part, planned)]
            pieces += [Band(*piece, "planned") for piece in overlaps(part, planned)]
            yield from sorted(pieces)
    if at < span.until:
        yield Band(at, span.until, "unknown")


def state_text(state: str) -> Any:
    """The text in the JSON of a state."""
    return json.loads(state)["text"]


def _is_abnormal(state: str) -> bool:
    return json.loads(state).get("colour") in ("red", "yellow")


# Reasons, from the operator's log.

KEY_BEFORE_S: Final = 2.0  # the state of a standstill is recorded so much later at most
KEY_AFTER_S: Final = 5.0  # an alarm that belongs to it is raised so much later at most
SAME_S: Final = 60.0  # an answer about another time is about another stop of this name


class Answer(NamedTuple):
    """Why the stop with this key, which began at `began`, happened, and who said so, and when."""

    key: str
    began: float
    reason: str
    who: str
    at: float


def answer_of(entry: Entry) -> Answer:
    """The answer in an entry of the operator's log."""
    values = json.loads(entry.values)
    began = datetime.fromisoformat(values["began"]).timestamp()
    return Answer(values["stop"], began, values["reason"], entry.who, entry.at / 1000)


def stop_key(
    stop: Standstill, changes: Iterable[Change], others: Iterable[Stop], running: frozenset[str]
) -> str:
    """The name of a standstill in addresses: the change of the state by which it began, else an alarm
    at that time; "" without either. `running` are the states that produce."""
    near = [
        (abs(row.at - stop.since), f"state-{row.seq}")
        for row in changes
        if row.id not in running and -KEY_BEFORE_S <= row.at - stop.since <= 1.0
    ]
    if near:
        return min(near)[1]
    alarms = [other for other in others if -KEY_BEFORE_S <= other.at - stop.since <= KEY_AFTER_S]
    return min(alarms, key=lambda other: other.at).key if alarms else ""


def answered(
    stops: Iterable[Standstill], key_of: Callable[[Standstill], str], answers: Sequence[Answer]
) -> list[AnsweredStop]:
    """The standstills with their keys and answers, of which the newest come first and count."""

    def answer(stop: Standstill, key: str) -> Answer | None:
        same = (a for a in answers if a.key == key and abs(a.began - stop.since) <= SAME_S)
        return next(same, None)

    keyed = ((stop, key_of(stop)) for stop in stops)
    return [AnsweredStop(stop, key, answer(stop, key) if key else None) for stop, key in keyed]
