"""The operator's log as a page with a filter, and as CSV."""

import asyncio
import logging
from contextlib import AsyncExitStack
from dataclasses import replace
from datetime import datetime
from functools import partial
from typing import Annotated, Final, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response
from pydantic import BaseModel, ConfigDict, Field, JsonValue
from starlette.types import Message, Receive, Scope, Send

from app.audit import Entry, Filter, OperatorLog, ReaderProcess, Row
from app.commands.alarm_acts import ALARM_ACTS
from app.commands.control_acts import CONTROL_ACTS
from app.errors import InputError, LogError, NotFound
from app.i18n import Text, TextLike, number, say
from app.panel.layout import FRAME_ONLY, Page
from app.panel.widgets.families import Command, EntryWidget
from app.permission.verdict import WITHOUT_CONTROL
from app.printable import printable, printable_texts
from app.web.app_state import AppState, CurrentState
from app.web.client_cookie import opened_by_person, principal_with_new_token, set_client_cookie
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
from app.web.rendering.page_context import PageContext, page_context

log = logging.getLogger("kiosk.log")

router = APIRouter()

ROWS_ON_PAGE: Final = 50
REFRESH_S: Final = 10  # a page without scripts counts as gone when it has not been loaded for so long
# Entries of the kind "control": acts, and changes that no act made.
CONTROL_ACTIONS: Final = (
    *(f"control_{act}" for act in CONTROL_ACTS),
    "control_lost", "control_idle", "control_first_page", "control_request_lost",
)  # fmt: skip
ALARM_ACTIONS: Final = tuple(f"alarm_{act}" for act in ALARM_ACTS)
TAKEN_WITHIN_S: Final = 20.0  # a piece of an export: another one may be waited for
START: Final = "http.response.start"
BODY: Final = "http.response.body"


# For who writes programs; what is no time of the calendar is refused with a sentence.
A_TIME: Final[dict[str, JsonValue]] = {
    "pattern": (
        r"^((19[7-9]\d|20\d\d)-(0[1-9]|1[0-2])-(0[1-9]|1\d|2[0-8])"
        r"(T([01]\d|2[0-3]):[0-5]\d(:[0-5]\d)?(Z|[+-](0\d|1[0-2]):00)?)?)?$"
    ),
    "examples": ["2026-11-21T10:00"],
}


class Wanted(BaseModel):
    """The filter as a form sends it; times are `2026-11-21T10:00`, in the server's zone where they
    have none of their own. `robot` is the id of the robot whose frame is around the page, `act`
    that of an act on an alarm, whose receipt is shown: they leave no entry out."""

    model_config = ConfigDict(extra="forbid")

    since: Annotated[str, Field(max_length=40, json_schema_extra=A_TIME)] = ""
    until: Annotated[str, Field(max_length=40, json_schema_extra=A_TIME)] = ""
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
            since=_ms("since", self.since),
            until=_ms("until", self.until, fold=1),
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
        acts={action: word(action) for action in (*CONTROL_ACTIONS, *ALARM_ACTIONS)},
        outcomes=OUTCOMES,
        off="" if state.log.enabled else say("log_off"),
        count=word("head", count=number(f"{head.count:,d}")) if head else "",
        older=wanted.query(rows[-1].entry.seq) if more else "",
        newest=wanted.query() if wanted.before else "",
        csv=wanted.query(),
    )
    frame, token = page_frame(request, state, say("log_page_title"), wanted.robot)
    html = state.templates.render(
        "log.html",
        language,
        **frame,
        **context,
        time_of=partial(time_of, language=language),
        iso_of=iso_of,
        values_of=partial(values_of, language=language),
        outcome_of=outcome_of,
        who_of=who_of,
        word=word,
        without_control=WITHOUT_CONTROL.code,
    )
    headers = {"cache-control": "no-store"}
    return set_client_cookie(HTMLResponse(html, headers=headers), request, token)


def page_frame(
    request: Request, state: AppState, title: Text, robot: str = "", alarms_query: str | None = None
) -> tuple[PageContext, str]:
    """The frame around the log or the alarms, of a robot or else the first; and the token of a new
    client."""
    entry_of = {session.entry.id: session for session in state.fleet.sessions if session.entry}
    session = entry_of.get(robot, state.fleet.first)
    who, token = principal_with_new_token(request, state, embedded=False)
    if session.control.rules.required:
        session.control.loaded(who, REFRESH_S, opened_by_person(request))
        session.show()
    shown = Page.model_construct(None, id=FRAME_ONLY, title=title, own=(), groups=())
    context = page_context(request, state, session, shown, who, REFRESH_S, alarms_query=alarms_query)
    return context, token


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
        return Exported(export, first, gzip, opened.pop_all())


class Exported(Response):
    """The response with an export, sent piece by piece. An export that fails, or that no client reads,
    is not terminated: no client takes it for complete."""

    media_type = "text/csv"

    def __init__(self, export: ReaderProcess, first: bytes, gzip: bool, opened: AsyncExitStack) -> None:
        """`opened` is closed when it is over."""
        name = f"operators-log-{datetime.now().strftime('%Y%m%d-%H%M%S')}.csv"
        headers = {"content-disposition": f'attachment; filename="{name}"', "cache-control": "no-store"}
        if gzip:
            headers |= {"content-encoding": "gzip", "vary": "accept-encoding"}
        self._export = export
        self._first = first
        self._opened = opened
        self.status_code = 200
        self.background = None
        self.init_headers(headers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async with self._opened, asyncio.TaskGroup() as group:
            going = group.create_task(self._gone(receive))
            try:
                await self._send(send, going)
            except TimeoutError:
                log.warning("an export of the operator's log was not taken for %g s", TAKEN_WITHIN_S)
            except LogError as error:
                if not going.done():
                    log.warning("an export of the operator's log broke off: %s", error)
            going.cancel()

    async def _send(self, send: Send, going: "asyncio.Task[None]") -> None:
        await _taken(send, {"type": START, "status": 200, "headers": self.raw_headers})
        piece = self._first
        while piece and not going.done():
            await _taken(send, {"type": BODY, "body": piece, "more_body": True})
            piece = await self._export.read_next()
        await self._opened.aclose()  # who has it whole may ask for the next
        await _taken(send, {"type": BODY, "body": b"", "more_body": False})

    async def _gone(self, receive: Receive) -> None:
        """Returns when the client has disconnected."""
        while (await receive())["type"] != "http.disconnect":
            pass
        self._export.kill()


async def _taken(send: Send, message: Message) -> None:
    """TimeoutError where no client takes it."""
    async with asyncio.timeout(TAKEN_WITHIN_S):
        await send(message)


def _shown(row: Row, language: str) -> Row:
    """With its texts as a page shows them, but its values: those are JSON still."""
    entry = row.entry._replace(reason=row.entry.reason_in(language))
    cells = (
        printable(cell) if isinstance(cell, str) and name != "values" else cell
        for name, cell in entry._asdict().items()
    )
    return replace(row, entry=Entry._make(cells))


def _ms(name: str, text: str, fold: int = 0) -> int | None:
    """`fold` is which of two times, where the clock shows a time twice: 1 for the later."""
    if not text:
        return None
    try:
        return int(datetime.fromisoformat(text).replace(fold=fold).timestamp() * 1000)
    except (ValueError, OverflowError, OSError):
        raise InputError(f'{name}: "{text}" is no time: it must be like 2026-11-21T10:00') from None
