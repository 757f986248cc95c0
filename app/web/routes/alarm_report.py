"""The shift report: a page to be printed, with alarms, presses and the states of the machine."""

import asyncio
import json
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from typing import Annotated, Final, Literal, NamedTuple, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.alarms.figures import Figures
from app.cell.alarms.history import HistoryRow
from app.cell.alarms.records import text_of
from app.cell.alarms.report import AlarmReport, Shift, StatePeriod, read_report, read_states, shift_at
from app.cell.commands.press import PRESS_ID
from app.cell.commands.shift_acts import LONGEST_MESSAGE, SHIFT_ACTION
from app.cell.view.times import duration_text
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.records import Filter, LogRow, OperatorLog
from app.system.clock import format_datetime, format_time
from app.system.printable import printable, printable_texts
from app.system.texts import Text, TextLike, date_and_time, number, say, time_of_day
from app.web.acts import ActBody, act_responses, refused_form, said_of, sent_act
from app.web.answers import ActAnswer
from app.web.app_state import AppState, CurrentState
from app.web.pages.alarm_figures import (
    FiguresContext,
    clock_text,
    figures_context,
    median_text,
    rate_text,
)
from app.web.pages.alarms import word
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.log_words import ACTION_WORDS, outcome_of, who_of
from app.web.pages.log_words import word as log_word
from app.web.requests import SINCE, FormFields, TypedTime, described_body, errors, parse_form_time
from app.web.routes.alarm_history import read_figures_of

# The query of the shift report: of which time it is.

DAY_S: Final = 86_400.0
SHIFTS: Final = ("this", "last", "previous")
SHIFT_WORDS: Final = ("alarms_report_this", "alarms_report_last", "alarms_report_previous")


class ReportQuery(BaseModel):
    """The time of the report: a shift, or from `since` on and before `until` if one of these is there.
    `robot` is the id of the one whose states are shown; "" shows those of all."""

    model_config = ConfigDict(extra="forbid")

    shift: Literal["this", "last", "previous"] = "this"
    since: TypedTime = ""
    until: TypedTime = ""
    robot: Annotated[str, Field(max_length=64)] = ""
    act: Annotated[str, Field(max_length=400)] = ""

    @property
    def has_times(self) -> bool:
        return bool(self.since or self.until)

    def times(self, now: float, starts: Sequence[str]) -> Shift:
        """From when to when; InputError for what is no time. Without a beginning the time is a day
        long, and without an end it ends now."""
        if not self.has_times:
            return shift_at(now, starts, SHIFTS.index(self.shift))
        since = parse_form_time("since", self.since)
        until = parse_form_time("until", self.until, fold=1)
        end = now if until is None else until / 1000
        return Shift(end - DAY_S if since is None else since / 1000, end)

    def before(self, now: float, starts: Sequence[str]) -> Shift:
        """The time before that, of the same length, or the shift before."""
        if not self.has_times:
            return shift_at(now, starts, SHIFTS.index(self.shift) + 1)
        since, until = self.times(now, starts)
        return Shift(since - (until - since), since)


# The shift report: a page of paper with alarms, presses and the states of the machine in a time.

PRESSES: Final = 8  # on the page; the others are counted
COUNTED: Final = 500  # presses at most
MARKS: Final = 4
# Entries that no operator made.
LEFT_OUT: Final = frozenset({"began", "changed", "signed", "resumed", "removed", "clock"})


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


class RobotStates(NamedTuple):
    """The states of one robot. `robot` is its name, "" for the panel's only one."""

    robot: TextLike
    states: list[ShownState]
    periods: list[ShownPeriod]


class ReportRow(NamedTuple):
    """A row of a table: `cells` beside the first."""

    first: TextLike
    cells: tuple[TextLike, ...]
    priority: int = 0
    text: TextLike = ""


class ReportContext(TypedDict):
    """The variables of `alarm-report.html`, beside those of the frame."""

    form: ReportQuery
    typed: dict[str, str]
    shifts: list[tuple[Text, TextLike, str, bool]]
    robots: Mapping[str, TextLike]
    span: Text
    figures: list[tuple[TextLike, TextLike, TextLike]]
    states: list[RobotStates]
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
    """What a report is made of: `states` are those of each robot by its id, `rows` are entries of the
    operator's log, the newest first, and `messages` those of its messages, also of the shift before."""

    figures: Figures
    alarms: AlarmReport
    states: Mapping[str, Sequence[StatePeriod]]
    rows: Sequence[LogRow]
    messages: Sequence[LogRow] = ()


