"""The shift report: a page of paper with alarms, presses and the states of the machine in a time."""

import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from typing import Final, NamedTuple, TypedDict

from app.alarms.figures import Figures
from app.alarms.history import HistoryRow
from app.alarms.records import text_of
from app.alarms.report import AlarmReport
from app.alarms.shifts import Shift, shift_at
from app.alarms.state_times import StatePeriod
from app.audit import Row
from app.clock import format_datetime, format_time
from app.commands.alarm_acts import ALARM_ACTS
from app.commands.shift_acts import LONGEST_MESSAGE, SHIFT_ACTION
from app.i18n import Text, TextLike, date_and_time, number, say, time_of_day
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.printable import printable, printable_texts
from app.view.time_values import duration_text
from app.web.rendering.alarm_figures import (
    FiguresContext,
    clock_text,
    figures_context,
    median_text,
    rate_text,
)
from app.web.rendering.alarm_report_query import SHIFTS, ReportQuery
from app.web.rendering.alarms_page import word
from app.web.rendering.log_words import outcome_of, who_of
from app.web.rendering.log_words import word as log_word

PRESSES: Final = 8  # on the page; the others are counted
COUNTED: Final = 500  # presses at most
MARKS: Final = 4
# Entries that no operator made.
LEFT_OUT: Final = frozenset({"began", "changed", "signed", "resumed", "removed"})


class ShownMessage(NamedTuple):
    """A message to the next shift: who left it, and when."""

    text: str
    who: TextLike
    at: Text


class ShownState(NamedTuple):
    """A state of the machine with how long it was in it; `fill` is how the bar shows it."""

    text: TextLike
    fill: str
    duration: TextLike


class ShownPeriod(NamedTuple):
    """A part of the bar of states, in percent of it."""

    fill: str
    x: float
    width: float


class ReportRow(NamedTuple):
    """A row of a table: `cells` beside the first."""

    first: TextLike
    cells: tuple[TextLike, ...]
    priority: int = 0
    text: TextLike = ""


class ReportContext(TypedDict):
    """The variables of `alarm-report.html`, beside those of the frame."""

    wanted: ReportQuery
    typed: dict[str, str]
    shifts: list[tuple[Text, TextLike, str, bool]]
    robots: dict[str, TextLike]
    span: Text
    figures: list[tuple[TextLike, TextLike, TextLike]]
    states: list[ShownState]
    periods: list[ShownPeriod]
    marks: list[TextLike]
    frequent: list[ReportRow]
    high: list[ReportRow]
    high_more: TextLike
    presses: list[ReportRow]
    presses_more: TextLike
    of_time: FiguresContext
    from_before: ShownMessage | None
    to_next: ShownMessage | None
    longest_message: int
    printed: Text


class ReportParts(NamedTuple):
    """What a report is made of: `rows` are entries of the operator's log, the newest first, and
    `messages` those of its messages, also of the shift before."""

    figures: Figures
    alarms: AlarmReport
    states: Sequence[StatePeriod]
    rows: Sequence[Row]
    messages: Sequence[Row] = ()


def report_context(
    panel: Panel, wanted: ReportQuery, shift: Shift, parts: ReportParts, now: float
) -> ReportContext:
    """The report of a time."""
    end = min(shift.until, now)
    fills = _fills(parts.states)
    presses = [row for row in parts.rows if row.entry.kind not in LEFT_OUT]
    alarms = parts.alarms
    high_more = alarms.high_count - len(alarms.high)
    return ReportContext(
        wanted=wanted,
        typed=printable_texts(wanted.model_dump()),
        shifts=[
            (word(f"report_{name}"), _span(shift_at(now, panel.alarm_rules.shifts, back)), name, chosen)
            for back, name in enumerate(SHIFTS)
            for chosen in [name == wanted.shift and not wanted.has_times]
        ],
        robots={str(robot.id): robot.name for robot in panel.robots},
        span=_span(shift),
        figures=list(_figures(parts.figures, len(presses))),
        states=list(_durations(parts.states, fills)),
        periods=[
            ShownPeriod(fills[period.state], *_place(period, shift.since, end))
            for period in parts.states
        ],
        marks=[clock_text(shift.since + n * (end - shift.since) / MARKS) for n in range(MARKS + 1)],
        frequent=[
            ReportRow(
                "",
                (
                    number(f"{alarm.raises:,d}"),
                    duration_text(alarm.active_s) if alarm.active_s else "–",
                    duration_text(alarm.longest_s) if alarm.longest_s else "–",
                ),
                alarm.row.priority,
                _text(alarm.row),
            )
            for alarm in alarms.frequent
        ],
        high=[
            ReportRow(
                format_time(row.at),
                (_lasted(returned), _acknowledged(acknowledged)),
                row.priority,
                _text(row),
            )
            for row, acknowledged, returned in alarms.high
        ],
        high_more=say("alarms_report_more", count=number(f"{high_more:,d}")) if high_more else "",
        presses=[_press(panel, row) for row in reversed(presses[:PRESSES])],
        presses_more=_more(len(presses) - PRESSES, len(parts.rows)),
        of_time=figures_context(parts.figures),
        from_before=_message(row for row in parts.messages if row.entry.at < shift.since * 1000),
        to_next=_message(row for row in parts.messages if row.entry.at >= shift.since * 1000),
        longest_message=LONGEST_MESSAGE,
        printed=say("alarms_report_printed", time=format_datetime(now)),
    )


