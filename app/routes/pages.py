"""The pages, rendered on the server from the same view that feeds the events."""

import secrets
import time
from typing import Any, TypedDict

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

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
    base: str
    robot: str
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
    if away := _to_a_robot(request, site, "/"):
        return away
    return _render(request, site, site.fleet.panel.pages[0])


@router.get("/pages/{page}", response_class=HTMLResponse, summary="A page of the panel")
async def named_page(page: str, request: Request, site: CurrentSite) -> Response:
    if away := _to_a_robot(request, site, f"/pages/{page}"):
        return away
    found = site.fleet.panel.page(page)
    if found is None:
        raise NotFound(f'there is no page "{page}"')
    return _render(request, site, found)


def _to_a_robot(request: Request, site: Site, path: str) -> Response | None:
    """Where there are several robots each page is of one: without a name, of the first."""
    first = site.fleet.first.base
    if not first or "robot" in request.path_params:
        return None
    return RedirectResponse(first + path, status_code=303)


def _render(request: Request, site: Site, page: Page) -> Response:
    kiosk = site.fleet.kiosk(request.path_params.get("robot"))
    board = kiosk.board
    typed = any(isinstance(widget, Input) for widget in page.widgets)
    receipt = kiosk.presses.receipt(request.query_params.get("receipt", ""))
    context = PageContext(
        site=site,
        panel=site.fleet.panel,
        page=page,
        base=kiosk.base,
        robot=kiosk.entry.id if kiosk.entry else "",
        view=board.view,
        event_id=board.id,
        revision=board.revision,
        clock=clock(time.time()),
        press_id=secrets.token_hex(8),
        receipt=receipt,
        inputs=dict(receipt.inputs) if receipt else {},
        words={
            "cancel": say("cancel"),
            "robots": say("robots"),
            "base": kiosk.base,
            "hold_cut": say("hold_cut"),
            "hold_scripts": say("hold_scripts"),
        },
        lost=say("server_lost"),
        lost_short=say("lost"),
        unknown=say("unknown"),
        unsure=say("server_unsure"),
        refresh_s=REFRESH_WITH_INPUTS_S if typed else REFRESH_S,
    )
    html = site.templates.get_template("screen.html").render(**context)
    return HTMLResponse(html, headers={"cache-control": "no-store"})
