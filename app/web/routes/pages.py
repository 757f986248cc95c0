"""The pages, rendered on the server from the same view that feeds the events."""

import asyncio
import secrets
import time
from collections.abc import Sequence
from typing import Any, TypedDict
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from jinja2 import Environment
from markupsafe import Markup

from app import clock
from app.clock import format_datetime, format_time
from app.commands.receipts import Receipt
from app.errors import NotFound
from app.i18n import Text, TextLike, say
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.template import input_ids
from app.panel.widgets.families import EntryWidget, PressCommand
from app.panel.widgets.log_view import LogView
from app.panel.widgets.trend import Trend
from app.permission.control_authority_view import role
from app.permission.principal import Principal
from app.printable import printable_texts
from app.runtime.robot_session import RobotSession
from app.view.sections import SECTIONS, Section
from app.view.trend_plot import Plot, plot
from app.view.view import View
from app.web.app_state import AppState, CurrentState
from app.web.assets import PICTURES
from app.web.client_cookie import opened_by_person, principal_with_new_token, set_client_cookie
from app.web.display_choice import Choice, Display, choices, display_of, language_choice
from app.web.entry_words import ENTRY_WORDS
from app.web.language import language_of
from app.web.openapi_parts import PAGE, Described, errors
from app.web.routes.log_lines import WORDS as LEVEL_WORDS
from app.web.routes.log_lines import rendered

router = APIRouter(include_in_schema=True)

PAGES: Described = errors(403, 404, 422) | {
    200: {"content": PAGE},
    303: {"description": "to the same page of the first of several robots"},
}

# A page without scripts reloads itself, and loses what was typed and not sent: where there is an
# input, rarely enough to type in.
REFRESH_S = 5
REFRESH_WITH_INPUTS_S = 30
RELOADED = "reloaded"  # by itself, without a tap
RELOADED_S = 2.0  # a press on a page that should have reloaded before is one on an old page
# How long after a page without scripts was due it is still thought to be there.
GRACE_S = 5
TOO_OFTEN = "control_too_often"
WORDS = (
    "menu",
    "whole",
    "phone",
    "cancel",
    "robots",
    "control",
    "set",
    "read_again",
    "back",
    "empty",
    "hold_cut",
    "hold_scripts",
    "camera_none",
    "camera_late",
    "camera_undrawn",
    "rosout_level",
    "rosout_node",
    "rosout_search",
    "rosout_pause",
    *(word.code for word in LEVEL_WORDS.values()),
    "clean",
    "cleaning",
)
TREND_WORDS = (
    "trend_earlier",
    "trend_later",
    "trend_longer",
    "trend_shorter",
    "trend_pause",
    "trend_live",
    "trend_paused",
)
LINK_WORDS = ("links", "link_state", "link_since", "link_locks")
CONTROL_ACTS = ("take", "ask", "give", "keep", "release", "withdraw")

# Templates are compiled this long after the start, while the link settles; else the first page takes
# that time. One at a time, so that the event loop runs in between.
COMPILED_AFTER_S = 0.1
OTHER_PAGES = ("ask.html", "error.html", "gallery.html", "log.html")


class PageContext(TypedDict):
    """What `screen.html` gets."""

    site: AppState
    display: Display
    choices: Sequence[Choice]
    panel: Panel
    page: Page
    inside: Markup | None
    base: str
    robot: str
    view: View
    sections: Sequence[Section]
    event_id: str
    revision: str
    clock: Text
    loaded: Text
    press_id: str
    receipt: Receipt | None
    inputs: dict[str, Any]
    words: dict[str, Any]
    lost: Text
    lost_short: Text
    locks_all: Text
    unknown: Text
    unsure: Text
    refresh_s: int
    now: int
    since: float | None
    again: str
    until: float
    browser: str
    refused: TextLike


@router.get(
    "/",
    response_class=HTMLResponse,
    summary="The first page of the panel",
    responses=PAGES,
)
async def first_page(request: Request, state: CurrentState) -> Response:
    if away := _to_a_robot(request, state, "/"):
        return away
    return _render(request, state, state.fleet.panel.pages[0])


@router.get(
    "/pages/{page}",
    response_class=HTMLResponse,
    summary="A page of the panel",
    responses=PAGES,
)
async def named_page(page: str, request: Request, state: CurrentState) -> Response:
    if away := _to_a_robot(request, state, f"/pages/{page}"):
        return away
    found = state.fleet.panel.page(page)
    if found is None:
        raise NotFound(say("page_missing", page=page[:64]))
    return _render(request, state, found)


async def compiled(templates: Environment) -> None:
    """Makes the first page as quick as the next."""
    await asyncio.sleep(COMPILED_AFTER_S)
    for name in templates.list_templates(filter_func=lambda name: name not in OTHER_PAGES):
        templates.get_template(name)
        await asyncio.sleep(0)


class Ask(TypedDict):
    """What will be done by a press, and the inputs that it takes."""

    sentence: Text
    inputs: list[EntryWidget]


