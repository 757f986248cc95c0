"""The pages, rendered on the server from the same view that feeds the events."""

import secrets
import time
from typing import Any, TypedDict

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, Response

from app.errors import NotFound
from app.panel.model import Input, Page, Panel
from app.presses import Receipt
from app.routes.site import CurrentSite, Site
from app.sentences import clock, say
from app.views import View

router = APIRouter(include_in_schema=True)

# A page without scripts reloads itself, and loses what was typed and not sent: where there is an
# input, rarely enough to type in.
REFRESH_S = 5
REFRESH_WITH_INPUTS_S = 30


class PageContext(TypedDict):
    """What `screen.html` gets."""

    site: Site
    panel: Panel
    page: Page
    view: View
    event_id: str
    revision: str
    clock: str
    press_id: str
    receipt: Receipt | None
    inputs: dict[str, Any]
    words: dict[str, str]
    lost: str
    lost_short: str
    unknown: str
    unsure: str
    refresh_s: int


@router.get("/", response_class=HTMLResponse, summary="The first page of the panel")
async def first_page(request: Request, site: CurrentSite) -> Response:
    return _render(request, site, site.kiosk.panel.pages[0])


@router.get("/pages/{page}", response_class=HTMLResponse, summary="A page of the panel")
async def named_page(page: str, request: Request, site: CurrentSite) -> Response:
    found = site.kiosk.panel.page(page)
    if found is None:
        raise NotFound(f'there is no page "{page}"')
    return _render(request, site, found)


def _render(request: Request, site: Site, page: Page) -> Response:
    board = site.kiosk.board
    typed = any(isinstance(widget, Input) for widget in page.widgets)
    receipt = site.kiosk.presses.receipt(request.query_params.get("receipt", ""))
    context = PageContext(
        site=site,
        panel=site.kiosk.panel,
        page=page,
        view=board.view,
        event_id=board.id,
        revision=board.revision,
        clock=clock(time.time()),
        press_id=secrets.token_hex(8),
        receipt=receipt,
        inputs=dict(receipt.inputs) if receipt else {},
        words={"cancel": say("cancel"), "log": say("log_link")},
        lost=say("server_lost"),
        lost_short=say("lost"),
        unknown=say("unknown"),
        unsure=say("server_unsure"),
        refresh_s=REFRESH_WITH_INPUTS_S if typed else REFRESH_S,
    )
    html = site.templates.get_template("screen.html").render(**context)
    return HTMLResponse(html, headers={"cache-control": "no-store"})


@router.get("/static/{revision}/{name}", include_in_schema=False)
async def static(revision: str, name: str, site: CurrentSite) -> Response:
    asset = site.assets.files.get(name)
    if asset is None:
        raise NotFound(f'there is no file "{name}"')
    fits = revision == site.assets.revision
    caching = "public, max-age=31536000, immutable" if fits else "no-store"
    return Response(asset.content, media_type=asset.media_type, headers={"cache-control": caching})
