"""For monitoring: `/healthz`, `/readyz` and `/metrics`."""

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Final

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from pydantic import BaseModel

from app.cell.alarms.report import shift_at
from app.cell.session.fleet import Fleet
from app.system.errors import LogError, TooMany
from app.system.texts import render
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.metrics import Metrics
from app.web.requests import errors

if TYPE_CHECKING:
    from app.cell.site.wall import Wall

router = APIRouter()

SHIFT_EVERY_S: Final = 30.0  # at most the figures of the shift are read


@router.get("/healthz", summary="200 while the process serves", responses=errors(403))
async def healthz() -> dict[str, str]:
    return {"status": "ok"}


class NotReady(BaseModel):
    """`code` is the reason's stable name; of several robots each has its own in `robots`."""

    status: str
    code: str
    reason: str
    robots: dict[str, str] = {}


@router.get(
    "/readyz",
    summary="200 while commands can reach every robot, else 503 with the reason",
    responses=errors(403)
    | {
        200: {"model": dict[str, str], "description": "commands can reach every robot"},
        503: {"model": NotReady, "description": "they can't"},
    },
)
async def readyz(request: Request, state: CurrentState) -> Response:
    if state.wall is not None:
        return _of_wall(request, state.wall)
    sessions = state.fleet.sessions
    ways = await asyncio.gather(*(session.check_readiness() for session in sessions))
    way = next((way for way in ways if not way.permitted), None)
    if way is None:
        return JSONResponse({"status": "ready"})
    reason = render(way.reason or "", caller_of(request).language)
    body: dict[str, object] = {"status": "not ready", "code": way.code, "reason": reason}
    robots = {k.entry.id: w.code for k, w in zip(sessions, ways, strict=True) if k.entry}
    return JSONResponse(body | ({"robots": robots} if robots else {}), status_code=503)


def _of_wall(request: Request, wall: "Wall") -> Response:
    """Whether the wall reaches a router."""
    if wall.is_connected:
        return JSONResponse({"status": "ready"})
    reason = render(wall.state, caller_of(request).language)
    body = {"status": "not ready", "code": "wall_no_router", "reason": reason}
    return JSONResponse(body, status_code=503)


@router.get(
    "/metrics",
    summary="Prometheus text format",
    response_class=PlainTextResponse,
    responses=errors(403) | {200: {"description": "the metrics"}},
)
async def metrics(state: CurrentState) -> Response:
    exposition = await asyncio.to_thread(_exposition)
    fleet = state.metrics.fleet
    if fleet is not None and fleet.panel.oee is not None:
        await _read_shift(state, fleet)
    text, media_type = exposition(state.metrics)
    return Response(text, media_type=media_type)


async def _read_shift(state: AppState, fleet: Fleet) -> None:
    """Reads the figures of the shift, at most each half minute; none where they can't be read."""
    from app.cell.session.stops import figures_of

    metrics, now = state.metrics, time.time()
    if abs(now - metrics.shift_at) < SHIFT_EVERY_S:
        return
    metrics.shift_at, metrics.shift = now, {}
    since = shift_at(now, fleet.panel.alarm_rules.shifts).since
    with suppress(LogError, TooMany):
        metrics.shift = await figures_of(fleet, state.log, fleet.sessions, since, now)


def _exposition() -> Callable[[Metrics], tuple[bytes, str]]:
    """Loaded at the first request, on a thread: it is slow to load, and rarely needed."""
    from app.web.prometheus import exposition

    return exposition
