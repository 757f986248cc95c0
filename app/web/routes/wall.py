"""The page of a wall, and its events: what is in view, once a second."""

import asyncio
import json
from typing import Annotated, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response
from starlette.types import Receive, Scope, Send

from app.cell.site.cells import CellFilter, Shown
from app.cell.site.wall import Wall
from app.system.errors import NotFound
from app.system.texts import say
from app.web.app_state import AppState, CurrentState
from app.web.asgi import server_send
from app.web.caller import caller_of
from app.web.metrics import Open
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.wall import WallPage, query_of
from app.web.requests import PAGE, TEXT, Described, errors
from app.web.routes.events import HEADERS, MEDIA_TYPE, RECONNECT_MS

router = APIRouter()

TAB: Final = "wall"
REFRESH_S: Final = 5  # of a page without scripts
PAGES: Described = errors(403, 404, 422) | {200: {"content": PAGE}}
Name = Annotated[str, Query(max_length=64)]
CellId = Annotated[str, Query(pattern="^(c[0-9a-f]{10})?$")]


@router.get("/", response_class=HTMLResponse, summary="The cells of a wall", responses=PAGES)
async def first_page(
    request: Request, state: CurrentState, show: Shown = "all", site: Name = "", text: Name = ""
) -> Response:
    """`show`: those that are greyed out are "abnormal" (all that run), or have no alarm. `site` and
    `text` choose the cells that are listed."""
    wall, chosen = _wall(state), CellFilter(show, site, text)
    page = WallPage(wall, state.templates, caller_of(request).language, chosen, state.root)
    query = query_of(chosen)
    path = f"/?{query}" if query else "/"
    context = page.context() | {
        "sites": [*page.sites()],
        "tile_html": page.tile,
        "order": wall.table.order,
        "wall_query": query,
        "wall_refresh_s": REFRESH_S,
    }
    framed = FramedPage("wall.html", say("wall_title"), path, TAB)
    return framed_page(request, state, framed, {"wall": context})


@router.get("/pages/{page}", response_class=HTMLResponse, summary="The same", responses=PAGES)
async def named_page(page: str, request: Request, state: CurrentState) -> Response:
    if page != TAB:
        raise NotFound(say("page_missing", page=page[:64]))
    return await first_page(request, state)


@router.get(
    "/wall/events",
    response_class=Response,
    responses=errors(403, 404, 422) | {200: {"content": {MEDIA_TYPE: {"schema": TEXT}}}},
    summary="Server-sent events of a wall: `cells`, with the HTML of what has changed in view",
)
async def wall_events(
    request: Request,
    state: CurrentState,
    show: Shown = "all",
    site: Name = "",
    text: Name = "",
    first: CellId = "",
    last: CellId = "",
) -> Response:
    """`first` and `last` are the ids of the cells between which the page shows some now."""
    chosen = CellFilter(show, site, text)
    page = WallPage(_wall(state), state.templates, caller_of(request).language, chosen, state.root)
    return WallStream(_wall(state), page, state.metrics.streams, first, last)


def _wall(state: AppState) -> Wall:
    assert state.wall is not None  # these routes are those of a wall only
    return state.wall


class WallStream(Response):
    """The events of one page, until it disconnects. While the browser does not read, nothing is made
    for it; then it gets what is newest."""

    media_type = MEDIA_TYPE

    def __init__(self, wall: Wall, page: WallPage, streams: Open, first: str, last: str) -> None:
        self._wall, self._page, self._streams = wall, page, streams
        self._range = first, last
        self._parts: dict[str, str] = {}
        self._versions: dict[str, int] = {}
        self._ages: dict[str, str] = {}
        self._order = -1
        self._seen = -1
        self.status_code = 200
        self.background = None
        self.init_headers(HEADERS)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": self.raw_headers})
        with self._streams.another():
            async with asyncio.TaskGroup() as group:
                writing = group.create_task(self._write(server_send(scope, send)))
                while (await receive())["type"] != "http.disconnect":
                    pass
                writing.cancel()

    async def _write(self, send: Send) -> None:
        chunk = f"retry: {RECONNECT_MS}\n\n".encode()
        while not self._wall.closed:
            if chunk := chunk + self._event():
                await send({"type": "http.response.body", "body": chunk, "more_body": True})
            chunk = b""
            await self._wall.next_tick()
        await send({"type": "http.response.body", "body": b"", "more_body": False})

    def _event(self) -> bytes:
        """What has changed since the last one; b"" for nothing."""
        table, changed = self._wall.table, dict[str, object]()
        cells = self._page.in_view(*self._range)
        connected = int(self._wall.is_connected)
        if self._seen != (seen := table.version * 2 + connected):
            self._seen = seen
            tiles = {c.id: self._page.tile(c) for c in cells if self._versions.get(c.id) != c.version}
            self._versions |= {cell.id: cell.version for cell in cells}
            parts = self._page.parts()
            new = {name: html for name, html in parts.items() if self._parts.get(name) != html}
            self._parts = parts
            changed |= {"tiles": tiles} if tiles else {}
            changed |= {"parts": new} if new else {}
        ages = self._page.ages(cells)
        told = {name: age for name, age in ages.items() if self._ages.get(name) != age}
        self._ages = ages
        changed |= {"ages": told} if told else {}
        if self._order != table.order:
            self._order = table.order
            changed["order"] = table.order
        if not changed:
            return b""
        data = json.dumps(changed, ensure_ascii=False, separators=(",", ":"))
        return f"event: cells\ndata: {data}\n\n".encode()