def _to_a_robot(request: Request, state: AppState, path: str) -> Response | None:
    """Where there are several robots each page is of one: without a name, of the first."""
    first = state.fleet.first.base
    if not first or "robot" in request.path_params:
        return None
    return RedirectResponse(first + path, status_code=303)


def _render(request: Request, state: AppState, page: Page) -> Response:
    session = state.fleet.session(request.path_params.get("robot"))
    typed = any(isinstance(widget, EntryWidget) for widget in page.widgets)
    refresh_s = REFRESH_WITH_INPUTS_S if typed else REFRESH_S
    who, token = principal_with_new_token(request, state)
    if session.control.rules.required:
        session.control.loaded(who, refresh_s + GRACE_S, opened_by_person(request))
        session.show()
    context, language = _context(request, state, session, page, who, refresh_s), language_of(request)
    widgets = {name: context[name] for name in ("view", "inputs", "receipt", "words")}
    pictures = state.fleet.panel.picture_files
    context["inside"] = state.templates.inside(page, pictures, language, **widgets)
    html = state.templates.render("screen.html", language, **context)
    return set_client_cookie(HTMLResponse(html, headers={"cache-control": "no-store"}), request, token)


def _context(
    request: Request, state: AppState, session: RobotSession, page: Page, who: Principal, refresh_s: int
) -> PageContext:
    publisher, rules = session.publisher, session.control.rules
    receipt = session.presses.receipt(request.query_params.get("receipt", ""))
    again = {RELOADED: 1} | ({"receipt": receipt.id} if receipt else {})
    now, wall = clock.server_now(), time.time()
    display = display_of(request, state.fleet.panel)
    return PageContext(
        site=state,
        display=display,
        choices=[*language_choice(state.fleet.panel, language_of(request)), *choices(display)],
        panel=state.fleet.panel,
        page=page,
        inside=None,
        base=session.base,
        robot=session.entry.id if session.entry else "",
        view=publisher.for_role(role(publisher.view["control"], who, rules)),
        sections=SECTIONS,
        event_id=publisher.id,
        revision=publisher.revision,
        clock=format_time(wall),
        loaded=format_datetime(wall),
        press_id=secrets.token_hex(8),
        receipt=receipt,
        inputs=dict(receipt.entered) | printable_texts(receipt.entered) if receipt else {},
        words=_words(
            session,
            page,
            f"/static/{state.assets.revision}/{PICTURES}",
            language_of(request),
        ),
        lost=say("server_lost"),
        lost_short=say("lost"),
        locks_all=say("locks_all"),
        unknown=say("unknown"),
        unsure=say("server_unsure"),
        refresh_s=refresh_s,
        now=round(now * 1000),
        since=None if RELOADED in request.query_params else round(now, 3),
        again=f"{session.base}/pages/{page.id}?{urlencode(again)}",
        until=round(now + refresh_s + RELOADED_S, 3),
        browser=who.client.id,
        refused=_refused(session, request.query_params.get("control", "")),
    )


def _refused(session: RobotSession, query: str) -> TextLike:
    """Why an act on control was refused: `query` is its id, or the code where it is not kept."""
    if query == TOO_OFTEN:
        return say(TOO_OFTEN)
    receipt = session.control_acts.receipt(query)
    return receipt.reason if receipt else ""


def _words(session: RobotSession, page: Page, pictures: str, language: str) -> dict[str, Any]:
    """The words of a page by their names in its templates, and what it asks before a press."""
    own = {"base": session.base, "pictures": pictures, "log": say("log_link")}
    own |= {"asks": asks_of(session, page), "trends": trends_on(session, page)}
    own |= {
        "lines": {w.id: rendered(session, w, language) for w in page.widgets if isinstance(w, LogView)}
    }
    plain = {word: say(word) for word in (*WORDS, *LINK_WORDS, *ENTRY_WORDS, *TREND_WORDS)}
    return own | plain | {act: say(f"control_{act}") for act in CONTROL_ACTS}


def trends_on(session: RobotSession, page: Page) -> dict[str, Plot]:
    """The plots of the trends of a page, by the ids of their widgets."""
    now, wall = time.monotonic(), time.time()
    shown = (widget for widget in page.widgets if isinstance(widget, Trend))
    return {widget.id: plot(widget, session.robot, now, wall) for widget in shown}


def asks_of(session: RobotSession, page: Page) -> dict[str, Ask]:
    """The questions before presses of a page, by the widgets that need one."""
    shown = (*page.widgets, *session.panel.frame.widgets)
    pressed = (w for w in shown if isinstance(w, PressCommand) and w.confirm_press)
    return {widget.id: ask_of(session, widget) for widget in pressed}


def ask_of(session: RobotSession, widget: PressCommand) -> Ask:
    """With the robot's name, where there are several."""
    inputs = {w.id: w for w in session.panel.widgets() if isinstance(w, EntryWidget)}
    robot = session.entry.name if session.entry else ""
    sentence = say("ask_on" if robot else "ask", label=widget.label, robot=robot)
    return Ask(sentence=sentence, inputs=[inputs[name] for name in input_ids(widget)])