def report_context(
    panel: Panel, form: ReportQuery, shift: Shift, parts: ReportParts, now: float
) -> ReportContext:
    """The report of a time."""
    end = min(shift.until, now)
    fills = _fills(period for periods in parts.states.values() for period in periods)
    names = panel.robot_names if len(panel.robots) > 1 else {}
    presses = [row for row in parts.rows if row.entry.kind not in LEFT_OUT]
    alarms = parts.alarms
    high_more = alarms.high_count - len(alarms.high)
    return ReportContext(
        form=form,
        typed=printable_texts(form.model_dump()),
        shifts=[
            (
                say(SHIFT_WORDS[back]),
                span_text(shift_at(now, panel.alarm_rules.shifts, back)),
                name,
                chosen,
            )
            for back, name in enumerate(SHIFTS)
            for chosen in [name == form.shift and not form.has_times]
        ],
        robots=names,
        span=span_text(shift),
        figures=list(_figures(parts.figures, len(presses))),
        states=[
            RobotStates(
                names.get(robot, ""),
                list(_durations(periods, fills)),
                [
                    ShownPeriod(fills[period.state], *_place(period, shift.since, end))
                    for period in periods
                ],
            )
            for robot, periods in parts.states.items()
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


def _message(rows: Iterable[LogRow]) -> ShownMessage | None:
    """The newest of messages."""
    row = next(iter(rows), None)
    if row is None:
        return None
    text, entry = json.loads(row.entry.values).get("text", ""), row.entry
    return ShownMessage(
        printable(str(text)), who_of(printable(entry.who)), format_datetime(entry.at / 1000)
    )


def span_text(shift: Shift) -> Text:
    """From when to when a shift is."""
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


def _press(panel: Panel, row: LogRow) -> ReportRow:
    entry = row.entry
    if entry.kind in ("control", "alarm"):
        code = ACTION_WORDS.get(entry.action, "")
        label: TextLike = say(code) if code else entry.action
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


router = APIRouter()

MESSAGE_FORM: Final = FormFields(
    {"id": {"pattern": PRESS_ID}, "text": {"maxLength": LONGEST_MESSAGE}, "_since": SINCE}
)
MESSAGES_READ: Final = 20  # of two shifts, the newest


class MessageBody(ActBody):
    """The same `id` again is the same message. `at` is when it was touched, in the server's time."""

    text: Annotated[str, Field(max_length=LONGEST_MESSAGE)] = ""


class MessageReceipt(ActAnswer):
    """The receipt: `reason` is "" where it was done, `code` is its stable name."""


@router.get(
    "/alarms/report",
    response_class=HTMLResponse,
    summary="The shift report: alarms, presses and states of the machine in a time",
    responses=errors(403, 404, 422, 429, 503),
)
async def report(
    request: Request, state: CurrentState, form: Annotated[ReportQuery, Query()]
) -> Response:
    at, panel = now(), state.fleet.panel
    shift = form.times(at, panel.alarm_rules.shifts)
    alarms = state.fleet.alarms.history
    end = min(shift.until, at)
    parts = ReportParts(
        await read_figures_of(state, shift.since, end),
        await alarms.read(partial(read_report, since=shift.since, until=end)),
        await _states(state, form.robot, shift.since, end),
        await _log_rows(state, shift),
        await _messages(state, form.before(at, panel.alarm_rules.shifts), shift),
    )
    context = report_context(panel, form, shift, parts, at)
    query = urlencode(form.model_dump(exclude={"act"}, exclude_defaults=True))
    path = f"/alarms/report?{query}"
    page = FramedPage("alarm-report.html", word("report_title"), path, "alarms")
    refused = said_of(form.act, [state.fleet.first.shift_acts])
    texts = {
        "word": word,
        "log_word": log_word,
        "refused_message": refused,
        "typed_message": refused_form(request, state).typed.get("text", ""),
    }
    return framed_page(request, state, page, {**context, **texts})


@router.post(
    "/alarms/report",
    response_model=MessageReceipt,
    summary="Leave a message to the next shift",
    responses=act_responses(MessageReceipt),
    openapi_extra=described_body(MessageBody, MESSAGE_FORM.schema, required=False),
)
async def leave_message(request: Request, state: CurrentState) -> Response:
    sent = await sent_act(request, state, MessageBody, MESSAGE_FORM)
    asked = sent.asked("message", values={"text": sent.body.text})
    receipt = await sent.run(state.fleet.first.shift_acts, asked, sent.act_id())
    return sent.answer(receipt, f"{state.root}/alarms/report")


async def _messages(state: AppState, before: Shift, shift: Shift) -> list[LogRow]:
    """The messages of a shift and of the one before it, the newest first; none without a log."""
    if not isinstance(state.log, OperatorLog):
        return []
    wanted = Filter(
        since=int(before.since * 1000),
        until=int(shift.until * 1000),
        outcome="succeeded",
        text=SHIFT_ACTION,
    )
    rows = await state.log.rows(wanted, None, MESSAGES_READ)
    return [row for row in rows if row.entry.action == SHIFT_ACTION]


async def _states(
    state: AppState, robot: str, since: float, until: float
) -> dict[str, list[StatePeriod]]:
    """The states of the chosen robots by their ids; none if the panel has no `[state]`."""
    file, sessions = state.fleet.states, state.fleet.chosen(robot)
    if state.fleet.panel.state is None or file is None:
        return {}
    robots = [session.entry.id if session.entry else "" for session in sessions]
    return {id: await asyncio.to_thread(read_states, file, id, since, until) for id in robots}


async def _log_rows(state: AppState, shift: Shift) -> list[LogRow]:
    """The newest entries of the operator's log; none without a log."""
    if not isinstance(state.log, OperatorLog):
        return []
    wanted = Filter(since=int(shift.since * 1000), until=int(shift.until * 1000))
    return await state.log.rows(wanted, None, COUNTED)
