"""The operator's log, to read, to filter and to take away as CSV."""

import csv
import io
import json
from collections.abc import AsyncIterator
from dataclasses import replace
from datetime import UTC, datetime
from typing import Annotated, Final, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Query
from fastapi.responses import HTMLResponse, Response, StreamingResponse
from pydantic import BaseModel, ConfigDict, Field

from app.errors import InputError, NotFound
from app.log import Entry, Filter, OperatorLog, Row
from app.panel.model import Hold, Input, Panel, Pressed
from app.panel.parameter import Parameter
from app.printable import printable, printable_texts
from app.routes.site import CurrentSite, Site
from app.sentences import say

router = APIRouter()

ROWS_ON_PAGE: Final = 50
ROWS_AT_ONCE: Final = 500
OUTCOMES: Final = (
    "published", "confirmed", "accepted", "succeeded", "rejected", "canceled", "aborted", "timed_out",
    "refused", "unknown", "pressed", "began", "resumed", "removed",
)  # fmt: skip
# What a spreadsheet would take as a formula.
FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
CSV_FIELDS: Final = (
    "seq", "at", "boot", "monotonic", "kind", "of", "pressed_at", "address", "browser", "who", "robot",
    "press", "widget", "action", "values", "seen", "verdict", "board", "outcome", "reason", "prev",
    "hash",
)  # fmt: skip


class Wanted(BaseModel):
    """The filter as a form sends it; times are `2026-11-21T10:00`, in the server's zone where they
    have none of their own."""

    model_config = ConfigDict(extra="forbid")

    since: Annotated[str, Field(max_length=40)] = ""
    until: Annotated[str, Field(max_length=40)] = ""
    widget: Annotated[str, Field(max_length=64)] = ""
    outcome: Annotated[str, Field(max_length=20)] = ""
    who: Annotated[str, Field(max_length=64)] = ""
    text: Annotated[str, Field(max_length=100)] = ""
    every: bool = False
    before: Annotated[int, Field(ge=1, lt=2**63)] | None = None

    def filter(self) -> Filter:
        """Raises InputError for what is no time."""
        return Filter(
            since=_ms("since", self.since),
            until=_ms("until", self.until),
            **self.model_dump(include={"widget", "outcome", "who", "text", "every"}),
        )

    def query(self, before: int | None = None) -> str:
        """The same filter as the query of an address."""
        given = {k: v for k, v in self.model_dump(exclude={"before"}).items() if v}
        if before is not None:
            given["before"] = before
        return urlencode(given)


class LogContext(TypedDict):
    """What `log.html` gets."""

    site: Site
    panel: Panel
    wanted: Wanted
    typed: dict[str, str]
    rows: list[Row]
    labels: dict[str, str]
    inputs: dict[str, str]
    outcomes: tuple[str, ...]
    off: str
    banner: str
    fault: str
    older: str
    newest: str
    csv: str


@router.get("/log", response_class=HTMLResponse, summary="The operator's log, the newest first")
async def page(site: CurrentSite, wanted: Annotated[Wanted, Query()]) -> Response:
    rows: list[Row] = []
    if isinstance(site.log, OperatorLog):
        rows = await site.log.rows(wanted.filter(), wanted.before, ROWS_ON_PAGE + 1)
    more = len(rows) > ROWS_ON_PAGE
    rows = [_shown(row) for row in rows[:ROWS_ON_PAGE]]
    panel = site.fleet.panel
    context = LogContext(
        site=site,
        panel=panel,
        wanted=wanted,
        typed=printable_texts(wanted.model_dump()),
        rows=rows,
        labels={w.id: w.label for w in panel.widgets() if isinstance(w, Pressed | Hold)},
        inputs={w.id: w.label for w in panel.widgets() if isinstance(w, Input | Parameter)},
        outcomes=OUTCOMES,
        off="" if site.log.enabled else say("log_off"),
        banner=site.banner,
        fault=site.log.fault,
        older=wanted.query(rows[-1].entry.seq) if more else "",
        newest=wanted.query() if wanted.before else "",
        csv=wanted.query(),
    )
    html = site.templates.get_template("log.html").render(
        **context, clock_of=_clock_of, values_of=_values_of, word=_word
    )
    return HTMLResponse(html, headers={"cache-control": "no-store"})


@router.get(
    "/log.csv",
    response_class=Response,
    summary="What the filter shows, as CSV",
    responses={200: {"content": {"text/csv": {}}}},
)
async def as_csv(site: CurrentSite, wanted: Annotated[Wanted, Query()]) -> Response:
    if not isinstance(site.log, OperatorLog):
        raise NotFound(say("log_off"))
    first = await site.log.rows(wanted.filter(), wanted.before, ROWS_AT_ONCE)
    name = f"operators-log-{datetime.now().strftime('%Y%m%d-%H%M%S')}.csv"
    headers = {"content-disposition": f'attachment; filename="{name}"', "cache-control": "no-store"}
    lines = _lines(site.log, wanted.filter(), first)
    return StreamingResponse(lines, media_type="text/csv; charset=utf-8", headers=headers)


async def _lines(log: OperatorLog, wanted: Filter, rows: list[Row]) -> AsyncIterator[bytes]:
    """RFC 4180 with a byte order mark, some rows at a time; nothing is open in between."""
    yield "\ufeff".encode() + _csv([CSV_FIELDS])
    while rows:
        yield _csv([_cells(row) for row in rows])
        if len(rows) < ROWS_AT_ONCE:
            break
        rows = await log.rows(wanted, rows[-1].entry.seq, ROWS_AT_ONCE)


def _cells(row: Row) -> tuple[str, ...]:
    return tuple(_cell(name, row) for name in CSV_FIELDS)


def _cell(name: str, row: Row) -> str:
    value = row.pressed_at if name == "pressed_at" else getattr(row.entry, name)
    if value is None:
        return ""
    if name in ("at", "pressed_at"):
        return _time(value).astimezone(UTC).isoformat(timespec="milliseconds")
    text = printable(str(value))
    return f"'{text}" if text.startswith(FORMULA) else text


def _csv(lines: list[tuple[str, ...]]) -> bytes:
    text = io.StringIO()
    csv.writer(text).writerows(lines)
    return text.getvalue().encode()


def _time(ms: int) -> datetime:
    return datetime.fromtimestamp(ms // 1000).replace(microsecond=ms % 1000 * 1000).astimezone()


def _clock_of(ms: int) -> str:
    return _time(ms).strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]


def _word(name: str, **about: object) -> str:
    return say(f"log_page_{name}", **about)


def _shown(row: Row) -> Row:
    """With its texts as a page shows them, but its values: those are JSON still."""
    cells = (
        printable(cell) if isinstance(cell, str) and name != "values" else cell
        for name, cell in row.entry._asdict().items()
    )
    return replace(row, entry=Entry._make(cells))


def _values_of(text: str) -> list[tuple[str, str]]:
    """The values of an entry as (name, text), but those that are empty."""
    return [
        (
            printable(name),
            printable(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)),
        )
        for name, value in json.loads(text).items()
        if value != ""
    ]


def _ms(name: str, given: str) -> int | None:
    if not given:
        return None
    try:
        return int(datetime.fromisoformat(given).timestamp() * 1000)
    except (ValueError, OverflowError, OSError):
        raise InputError(f'{name}: "{given}" is no time: it must be like 2026-11-21T10:00') from None
