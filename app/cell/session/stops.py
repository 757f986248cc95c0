"""Reads stops and their stories from the stores of a panel, when they are asked for."""

import asyncio
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol

from app.cell.alarms.history import MAX_PAGE, NEWEST, HistoryFilter, HistoryRow, history_rows, reading
from app.cell.alarms.report import CountRow, read_counts, read_states, shift_at
from app.cell.alarms.shown import AskedReason, OpenStop
from app.cell.commands.shift_acts import REASON_ACTION
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.cell.session.state_recorder import ASK_BEFORE_END_S
from app.cell.stops.changes import Change, ChangeFilter, read_changes
from app.cell.stops.oee import (
    MOST_OPEN,
    SAME_S,
    Answer,
    AnsweredStop,
    Plan,
    ShiftFigures,
    Span,
    Spell,
    Standstill,
    answer_of,
    answered,
    is_short_stop,
    open_stops,
    quantities,
    shift_figures,
    spells,
    standstills,
    stop_key,
)
from app.cell.stops.sources import (
    PanelNames,
    alarm_events,
    alarm_stops,
    change_events,
    change_stops,
    goal_stops,
    log_events,
    separate,
)
from app.cell.stops.story import AFTER_S, BEFORE_S, MOST_EVENTS, Event, Stop, StopSort, Story, story_of
from app.cell.view.times import duration_text
from app.panel.alarm import STOPPING_PRIORITY
from app.panel.model import Panel
from app.records import Filter, LogRow, NullLog, OperatorLog
from app.system.clock import format_time
from app.system.errors import NotFound
from app.system.texts import TextLike, joined, number, say

MOST_STOPS: Final = 200
KEY_S: Final = 2.0  # a state is recorded so much later than its change at most
LOOK_BACK_S: Final = 7 * 86_400.0  # for when a standstill began
MOST_ANSWERS: Final = 2_000
LATE_S: Final = 5.0  # by so much the arrival of a stamped change may be later than its stamp
FORWARD_S: Final = 86_400.0  # in which the end of a stop is looked for


class LogRows(Protocol):
    """The entries of an operator's log."""

    async def rows(self, wanted: Filter, before: int | None, count: int) -> Sequence[LogRow]:
        """The newest `count` that match, before the entry number `before`. LogError, TooMany."""


class AlarmRows(Protocol):
    """The history of alarms."""

    async def read(self, read: Callable[[Path | None], list[HistoryRow]]) -> list[HistoryRow]:
        """What a function reads from its file, None for none. LogError, TooMany."""


@dataclass(frozen=True, kw_only=True)
class StopStores:
    """Where the stops of a panel are read from. `names` is what its robots call their parts, `robots`
    the name of each in the operator's log, both by the robot's id, "" for the only one. `log` is None
    without a log, `states` without a journal of changes."""

    panel: Panel
    names: Mapping[str, PanelNames]
    robots: Mapping[str, str]
    alarms: AlarmRows
    log: LogRows | None
    states: Path | None


def stores_of(fleet: Fleet, log: OperatorLog | NullLog) -> StopStores:
    """Those of a running server."""
    sessions = {session.entry.id if session.entry else "": session for session in fleet.sessions}
    return StopStores(
        panel=fleet.panel,
        names={robot: PanelNames(session.panel) for robot, session in sessions.items()},
        robots={robot: session.robot.name for robot, session in sessions.items()},
        alarms=fleet.alarms.history,
        log=log if isinstance(log, OperatorLog) else None,
        states=fleet.states,
    )


