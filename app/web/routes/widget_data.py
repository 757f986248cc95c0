"""What a browser requests of a widget beside events: the history of a trend, and the lines of a log."""

import asyncio
import json
import time
from collections.abc import Iterator, Sequence
from typing import Annotated, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response
from pydantic import BaseModel, Field

from app.cell.robot.history import Column
from app.cell.view.trend import pen_columns, shown_offset
from app.panel.widgets.displays import Level, LogView
from app.panel.widgets.trend import Trend
from app.system.errors import InputError
from app.system.texts import render, say
from app.web.app_state import CurrentSession
from app.web.caller import caller_of
from app.web.large_answers import packed_answer
from app.web.pages.log_lines import line_values, wanted_lines
from app.web.requests import errors

# The history of a trend's pens, thinned to columns without losing a peak.

router = APIRouter()

SHORTEST_S: Final = 1.0

Number = Annotated[int, Field(description="its time is the number times `width_s`, since the epoch")]
Value = float


class TrendAnswer(BaseModel):
    """The columns of each pen from `since` on. A column is `[number, value]`, or `[number, lowest,
    highest, last]` where it has several values; `null` stands before one that does not continue the
    one before: no line is drawn there."""

    end: Annotated[float, Field(description="the end of the time, in seconds since the epoch")]
    now: Annotated[float, Field(description="the server's clock")]
    width_s: Annotated[float, Field(description="the time of a column: `span_s / points`")]
    shift: Annotated[float, Field(description="differs when the clock was set: ask for all again")]
    zone_s: Annotated[int, Field(description="the server's time zone at the end, east of UTC")]
    offset: Annotated[
        str,
        Field(description='the same as "+01:00", if the clock was changed within it; else ""'),
    ]
    pens: list[list[tuple[Number, Value] | tuple[Number, Value, Value, Value] | None]]


@router.get(
    "/widgets/{widget}/trend",
    response_model=TrendAnswer,
    summary="Read the history of a trend",
    responses=errors(403, 404, 422),
)
async def trend(
    widget: str,
    request: Request,
    session: CurrentSession,
    span_s: Annotated[float, Query(ge=SHORTEST_S, allow_inf_nan=False, description="how long")],
    end: Annotated[
        float | None,
        Query(ge=0, le=1e11, description="in seconds since the epoch; without it, now"),
    ] = None,
    points: Annotated[int, Query(ge=10, le=1000, description="how many columns")] = 300,
    since: Annotated[int, Query(ge=0, le=2**53, description="the first column that is asked for")] = 0,
) -> Response:
    trend = session.panel.widget(widget, Trend)
    if span_s > trend.keep_s:
        raise InputError(f"span_s is {span_s:g}: this trend keeps {trend.keep_s} s")
    now = time.time()
    history = session.robot.history
    history.set_clock(time.monotonic(), now)
    until = now if end is None else min(end, now)
    width = span_s / points
    begin = max(until - span_s, since * width)
    about = {
        "end": round(until, 3),
        "now": round(now, 3),
        "width_s": width,
        "shift": round(history.shift, 3),
        "zone_s": time.localtime(until).tm_gmtoff,
        "offset": shown_offset(until - span_s, until),
    }
    pens = []
    for pen in trend.pens:
        columns = pen_columns(session.robot, pen, begin, until, width)
        pens.append(json.dumps(list(_compact(columns)), separators=(",", ":")))
        await asyncio.sleep(0)  # each pen takes some milliseconds
    text = json.dumps(about, separators=(",", ":")).removesuffix("}") + f',"pens":[{",".join(pens)}]}}'
    return await packed_answer(request, text.encode())


def _compact(columns: Sequence[Column]) -> Iterator[list[float] | None]:
    for column in columns:
        if column.gap:
            yield None
        if column.low == column.high:
            yield [column.number, _short(column.last)]
        else:
            yield [column.number, _short(column.low), _short(column.high), _short(column.last)]


def _short(value: float) -> float:
    """Seven digits: more than a screen shows."""
    return float(f"{value:.7g}")


# The lines of a log: each browser asks for those that it shows, while it shows them.

Text = Annotated[str, Query(max_length=100)]


class LogLine(BaseModel):
    """`level` is ROS 2's word for it, `word` that of the reader's language."""

    number: int
    time: str
    at: Annotated[str, Field(description="the same as ISO 8601, with milliseconds and offset")]
    level: Level
    word: str
    node: str
    text: str


class Lines(BaseModel):
    """The newest last. `left_out`: so many more fit, or are not kept any more."""

    lines: list[LogLine]
    left_out: int
    note: str
    last: int


@router.get(
    "/widgets/{widget}/lines",
    response_model=Lines,
    summary="The newest lines of a log, those after a number, of a level, a node, with a text",
    responses=errors(403, 404, 422),
)
async def lines(
    widget: str,
    request: Request,
    session: CurrentSession,
    level: Level | None = None,
    node: Text = "",
    search: Text = "",
    after: Annotated[int, Query(ge=0)] = 0,
) -> Lines:
    view = session.panel.widget(widget, LogView)
    language = caller_of(request).language
    wanted = wanted_lines(session.panel, view, language, level, node, search)
    kept = session.robot.log_lines[session.robot.key(view.topic)]
    result = await kept.find(wanted, after, view.lines)
    note = render(say("rosout_left_out", number=result.left_out), language) if result.left_out else ""
    shown = [
        LogLine.model_validate(line_values(*line, wanted.translate, language)) for line in result.lines
    ]
    return Lines(lines=shown, left_out=result.left_out, note=note, last=result.last)
