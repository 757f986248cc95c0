"""The history of alarms as a page with a filter and figures, and as CSV; the figures as JSON."""

import json
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from itertools import groupby
from typing import Annotated, Any, Final, Literal, NamedTuple, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.alarms.figures import Figures, read_figures
from app.cell.alarms.history import NEWEST, HistoryFilter, HistoryPage, HistoryRow, read_page
from app.cell.alarms.records import text_of, written_limit, written_value
from app.cell.alarms.shown import PRIORITY_WORDS, STATE_WORDS
from app.cell.view.times import duration_text
from app.panel.model import Panel
from app.system.clock import format_time, iso_time
from app.system.printable import printable, printable_texts
from app.system.texts import Text, TextLike, joined, localized, number, say
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.downloads import exported
from app.web.pages.alarm_figures import FiguresAnswer, FiguresContext, figures_context, figures_json
from app.web.pages.alarms import word
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.log_words import day_name, who_of
from app.web.pages.log_words import word as log_word
from app.web.requests import TEXT, TypedTime, errors, parse_form_time

# Rows of the history of alarms as a page shows them.

EARLIER_S: Final = 1.0  # by so much a row before another is out of the order of times
EVENT_WORDS: Final = {
    "raised": "alarms_event_raised",
    "returned": "alarms_event_returned",
    "acknowledged": "alarms_event_acknowledged",
    "reset": "alarms_event_reset",
    "shelved": "alarms_event_shelved",
    "unshelved": "alarms_event_unshelved",
    "out_of_service": "alarms_event_out_of_service",
    "in_service": "alarms_event_in_service",
    "suppressed": "alarms_event_suppressed",
    "unsuppressed": "alarms_event_unsuppressed",
    "unknown": "alarms_event_unknown",
    "known": "alarms_event_known",
}
# With how long it lasted.
AFTER_WORDS: Final = {
    "returned": "alarms_event_returned_after",
    "acknowledged": "alarms_event_acknowledged_after",
}


class ShownEvent(NamedTuple):
    """A transition: `event` is what happened, `back` that the clock was set back before it, "" if it
    was not."""

    seq: int
    at: float
    time: Text
    iso: str
    id: str
    robot: str
    priority: int
    text: TextLike
    group: TextLike
    name: str
    event: TextLike
    back: TextLike


def shown_events(rows: Sequence[HistoryRow]) -> list[ShownEvent]:
    """Transitions, the newest first, in their order."""
    return [_shown(row, older) for row, older in zip(rows, [*rows[1:], None], strict=False)]


def events_by_day(events: Iterable[ShownEvent]) -> Iterator[tuple[Text, list[ShownEvent]]]:
    """The events of each day in turn, below its name."""
    for day, of_day in groupby(events, key=lambda event: datetime.fromtimestamp(event.at).date()):
        yield day_name(day), list(of_day)


def _shown(row: HistoryRow, older: HistoryRow | None) -> ShownEvent:
    record = json.loads(row.record)
    about = record.get("about", {})
    return ShownEvent(
        row.seq,
        row.at,
        format_time(row.at),
        iso_time(row.at),
        row.id,
        row.robot,
        row.priority,
        text_of(about.get("text", row.id)),
        text_of(about.get("group", "")),
        row.event,
        event_text(row, record),
        _back(row, older),
    )


def _back(row: HistoryRow, older: HistoryRow | None) -> TextLike:
    """That the clock was set back right before a row, or between it and the older one beside it."""
    back = row.clock_back_s or (older.at - row.at if older else 0.0)
    return say("alarms_clock_back", duration=duration_text(back)) if back >= EARLIER_S else ""


def event_text(row: HistoryRow, record: Mapping[str, Any]) -> TextLike:
    """What happened, with the value and the limit, who did it and why."""
    parts = [_event_word(row)]
    if row.event in ("raised", "changed"):
        limit = written_limit(record)
        parts += [written_value(record), say("alarms_event_limit", limit=limit) if limit else ""]
    if row.act:
        taken = record.get("out_of_service") or record.get("shelf") or {}
        parts += [who_of(printable(row.actor)), printable(taken.get("reason", ""))]
    return joined(parts, "between_names")


