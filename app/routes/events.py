"""The event stream: a snapshot first, then changes, and a heartbeat that never stops."""

import time
from collections.abc import AsyncIterator
from typing import Final

from fastapi import APIRouter, Request
from fastapi.responses import Response
from fastapi.sse import EventSourceResponse

from app.board import Board, beat, told
from app.routes.site import CurrentKiosk, CurrentSite, Site
from app.routes.visitors import keep, welcomed

router = APIRouter()

BEAT_S: Final = 0.5  # a page locks itself after 1.75 s without any event
RECONNECT_MS: Final = 500

HEADERS: Final = {"cache-control": "no-store", "x-accel-buffering": "no"}


@router.get(
    "/events",
    response_class=Response,
    responses={200: {"content": {"text/event-stream": {}}}},
    summary="Server-sent events: snapshot, <interlock>-enabled-updated, update, link, control, beat",
)
async def events(
    request: Request, site: CurrentSite, kiosk: CurrentKiosk, once: bool = False
) -> Response:
    """`once`: the snapshot alone, for a browser that has no stream to spare."""
    board = kiosk.board
    browser, token = welcomed(request, site) if board.view["control"]["required"] else (None, "")
    first = told(browser.id) if browser else b""
    if once:
        all_of_it = board.snapshot() + first + beat()
        answer = Response(all_of_it, media_type="text/event-stream", headers=HEADERS)
    else:
        answer = EventSourceResponse(_counted(site, board, first), headers=HEADERS)
    return keep(answer, request, token)


async def _counted(site: Site, board: Board, first: bytes) -> AsyncIterator[bytes]:
    with site.metrics.streams.track_inprogress():
        async for chunk in stream(board, first):
            yield chunk


async def stream(board: Board, first: bytes = b"") -> AsyncIterator[bytes]:
    """What one browser gets; `first` comes with the snapshot. It waits while the browser does not
    read, and then skips to now."""
    version, view = board.version, board.view
    yield f"retry: {RECONNECT_MS}\n\n".encode() + board.snapshot() + first + beat()
    next_beat = time.monotonic() + BEAT_S
    while not board.closed:
        await board.newer(version, next_beat - time.monotonic())
        if board.version > version:
            chunk = board.since(version, view)
            version, view = board.version, board.view
            yield chunk
        if not board.closed and time.monotonic() >= next_beat:
            next_beat = time.monotonic() + BEAT_S
            yield beat()
