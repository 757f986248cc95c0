"""The history of a trend's pens, thinned to columns without losing a peak."""

import asyncio
import gzip
import json
import time
from collections.abc import Iterator, Sequence
from typing import Annotated, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response
from pydantic import BaseModel, Field

from app.errors import InputError
from app.panel.widgets.trend import Trend
from app.robot.history import Column
from app.view.trend_plot import pen_columns, shown_offset
from app.web.app_state import CurrentSession
from app.web.openapi_parts import JSON, errors

router = APIRouter()

SHORTEST_S: Final = 1.0
PACKED_BYTES: Final = 4_000

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
    return await _packed(text.encode(), "gzip" in request.headers.get("accept-encoding", ""))


async def _packed(body: bytes, gzipped: bool) -> Response:
    """The answer; what is long is packed in a thread, quickly."""
    headers = {"cache-control": "no-store", "vary": "accept-encoding"}
    if gzipped and len(body) > PACKED_BYTES:
        body = await asyncio.to_thread(gzip.compress, body, 1)
        headers["content-encoding"] = "gzip"
    return Response(body, media_type=JSON, headers=headers)


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