def _event_word(row: HistoryRow) -> TextLike:
    if row.event in AFTER_WORDS and row.lasted_s is not None:
        return say(AFTER_WORDS[row.event], duration=duration_text(row.lasted_s))
    if row.event in ("", "changed"):
        words = {str(state): word for state, (word, _) in STATE_WORDS.items()}
        return say(words[row.state]) if row.state in words else row.state
    return say(EVENT_WORDS[row.event]) if row.event in EVENT_WORDS else row.event


# The page of the history of alarms: its filter, its rows and the way to older ones.

DAY_S: Final = 86_400
ROWS_ON_PAGE: Final = 50
Span = Literal["24h", "7d", "30d", "all"]
SPAN_WORDS: Final[Mapping[Span, str]] = {
    "24h": "alarms_span_24h",
    "7d": "alarms_span_7d",
    "30d": "alarms_span_30d",
    "all": "alarms_span_all",
}
SPANS: Final[dict[Span, float]] = {"24h": DAY_S, "7d": 7 * DAY_S, "30d": 30 * DAY_S, "all": math.inf}


class TimesQuery(BaseModel):
    """A `span` up to now, or the time from `since` on and before `until` if one of these is there."""

    model_config = ConfigDict(extra="forbid")

    span: Span = "24h"
    since: TypedTime = ""
    until: TypedTime = ""

    def times(self, now: float) -> tuple[float, float]:
        """From when and to when, in seconds since the epoch; InputError for what is no time."""
        since = parse_form_time("since", self.since)
        until = parse_form_time("until", self.until, fold=1)
        if since is None and until is None:
            return now - SPANS[self.span], math.inf
        return (
            -math.inf if since is None else since / 1000,
            math.inf if until is None else until / 1000,
        )


class HistoryQuery(TimesQuery):
    """What the page shows: the transitions of a time, with `text` in the alarm's id, texts or group or
    in the name of who acted; of a `priority` (0: all), `group`, `robot` and `alarm`; before the number
    `before`. `act` is the id of an act whose receipt is shown."""

    text: Annotated[str, Field(max_length=100)] = ""
    priority: Annotated[int, Field(ge=0, le=4)] = 0
    group: Annotated[str, Field(max_length=400)] = ""
    robot: Annotated[str, Field(max_length=64)] = ""
    alarm: Annotated[str, Field(max_length=300)] = ""
    before: Annotated[int, Field(ge=1, lt=NEWEST)] | None = None
    act: Annotated[str, Field(max_length=400)] = ""

    def filter(self, now: float) -> HistoryFilter:
        return HistoryFilter(
            self.before or NEWEST,
            *self.times(now),
            self.text,
            self.alarm,
            self.priority,
            self.robot,
            self.group,
        )

    def address(self, **changed: str | int | None) -> str:
        """The same as the query of an address, with other values."""
        values = {**self.model_dump(exclude={"act"}), **changed}
        defaults = type(self).model_fields
        return urlencode({k: v for k, v in values.items() if v and v != defaults[k].default})


class HistoryContext(TypedDict):
    """The variables of `alarm-history.html`, beside those of the frame."""

    form: HistoryQuery
    typed: dict[str, str]
    has_times: bool
    spans: list[tuple[Text, str, bool]]
    priorities: list[Text]
    groups: list[tuple[str, TextLike]]
    robots: dict[str, TextLike]
    days: list[tuple[Text, list[ShownEvent]]]
    count: TextLike
    order: Text
    older: str
    newest: str
    query: str
    without_alarm: str
    of_time: FiguresContext
    address_of: Callable[[str], str]


