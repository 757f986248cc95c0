"""The operator's log as a page with a filter, and as CSV."""

import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from functools import partial
from typing import Annotated, Final, NamedTuple, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.alarms.report import shift_at
from app.cell.permission.verdict import WITHOUT_CONTROL
from app.cell.session.fleet import Fleet
from app.cell.view.clock_status import skew_text
from app.cell.view.machine_status import time_about, time_text
from app.panel.widgets.families import Command, EntryWidget
from app.records import Entry, Filter, LogRow, OperatorLog
from app.system.errors import NotFound
from app.system.printable import printable, printable_texts
from app.system.texts import Text, TextLike, joined, number, say
from app.web.app_state import CurrentState
from app.web.caller import caller_of
from app.web.downloads import exported
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.log_words import (
    ACTION_WORDS,
    OUTCOME_WORDS,
    by_day,
    iso_of,
    outcome_of,
    time_of,
    values_of,
    who_of,
    word,
)
from app.web.requests import TEXT, TypedTime, errors, parse_form_time

router = APIRouter()

ROWS_ON_PAGE: Final = 50


class LogQuery(BaseModel):
    """The filter as a form sends it; times are `2026-11-21T10:00`, in the server's zone where they
    have none of their own. `robot` is the id of the robot whose frame is around the page, `act`
    that of an act on an alarm, whose receipt is shown: they leave no entry out."""

    model_config = ConfigDict(extra="forbid")

    since: TypedTime = ""
    until: TypedTime = ""
    widget: Annotated[str, Field(max_length=64)] = ""
    outcome: Annotated[str, Field(max_length=20)] = ""
    who: Annotated[str, Field(max_length=64)] = ""
    text: Annotated[str, Field(max_length=100)] = ""
    every: bool = False
    before: Annotated[int, Field(ge=1, lt=2**63)] | None = None
    robot: Annotated[str, Field(max_length=64)] = ""
    act: Annotated[str, Field(max_length=400)] = ""

    @property
    def is_narrowed(self) -> bool:
        """Whether entries are left out."""
        return any(self.model_dump(exclude={"before", "robot", "act", "every"}).values())

    def filter(self) -> Filter:
        """Raises InputError for what is no time."""
        return Filter(
            since=parse_form_time("since", self.since),
            until=parse_form_time("until", self.until, fold=1),
            **self.model_dump(include={"widget", "outcome", "who", "text", "every"}),
        )

    def query(self, before: int | None = None) -> str:
        """The same filter as the query of an address."""
        fields = {k: v for k, v in self.model_dump(exclude={"before", "act"}).items() if v}
        if before is not None:
            fields["before"] = before
        return urlencode(fields)


class Quick(NamedTuple):
    """A button that shows the entries of a time. `query` is the filter, `current`: it is the shown
    one."""

    label: Text
    query: str
    current: bool


def quick_choices(form: LogQuery, shifts: Sequence[str], now: float) -> list[Quick]:
    """The buttons above the filter; the last one shows the log as it opens."""
    today = datetime.fromtimestamp(now).replace(hour=0, minute=0, second=0)
    shift = datetime.fromtimestamp(shift_at(now, shifts).since)
    times = {
        "log_page_quick_today": (_typed(today), ""),
        "log_page_quick_yesterday": (_typed(today - timedelta(days=1)), _typed(today)),
        "log_page_quick_shift": (_typed(shift), ""),
    }
    choices = []
    for code, (since, until) in times.items():
        chosen = form.model_copy(update={"since": since, "until": until})
        current = (form.since, form.until) == (since, until)
        choices.append(Quick(say(code), chosen.query(), current))
    start = LogQuery(robot=form.robot)
    current = not form.is_narrowed and form.before is None
    return [*choices, Quick(say("log_page_quick_start"), start.query(), current)]


def _typed(moment: datetime) -> str:
    return f"{moment:%Y-%m-%dT%H:%M}"