def _message(rows: Iterable[Row]) -> ShownMessage | None:
    """The newest of messages."""
    row = next(iter(rows), None)
    if row is None:
        return None
    text, entry = json.loads(row.entry.values).get("text", ""), row.entry
    return ShownMessage(
        printable(str(text)), who_of(printable(entry.who)), format_datetime(entry.at / 1000)
    )


def _span(shift: Shift) -> Text:
    since, until = (datetime.fromtimestamp(at) for at in shift)
    end = (
        time_of_day(until.strftime("%H:%M"))
        if since.date() == until.date()
        else date_and_time(until.strftime("%Y-%m-%d %H:%M"))
    )
    begin = date_and_time(since.strftime("%Y-%m-%d %H:%M"))
    return say("alarms_report_span", since=begin, until=end)


def _figures(figures: Figures, presses: int) -> Iterator[tuple[TextLike, TextLike, TextLike]]:
    yield (
        word("title"),
        number(f"{figures.raised:,d}"),
        say("alarms_report_per_hour", rate=rate_text(figures.per_hour)),
    )
    yield (
        word("report_worst"),
        number(f"{figures.worst_10_min:,d}"),
        word("report_in_10_min"),
    )
    yield word("figure_acknowledge"), median_text(figures), word("figure_median")
    yield word("report_presses"), _count(presses), ""


def _count(presses: int) -> TextLike:
    if presses >= COUNTED:
        return say("alarms_report_at_least", count=number(f"{presses:,d}"))
    return number(f"{presses:,d}")


def _more(more: int, read: int) -> TextLike:
    """How many presses are only in the log."""
    if more <= 0:
        return ""
    code = "alarms_report_presses_at_least" if read >= COUNTED else "alarms_report_presses_more"
    return say(code, count=number(f"{more:,d}"))


def _fills(periods: Iterable[StatePeriod]) -> dict[str, str]:
    """How each state is shown on paper: what is abnormal is hatched, the others differ in grey."""
    fills: dict[str, str] = {}
    greys = 0
    for state in dict.fromkeys(period.state for period in periods):
        shown = json.loads(state)
        if shown["colour"] in ("red", "yellow"):
            fills[state] = "hatched"
        elif shown["colour"] == "none":
            fills[state] = "white"
        else:
            fills[state] = f"grey{greys % 4}"
            greys += 1
    return fills


def _durations(periods: Sequence[StatePeriod], fills: Mapping[str, str]) -> Iterator[ShownState]:
    """The states with the longest first."""
    seconds: dict[str, float] = {}
    for since, until, state in periods:
        seconds[state] = seconds.get(state, 0.0) + until - since
    for state, lasted in sorted(seconds.items(), key=lambda item: -item[1]):
        if lasted >= 1.0:
            text = text_of(json.loads(state)["text"])
            yield ShownState(text, fills[state], duration_text(float(round(lasted))))


def _place(period: StatePeriod, since: float, until: float) -> tuple[float, float]:
    whole = max(1.0, until - since)
    return (
        round(100 * (period.since - since) / whole, 3),
        round(100 * (period.until - period.since) / whole, 3),
    )


def _text(row: HistoryRow) -> TextLike:
    return text_of(json.loads(row.record).get("about", {}).get("text", row.id))


def _lasted(row: HistoryRow | None) -> TextLike:
    return "–" if row is None or row.lasted_s is None else duration_text(row.lasted_s)


def _acknowledged(row: HistoryRow | None) -> TextLike:
    if row is None or row.lasted_s is None:
        return word("report_not_acknowledged")
    who = who_of(printable(row.actor))
    return say("alarms_report_who_after", who=who, duration=duration_text(row.lasted_s))


def _press(panel: Panel, row: Row) -> ReportRow:
    entry = row.entry
    if entry.kind in ("control", "alarm"):
        acts = {*(f"alarm_{act}" for act in ALARM_ACTS), SHIFT_ACTION}
        is_known = entry.action in acts or entry.kind == "control"
        label: TextLike = log_word(entry.action) if is_known else entry.action
    else:
        labels = {w.id: w.label for w in panel.widgets() if isinstance(w, Command)}
        label = labels.get(entry.widget, printable(entry.widget))
    at = datetime.fromtimestamp((row.pressed_at or entry.at) / 1000)
    return ReportRow(
        time_of_day(at.strftime("%H:%M")),
        (who_of(printable(entry.who)), label, outcome_of(entry.outcome or entry.kind)),
    )


def now() -> float:
    """Seconds since the epoch."""
    return time.time()