class StopReader:
    """The stops of all robots of a panel. Used on an event loop only; it reads beside it."""

    def __init__(self, stores: StopStores) -> None:
        self._stores = stores

    def names(self, robot: str) -> PanelNames:
        """What the panel of a robot calls its parts; of the first for one that is no longer there."""
        names = self._stores.names
        return names.get(robot) or next(iter(names.values()))

    async def stops(self, since: float, until: float, robot: str | None = None) -> list[Stop]:
        """The newest stops from `since` on and before `until` (seconds since the epoch), the newest
        first, at most `MOST_STOPS`. LogError if they can't be read, TooMany if too many searches
        run."""
        wanted = ChangeFilter(robot, since, until, only_stops=True)
        known: list[Stop] = [*change_stops(self.names, await self._changes(wanted, MOST_STOPS))]
        for priority in range(1, STOPPING_PRIORITY + 1):
            asked = HistoryFilter(since=since, until=until, priority=priority, robot=robot or "")
            known += alarm_stops(await self._alarms(asked, MAX_PAGE))
        aborted = Filter(since=round(since * 1000), until=round(until * 1000), outcome="aborted")
        rows = await self._entries(aborted, MOST_STOPS)
        for own, name in self._stores.robots.items():
            if robot in (None, own):
                goals = [row for row in rows if row.entry.robot == name]
                known += goal_stops(self.names(own), own, goals)
        return separate(known)[:MOST_STOPS]

    async def latest(self, now: float, robot: str | None = None) -> Stop | None:
        """The newest stop of the last day; None without one. Errors as of `stops`."""
        return next(iter(await self.stops(now - FORWARD_S, now + 1.0, robot)), None)

    async def of_alarm(self, alarm: str, occurrence: int) -> Stop | None:
        """The raise of an alarm; None if there is no record of it."""
        rows = await self._alarms(HistoryFilter(alarm=alarm), MAX_PAGE)
        raised = [row for row in rows if row.occurrence == occurrence and row.event == "raised"]
        return next((self._as_stop(row) for row in raised), None)

    def _as_stop(self, row: HistoryRow) -> Stop:
        """An alarm of any priority as a stop: someone asks for its story."""
        (stop,) = alarm_stops([row._replace(priority=1)])
        return stop

    async def stop(self, sort: StopSort, number: int) -> Stop:
        """The stop with this number. NotFound if there is no record of it."""
        stop = await self._stop(sort, number)
        if stop is None:
            raise NotFound(say("story_gone"))
        return stop

    async def key_at(self, robot: str, since: float) -> str:
        """The key of the standstill that began at `since`; "" without one."""
        _, stood = await self.standstills(robot, since, since + KEY_S)
        return stood[-1].key if stood else ""

    async def story(self, sort: StopSort, number: int) -> Story:
        """The story of the stop with this number. NotFound if there is no record of it."""
        stop = await self.stop(sort, number)
        since, until = stop.begun - BEFORE_S, max(stop.at, stop.begun) + AFTER_S + LATE_S
        names = self.names(stop.robot)
        wanted = ChangeFilter(stop.robot, since, until)
        changes = await self._changes(wanted, MOST_EVENTS)
        alarms = await self._alarms(HistoryFilter(since=since, until=until), MOST_EVENTS)
        entries = await self._entries(
            Filter(since=round(since * 1000), until=round(until * 1000)), MOST_EVENTS
        )
        robots = self._stores.robots
        robot = robots.get(stop.robot, next(iter(robots.values())))
        events: list[Event] = [
            *change_events(names, changes),
            *alarm_events(names, [row for row in reversed(alarms) if row.robot in ("", stop.robot)]),
            *log_events(names, [row for row in reversed(entries) if row.entry.robot in ("", robot)]),
        ]
        rules = self._stores.panel.state
        return story_of(
            stop,
            events,
            frozenset(rules.effects) if rules else (),
            are_complete=all(len(rows) < MOST_EVENTS for rows in (changes, alarms, entries)),
        )

    async def end_of(self, stop: Stop) -> float | None:
        """When a state that is a stop was over, in seconds since the epoch; None while it is not, and
        for stops that are no states."""
        if stop.sort != "state":
            return None
        later = ChangeFilter(stop.robot, stop.at, stop.at + FORWARD_S)
        rows = await self._changes(later, MOST_EVENTS)
        return next((row.at for row in rows if row.sort == "state" and row.seq > stop.number), None)

    async def standstills(
        self, robot: str, since: float, until: float
    ) -> tuple[list[Spell], list[AnsweredStop]]:
        """The states of a robot from some days before a time on, and when it stood still in the time,
        with the reasons that were given. Errors as of `stops`."""
        panel, path = self._stores.panel, self._stores.states
        if panel.oee is None or panel.state is None or path is None:
            return [], []
        running = panel.oee.running_values(panel.state)
        early = since - LOOK_BACK_S
        recorded, stood = await asyncio.to_thread(_stood, path, robot, early, until, running)
        stood = [stop for stop in stood if stop.until > since]
        begun = stood[0].since if stood else until
        near = ChangeFilter(robot, begun - KEY_S, until)
        changes = [row for row in await self._changes(near, MOST_EVENTS) if row.sort == "state"]
        others = [
            stop for stop in await self.stops(begun - KEY_S, until, robot) if stop.sort == "alarm"
        ]
        names = frozenset(map(str, running))
        key_of = partial(stop_key, changes=changes, others=others, running=names)
        return recorded, answered(stood, key_of, await self._answers(begun - KEY_S))

    async def standstill_at(self, stop: Stop) -> AnsweredStop | None:
        """The standstill that a stop belongs to; None without a record of one."""
        _, stood = await self.standstills(stop.robot, stop.at - KEY_S, stop.at + FORWARD_S)
        return next((each for each in stood if each.standstill.since <= stop.at + AFTER_S), None)

    async def counts(self, robot: str, since: float, until: float) -> list[CountRow]:
        """What its counters showed."""
        if self._stores.states is None:
            return []
        return await asyncio.to_thread(read_counts, self._stores.states, robot, since, until)

    async def _answers(self, since: float) -> list[Answer]:
        """The newest first."""
        answers = Filter(since=round(since * 1000), outcome="succeeded", text=REASON_ACTION)
        rows = await self._entries(answers, MOST_ANSWERS)
        return [answer_of(row.entry) for row in rows if row.entry.action == REASON_ACTION]

    async def _stop(self, sort: StopSort, number: int) -> Stop | None:
        if sort in ("state", "link"):
            rows = await self._changes(ChangeFilter(seq=number), 1)
            counts = self._stores.panel.oee is not None
            stops = change_stops(self.names, (row for row in rows if row.sort == sort), counts)
            return next(stops, None)
        if sort == "alarm":
            asked = await self._alarms(HistoryFilter(before=number + 1), 1)
            return next((self._as_stop(row) for row in asked if row.seq == number), None)
        for row in await self._entries(Filter(outcome="aborted"), 1, before=number + 1):
            for robot, name in self._stores.robots.items():
                if row.entry.seq == number and row.entry.robot == name:
                    return next(goal_stops(self.names(robot), robot, [row]), None)
        return None

    async def _changes(self, wanted: ChangeFilter, most: int) -> list[Change]:
        if self._stores.states is None:
            return []
        return await asyncio.to_thread(read_changes, self._stores.states, wanted, most)

    async def _alarms(self, wanted: HistoryFilter, most: int) -> list[HistoryRow]:
        """The newest first."""
        return await self._stores.alarms.read(partial(read_alarms, wanted=wanted, most=most))

    async def _entries(self, wanted: Filter, most: int, before: int | None = None) -> Sequence[LogRow]:
        """The newest first; none without a log."""
        return [] if self._stores.log is None else await self._stores.log.rows(wanted, before, most)