def history_context(
    panel: Panel, form: HistoryQuery, shown: HistoryPage, figures: Figures
) -> HistoryContext:
    """The history as it is now."""
    rows = shown.rows[:ROWS_ON_PAGE]
    has_times = bool(form.since or form.until)
    newest = form.address(before=None)
    return HistoryContext(
        form=form,
        typed=printable_texts(form.model_dump()),
        has_times=has_times,
        spans=[
            (
                say(SPAN_WORDS[span]),
                form.address(span=span, since="", until="", before=None),
                span == form.span and not has_times,
            )
            for span in SPANS
        ],
        priorities=[say(code) for code in PRIORITY_WORDS[1:]],
        groups=_groups(panel),
        robots=panel.robot_names,
        days=list(events_by_day(shown_events(rows))),
        count=_count(shown, len(rows)),
        order=word("clock_was_set_back" if shown.set_back else "clock_never_set_back"),
        older=form.address(before=rows[-1].seq) if len(shown.rows) > ROWS_ON_PAGE else "",
        newest=newest,
        query=newest,
        without_alarm=form.address(before=None, alarm=""),
        of_time=figures_context(figures),
        address_of=lambda alarm: form.address(before=None, alarm=alarm),
    )


def _groups(panel: Panel) -> list[tuple[str, TextLike]]:
    """The groups of the panel's alarms: their texts in the panel's language, and in all."""
    return list({str(alarm.group): alarm.group for alarm in panel.alarms if alarm.group}.items())


def _count(shown: HistoryPage, rows: int) -> TextLike:
    if not rows:
        return ""
    first, last, total = (
        number(f"{value:,d}") for value in (shown.newer + 1, shown.newer + rows, shown.total)
    )
    return say("alarms_history_count", first=first, last=last, total=total)


def now() -> float:
    """Seconds since the epoch."""
    return time.time()


router = APIRouter()


@router.get(
    "/alarms/history",
    response_class=HTMLResponse,
    summary="The history of alarms, the newest first",
    responses=errors(403, 422, 429, 503),
)
async def page(
    request: Request, state: CurrentState, form: Annotated[HistoryQuery, Query()]
) -> Response:
    read = partial(read_page, wanted=form.filter(now()), limit=ROWS_ON_PAGE + 1)
    shown = await state.fleet.alarms.history.read(read)
    figures = await read_figures_of(state, *form.times(now()))
    context = history_context(state.fleet.panel, form, shown, figures)
    path = f"/alarms/history?{form.address()}"
    framed = FramedPage("alarm-history.html", word("history_title"), path, "alarms")
    return framed_page(request, state, framed, {**context, "word": word, "log_word": log_word})


async def read_figures_of(state: AppState, since: float, until: float) -> Figures:
    """The figures of a time; LogError, TooMany."""
    alarms = state.fleet.alarms
    delays = {alarm.definition.id: alarm.definition.delays for alarm in alarms.engine.alarms.values()}
    read = partial(read_figures, since=since, until=until, now=now(), delays=delays)
    return await alarms.history.read(read)


@router.get(
    "/alarms/figures",
    response_model=FiguresAnswer,
    summary="Figures of the history of alarms, after EEMUA 191",
    responses=errors(403, 422, 429, 503),
)
async def figures(
    request: Request, state: CurrentState, form: Annotated[TimesQuery, Query()]
) -> Response:
    of_time = await read_figures_of(state, *form.times(now()))
    content = localized(figures_json(of_time), caller_of(request).language)
    return JSONResponse(content, headers={"cache-control": "no-store"})


@router.get(
    "/alarms/history.csv",
    response_class=Response,
    summary="The history that the filter shows, as CSV",
    responses=errors(403, 422, 429, 503) | {200: {"content": {"text/csv": {"schema": TEXT}}}},
)
async def as_csv(
    request: Request, state: CurrentState, form: Annotated[HistoryQuery, Query()]
) -> Response:
    history = state.fleet.alarms.history
    wanted, language = form.filter(now()), caller_of(request).language
    return await exported(request, lambda gzip: history.export(wanted, gzip, language), "alarms")
