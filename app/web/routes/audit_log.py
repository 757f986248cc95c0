"""The operator's log as a page with a filter, and as CSV."""

from contextlib import AsyncExitStack
from dataclasses import replace
from functools import partial
from typing import Annotated, Final, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.audit import Entry, Filter, OperatorLog, Row
from app.commands.alarm_acts import ALARM_ACTS
from app.commands.control_acts import CONTROL_ACTS
from app.commands.diagnostic_acts import DIAGNOSTIC_ACTS
from app.commands.recipe_acts import RECIPE_ACTS
from app.commands.shift_acts import SHIFT_ACTION
from app.errors import NotFound
from app.i18n import Text, TextLike, number, say
from app.panel.widgets.families import Command, EntryWidget
from app.permission.verdict import WITHOUT_CONTROL
from app.printable import printable, printable_texts
from app.web.app_state import CurrentState
from app.web.exported import Exported
from app.web.framed_page import FramedPage, framed_page
from app.web.language import language_of
from app.web.openapi_parts import TEXT, errors
from app.web.rendering.log_words import (
    OUTCOMES,
    by_day,
    iso_of,
    outcome_of,
    time_of,
    values_of,
    who_of,
    word,
)
from app.web.typed_times import TypedTime, typed_ms

router = APIRouter()

ROWS_ON_PAGE: Final = 50
# Entries of the kind "control": acts, and changes that no act made.
CONTROL_ACTIONS: Final = (
    *(f"control_{act}" for act in CONTROL_ACTS),
    "control_lost", "control_idle", "control_first_page", "control_request_lost",
)  # fmt: skip
RECIPE_ACTIONS: Final = tuple(f"recipe_{act}" for act in RECIPE_ACTS)
ALARM_ACTIONS: Final = (*(f"alarm_{act}" for act in ALARM_ACTS), SHIFT_ACTION)
DIAGNOSTIC_ACTIONS: Final = tuple(f"diagnostics_{act}" for act in DIAGNOSTIC_ACTS)
ACTIONS: Final = (*CONTROL_ACTIONS, *ALARM_ACTIONS, *DIAGNOSTIC_ACTIONS, *RECIPE_ACTIONS)


class Wanted(BaseModel):
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
            since=typed_ms("since", self.since),
            until=typed_ms("until", self.until, fold=1),
            **self.model_dump(include={"widget", "outcome", "who", "text", "every"}),
        )

    def query(self, before: int | None = None) -> str:
        """The same filter as the query of an address."""
        fields = {k: v for k, v in self.model_dump(exclude={"before", "act"}).items() if v}
        if before is not None:
            fields["before"] = before
        return urlencode(fields)


class LogContext(TypedDict):
    """The variables of `log.html`, beside those of the frame."""

    wanted: Wanted
    typed: dict[str, str]
    days: list[tuple[Text, list[Row]]]
    labels: dict[str, TextLike]
    entered: dict[str, TextLike]
    robots: dict[str, TextLike]
    acts: dict[str, Text]
    outcomes: tuple[str, ...]
    off: TextLike
    count: TextLike
    older: str
    newest: str
    csv: str


@router.get(
    "/log",
    response_class=HTMLResponse,
    summary="The operator's log, the newest first",
    responses=errors(403, 422, 429, 503),
)
async def page(request: Request, state: CurrentState, wanted: Annotated[Wanted, Query()]) -> Response:
    rows: list[Row] = []
    language = language_of(request)
    if isinstance(state.log, OperatorLog):
        rows = await state.log.rows(wanted.filter(), wanted.before, ROWS_ON_PAGE + 1)
    more = len(rows) > ROWS_ON_PAGE
    rows = [_shown(row, language) for row in rows[:ROWS_ON_PAGE]]
    panel, head = state.fleet.panel, state.log.head
    context = LogContext(
        wanted=wanted,
        typed=printable_texts(wanted.model_dump()),
        days=list(by_day(rows)),
        labels={w.id: w.label for w in panel.widgets() if isinstance(w, Command)},
        entered={w.id: w.label for w in panel.widgets() if isinstance(w, EntryWidget)},
        robots={str(robot.name): robot.name for robot in panel.robots},
        acts={
            a: word(a) for a in (*CONTROL_ACTIONS, *ALARM_ACTIONS, *DIAGNOSTIC_ACTIONS, *RECIPE_ACTIONS)
        },
        outcomes=OUTCOMES,
        off="" if state.log.enabled else say("log_off"),
        count=word("head", count=number(f"{head.count:,d}")) if head else "",
        older=wanted.query(rows[-1].entry.seq) if more else "",
        newest=wanted.query() if wanted.before else "",
        csv=wanted.query(),
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
    framed = FramedPage("log.html", say("log_page_title"), wanted.robot)
    return framed_page(request, state, framed, {**context, **functions})


@router.get(
    "/log.csv",
    response_class=Response,
    summary="What the filter shows, as CSV",
    responses=errors(403, 404, 422, 429, 503) | {200: {"content": {"text/csv": {"schema": TEXT}}}},
)
async def as_csv(request: Request, state: CurrentState, wanted: Annotated[Wanted, Query()]) -> Response:
    if not isinstance(state.log, OperatorLog):
        raise NotFound(say("log_off"))
    gzip = "gzip" in request.headers.get("accept-encoding", "")
    async with AsyncExitStack() as opened:
        export = await opened.enter_async_context(
            state.log.export(wanted.filter(), wanted.before, gzip, language_of(request))
        )
        first = await export.start()
        return Exported(export, first, gzip, opened.pop_all(), "operator's log")


def _shown(row: Row, language: str) -> Row:
    """With its texts as a page shows them, but its values: those are JSON still."""
    entry = row.entry._replace(reason=row.entry.reason_in(language))
    cells = (
        printable(cell) if isinstance(cell, str) and name != "values" else cell
        for name, cell in entry._asdict().items()
    )
    return replace(row, entry=Entry._make(cells))
