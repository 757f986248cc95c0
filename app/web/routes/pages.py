"""The pages, rendered on the server from the same view that feeds the events."""

import asyncio

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from jinja2 import Environment

from app.panel.layout import Page
from app.panel.robot_panels import page_for
from app.panel.widgets.families import EntryWidget
from app.system.errors import NotFound
from app.system.texts import say
from app.web.app_state import AppState, CurrentState
from app.web.assets import EDITOR
from app.web.caller import QUERY, caller_of, frame_ancestors, only_shows, says_embedded
from app.web.pages.compiled_templates import template_names
from app.web.pages.context import page_context, reader_of
from app.web.requests import PAGE, Described, errors
from app.web.route_needs import check_page
from app.web.security import POLICY, content_security_policy

router = APIRouter(include_in_schema=True)

PAGES: Described = errors(403, 404, 422) | {
    200: {"content": PAGE},
    303: {"description": "to the same page of the first of several robots"},
}

# A page without scripts reloads itself, and loses what was typed and not sent: where there is an
# input, rarely enough to type in.
REFRESH_S = 5
REFRESH_WITH_INPUTS_S = 30
# A page without scripts counts as gone when it has not reloaded this long after its time.
GRACE_S = 5
# Templates are compiled this long after the start, while the link settles; else the first page takes
# that time. One at a time, so that the event loop runs in between.
COMPILED_AFTER_S = 0.1
OTHER_PAGES = (
    "ask.html",
    "_confirm.html",
    "error.html",
    "gallery.html",
    "log.html",
    "help.html",
    "signin.html",
    "users.html",
    "recipes.html",
    "places.html",
    "alarms.html",
    "alarm-confirm.html",
    "alarm-history.html",
    "alarm-report.html",
    "stops.html",
    "stop.html",
    "oee.html",
    "diagnostics.html",
    "_diagnostics.html",
    "_look.html",
    "wall.html",
    "manual.html",
    "stop-paper.html",
    "proof.html",
)


@router.get(
    "/",
    response_class=HTMLResponse,
    summary="The first page of the panel",
    responses=PAGES,
)
async def first_page(request: Request, state: CurrentState) -> Response:
    if away := _to_a_robot(request, state, "/"):
        return away
    panel, who = state.fleet.panel, caller_of(request).principal
    seen = next((page for page in panel.pages if who.meets(page.needs or "")), panel.pages[0])
    return _render(request, state, page_for(panel, request.path_params.get("robot"), seen))


@router.get(
    "/pages/{page}",
    response_class=HTMLResponse,
    summary="A page of the panel",
    responses=PAGES,
)
async def named_page(page: str, request: Request, state: CurrentState) -> Response:
    if away := _to_a_robot(request, state, f"/pages/{page}"):
        return away
    shown = state.fleet.panel.page(page)
    if shown is None:
        raise NotFound(say("page_missing", page=page[:64]))
    return _render(request, state, shown)


def is_of_a_page(name: str) -> bool:
    """Whether a file of the templates' folder is a template of a panel's pages."""
    is_editors = name.startswith(f"{EDITOR}/")
    return name.endswith(".html") and name not in OTHER_PAGES and not is_editors


async def compiled(templates: Environment) -> None:
    """Compiles the templates of a page, so that the first page is as quick as the next."""
    await asyncio.sleep(COMPILED_AFTER_S)
    for name in template_names(templates, is_of_a_page):
        templates.get_template(name)
        await asyncio.sleep(0)


def _to_a_robot(request: Request, state: AppState, path: str) -> Response | None:
    """The redirect to the first robot's page, for a path without a robot on a panel with several."""
    first = state.fleet.first
    if first.entry is None or "robot" in request.path_params:
        return None
    return RedirectResponse(first.base + path, status_code=303)


def _render(request: Request, state: AppState, page: Page) -> Response:
    session = state.fleet.session(request.path_params.get("robot"))
    if session.entry is not None and page.robot not in (None, session.entry.id):
        path = f"{state.fleet.session(page.robot).base}/pages/{page.id}"
        return RedirectResponse(f"{path}?{request.url.query}".rstrip("?"), status_code=303)
    rules = session.panel.embed
    caller = caller_of(request)
    embedded = bool(rules.origins) and caller.embedded
    if embedded and not says_embedded(request.url.query):
        again = request.url.include_query_params(**{QUERY: 1})
        return RedirectResponse(f"{again.path}?{again.query}", status_code=303)
    typed = any(isinstance(widget, EntryWidget) for widget in page.widgets)
    refresh_s = REFRESH_WITH_INPUTS_S if typed else REFRESH_S
    who, token = caller.identified(embedded)
    check_page(page, who)
    if session.control.rules.required and not embedded:
        session.control.loaded(who, refresh_s + GRACE_S, caller.opened_by_person)
        session.show()
    context = page_context(state, session, page, reader_of(request, who, embedded), refresh_s)
    html = state.templates.screen(page, caller.language, context)
    forms = "'none'" if only_shows(rules, embedded) else "'self'"
    policy = content_security_policy(frame_ancestors(rules, embedded), forms)
    headers = {"cache-control": "no-store", POLICY: policy}
    return caller.with_client_cookie(HTMLResponse(html, headers=headers), token)