class LogContext(TypedDict):
    """The variables of `log.html`, beside those of the frame."""

    form: LogQuery
    quick: list[Quick]
    typed: dict[str, str]
    days: list[tuple[Text, list[LogRow]]]
    labels: dict[str, TextLike]
    entered: dict[str, TextLike]
    robots: dict[str, TextLike]
    acts: dict[str, Text]
    outcomes: tuple[str, ...]
    off: TextLike
    count: TextLike
    clocks: TextLike
    older: str
    newest: str
    csv: str


@router.get(
    "/log",
    response_class=HTMLResponse,
    summary="The operator's log, the newest first",
    responses=errors(403, 422, 429, 503),
)
async def page(request: Request, state: CurrentState, form: Annotated[LogQuery, Query()]) -> Response:
    rows: list[LogRow] = []
    language = caller_of(request).language
    if isinstance(state.log, OperatorLog):
        rows = await state.log.rows(form.filter(), form.before, ROWS_ON_PAGE + 1)
    more = len(rows) > ROWS_ON_PAGE
    rows = [_shown(row, language) for row in rows[:ROWS_ON_PAGE]]
    panel, head = state.fleet.panel, state.log.head
    context = LogContext(
        form=form,
        quick=quick_choices(form, panel.alarm_rules.shifts, time.time()),
        typed=printable_texts(form.model_dump()),
        days=list(by_day(rows)),
        labels={w.id: w.label for w in panel.widgets() if isinstance(w, Command)},
        entered={w.id: w.label for w in panel.widgets() if isinstance(w, EntryWidget)},
        robots={str(robot.name): robot.name for robot in panel.robots},
        acts={action: say(code) for action, code in ACTION_WORDS.items()},
        outcomes=tuple(OUTCOME_WORDS),
        off="" if state.log.enabled else say("log_off"),
        count=word("head", count=number(f"{head.count:,d}")) if head else "",
        clocks=_clocks(state.fleet),
        older=form.query(rows[-1].entry.seq) if more else "",
        newest=form.query() if form.before else "",
        csv=form.query(),
    )
    functions = {
        "time_of": partial(time_of, language=language),
        "iso_of": iso_of,
        "values_of": partial(values_of, language=language),
        "outcome_of": outcome_of,
        "who_of": who_of,
        "word": word,
        "without_control": WITHOUT_CONTROL.code,
    }
    framed = FramedPage("log.html", say("log_page_title"), "/log", "log", form.robot)
    return framed_page(request, state, framed, {**context, **functions})


@router.get(
    "/log.csv",
    response_class=Response,
    summary="What the filter shows, as CSV",
    responses=errors(403, 404, 422, 429, 503) | {200: {"content": {"text/csv": {"schema": TEXT}}}},
)
async def as_csv(request: Request, state: CurrentState, form: Annotated[LogQuery, Query()]) -> Response:
    if not isinstance(log := state.log, OperatorLog):
        raise NotFound(say("log_off"))
    arguments = (form.filter(), form.before)
    language = caller_of(request).language
    return await exported(
        request, lambda gzip: log.export(*arguments, gzip, language), "operator's log"
    )


def _clocks(fleet: Fleet) -> TextLike:
    """What the times of the entries are worth: the panel's own clock, and the robots' against it. Of
    several robots those that are apart."""
    if fleet.machine is None:
        return ""
    time_now = fleet.machine.now.time
    parts = [time_text(time_now), time_about(time_now)]
    skews = fleet.skews()
    for robot, skew in skews.items():
        if skew is not None and (len(skews) == 1 or skew.state != "even"):
            named = fleet.of_robot(robot).entry
            about = {"robot": named.name} if named is not None else {}
            code = "log_page_robot_clock" if named is not None else "log_robot_clock"
            parts.append(say(code, text=skew_text(skew), **about))
    return joined(parts)


def _shown(row: LogRow, language: str) -> LogRow:
    """With its texts as a page shows them, but its values: those are JSON still."""
    entry = row.entry._replace(reason=row.entry.reason_in(language))
    cells = (
        printable(cell) if isinstance(cell, str) and name != "values" else cell
        for name, cell in entry._asdict().items()
    )
    return replace(row, entry=Entry._make(cells))