def _stood(
    path: Path, robot: str, since: float, until: float, running: Sequence[Any]
) -> tuple[list[Spell], list[Standstill]]:
    recorded = spells(read_states(path, robot, since, until), running)
    return recorded, standstills(recorded)


def ask_reason(fleet: Fleet, robot: str, since: float, until: float) -> None:
    """Asks why a robot stood still from `since` to `until`, unless it was short: shortly before
    the shift ends together with what is asked of other robots, else in its place."""
    rules, span = fleet.panel.oee, Span(since, until)
    if rules is None or not rules.reasons:
        return
    if is_short_stop([span], rules.breaks, rules.reason_after_s):
        return
    names, stops = fleet.panel.robot_names, [OpenStop(robot=robot, began=since)]
    question = fleet.alarms.asked
    others = [stop for stop in question["stops"] if stop["robot"] != robot] if question else []
    if question is not None and others and until < question["shift_ends"]:
        stops = [*question["stops"], *stops][-MOST_OPEN:]
        fleet.alarms.ask(asked_together(names, stops, question["shift_ends"]))
        return
    duration = duration_text(float(round(until - since)))
    text = say("oee_stood_still", duration=duration)
    if len(names) > 1:
        text = say("oee_robot_stood_still", robot=names[robot], duration=duration)
    times = say("oee_from_to", since=format_time(since), until=format_time(until))
    ends = shift_at(until, fleet.panel.alarm_rules.shifts).until
    shift_ends = ends if until >= ends - ASK_BEFORE_END_S else 0.0
    fleet.alarms.ask(AskedReason(stops=stops, text=text, times=times, shift_ends=shift_ends))


async def ask_open_reasons(fleet: Fleet, log: OperatorLog | NullLog, now: float) -> None:
    """Asks before the end of a shift for the reasons of the stops of all robots that have none, as
    those that were left for later. LogError and TooMany as of `figures_of`."""
    shift = shift_at(now, fleet.panel.alarm_rules.shifts)
    figures = await figures_of(fleet, log, fleet.sessions, shift.since, now)
    stops = [
        OpenStop(robot=robot, began=time.stop.standstill.since) for robot, time in open_stops(figures)
    ]
    if stops:
        fleet.alarms.ask(asked_together(fleet.panel.robot_names, stops, shift.until))


def asked_together(
    names: Mapping[str, TextLike], stops: list[OpenStop], shift_ends: float
) -> AskedReason:
    """The question for the reasons of stops before a shift ends. `names` are those of the panel's
    robots by their ids: with several it says how many stops each has."""
    text, times = say("oee_open_count", count=number(str(len(stops)))), say("oee_before_end")
    if len(names) > 1:
        counts = Counter(stop["robot"] for stop in stops)
        parts = [
            say("oee_open_robot", robot=name, count=number(str(counts[robot])))
            for robot, name in names.items()
            if counts[robot]
        ]
        times = say("oee_before_end_robots", robots=joined(parts, "between_names"))
    return AskedReason(stops=stops, text=text, times=times, shift_ends=shift_ends)


def reason_given(fleet: Fleet, robot: str, since: float) -> None:
    """The reason of a stop was given, or left for later: it is not asked any more."""
    question = fleet.alarms.asked
    if question is None:
        return
    stops = [
        stop
        for stop in question["stops"]
        if stop["robot"] != robot or abs(stop["began"] - since) > SAME_S
    ]
    if len(stops) < len(question["stops"]):
        rest = asked_together(fleet.panel.robot_names, stops, question["shift_ends"])
        fleet.alarms.ask(rest if stops else None)


async def figures_of(
    fleet: Fleet,
    log: OperatorLog | NullLog,
    sessions: Sequence[RobotSession],
    since: float,
    until: float,
) -> dict[str, ShiftFigures]:
    """The figures of robots from `since` on and before `until`, in seconds since the epoch, by the
    robot's id, "" for the only one. LogError if the stores can't be read, TooMany if too many searches
    run."""
    reader, span = StopReader(stores_of(fleet, log)), Span(since, until)
    robots = [session.entry.id if session.entry else "" for session in sessions]
    return {robot: await _figures_of(fleet.panel, reader, robot, span) for robot in robots}


async def _figures_of(panel: Panel, reader: StopReader, robot: str, span: Span) -> ShiftFigures:
    recorded, stops = await reader.standstills(robot, *span)
    rows = await reader.counts(robot, *span)
    rules, states = panel.oee, panel.state
    if rules is None or states is None:
        return shift_figures(span, [], [], quantities([], (), span), Plan(()))
    plan = Plan(
        rules.running_values(states),
        rules.breaks,
        rules.reason_after_s,
        rules.ideal_cycle_s,
        frozenset(reason.id for reason in rules.reasons if reason.planned),
    )
    quantity = quantities(rows, [counter.parts for counter in rules.counters], span)
    return shift_figures(span, recorded, stops, quantity, plan)


def read_alarms(path: Path | None, wanted: HistoryFilter, most: int) -> list[HistoryRow]:
    """The newest `most` transitions of a filter, page by page."""
    rows: list[HistoryRow] = []
    with reading(path) as db:
        while len(rows) < most:
            before = rows[-1].seq if rows else wanted.before
            page = history_rows(db, wanted._replace(before=min(before, NEWEST)), MAX_PAGE)
            rows += page
            if len(page) < MAX_PAGE:
                break
    return rows[:most]
