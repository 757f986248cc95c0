"""The context of `frame.html`, the frame around every page."""

import secrets
import time
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any, Final, TypedDict
from urllib.parse import urlencode

from fastapi import Request
from markupsafe import Markup

from app import clock
from app.clock import format_datetime, format_day, format_time, iso_time
from app.commands.control_acts import TOO_OFTEN
from app.commands.receipts import Receipt
from app.i18n import Text, TextLike, say
from app.panel.layout import FRAME_ONLY, Page
from app.panel.model import Panel
from app.permission.principal import Principal
from app.permission.role_locks import role_reason, unmet
from app.printable import printable_texts
from app.robot.command_status import GOOD_OUTCOMES
from app.roles import OPERATOR
from app.runtime.robot_session import RobotSession
from app.view.audience import audience, audience_of
from app.view.result_age import BAD_S, GOOD_S
from app.view.sections import SECTIONS, Section
from app.view.view import View
from app.web.alarm_runs import command_text
from app.web.app_state import AppState
from app.web.assets import PICTURES
from app.web.embedding import QUERY as EMBED
from app.web.embedding import only_shows
from app.web.language import language_of
from app.web.rendering.alarm_sheet import sheet_words
from app.web.rendering.display_choice import (
    Choice,
    DisplaySettings,
    choices,
    display_of,
    language_choice,
)
from app.web.rendering.page_data import confirmed_commands, page_json, panel_data
from app.web.rendering.page_words import page_words
from app.web.rendering.sign_in_words import SignedIn, signed_in

TOO_SOON: Final = say("press_too_soon")
RELOADED: Final = "reloaded"  # by itself, without a tap
RELOADED_S: Final = 2.0  # after the time to reload, a page is an old one: a press on it is refused


class PageContext(TypedDict):
    """The variables of `frame.html` and `screen.html`."""

    site: AppState
    display: DisplaySettings
    choices: Sequence[Choice]
    panel: Panel
    tabs: Sequence[Page]
    page: Page
    railed: bool
    is_log: bool
    is_alarms: bool
    is_diagnostics: bool
    is_help: bool
    is_recipes: bool
    inside: Markup | None
    base: str
    robot: str
    view: View
    sections: Sequence[Section]
    event_id: str
    clock: Text
    day: Text
    clock_at: str
    loaded: Text
    press_id: str
    receipt: Receipt | None
    inputs: dict[str, Any]
    words: dict[str, Any]
    page_json: Markup
    refresh_s: int
    since: float | None
    again: str
    until: float
    browser: str
    refused: TextLike
    back: str
    alarm_refused: TextLike
    own_path: str
    me: SignedIn
    confirms: bool


def page_context(
    request: Request,
    state: AppState,
    session: RobotSession,
    page: Page,
    who: Principal,
    refresh_s: int,
    embedded: bool = False,
    alarms_page: str | None = None,
    diagnostics_query: str | None = None,
    is_help: bool = False,
    recipes_page: str | None = None,
    own_path: str = "",
) -> PageContext:
    """The context of a page for one request, but `inside`, which the page's own template renders.
    `alarms_page`: the path and query of a page of the alarms, for such a page; `diagnostics_query`: the
    query of the page of diagnostics, for that page; `is_help`: it is the page of help;
    `recipes_page` as `alarms_page`, for recipes; `own_path`: the path of a page like that of sign-in.
    `embedded`: it is for a frame of another page."""
    publisher, rules = session.publisher, session.control.rules
    receipt = _faded(state.fleet.receipt(session, request.query_params.get("receipt", "")))
    again = {RELOADED: 1} | ({"receipt": receipt.id} if receipt else {})
    again |= {EMBED: 1} if embedded else {}
    now, wall = clock.server_now(), time.time()
    panel, language = state.fleet.panel, language_of(request)
    lacks = unmet(panel.needs.named, who)
    no_role = OPERATOR in lacks
    if only_shows(session.panel.embed, embedded):
        of_client = audience("embedded", language, lacks=lacks)
    else:
        others = publisher.shared.controls
        of_client = audience_of(
            who, publisher.view["control"], rules, language, others, panel.needs.named
        )
    display = display_of(request, panel)
    embed = f"?{EMBED}=1" if embedded else ""
    is_alarms, is_diagnostics = alarms_page is not None, diagnostics_query is not None
    is_recipes = recipes_page is not None
    is_other = is_alarms or is_diagnostics or is_help or is_recipes or bool(own_path)
    is_log = page.id == FRAME_ONLY and not is_other
    back = f"{state.root}/log" if is_log else f"{session.base}/pages/{page.id}"
    if is_diagnostics:
        back = f"{state.root}/diagnostics?{diagnostics_query}"
    if is_help:
        back = f"{state.root}/help"
    if is_recipes:
        back = f"{session.base}/{recipes_page}"
    if own_path:
        back = f"{state.root}{own_path}"
    data = {
        **panel_data(panel, page, state.assets.scripts),
        "base": session.base,
        "embed": embed,
        "revision": publisher.revision,
        "seen": publisher.id,
        "now": round(now * 1000),
        "sounds": display.sounds == "on",
    }
    return PageContext(
        site=state,
        display=display,
        choices=[*language_choice(panel, language), *choices(display)],
        panel=panel,
        tabs=[other for other in panel.pages if who.meets(other.needs or "")],
        page=page,
        railed=panel.has_rail or page.id == FRAME_ONLY,
        is_log=is_log,
        is_alarms=is_alarms,
        is_diagnostics=is_diagnostics,
        is_help=is_help,
        is_recipes=is_recipes,
        own_path=own_path,
        me=signed_in(state, who),
        confirms=bool(confirmed_commands(panel, page)),
        inside=None,
        base=session.base,
        robot=session.entry.id if session.entry else "",
        view=publisher.for_audience(of_client),
        sections=SECTIONS,
        event_id=publisher.id,
        clock=format_time(wall),
        day=format_day(wall),
        clock_at=iso_time(wall),
        loaded=format_datetime(wall),
        press_id=secrets.token_hex(8),
        receipt=receipt,
        inputs=dict(receipt.entered) | printable_texts(receipt.entered) if receipt else {},
        words={"embed": embed, "root": state.root, "may_act": of_client.has_control and not no_role}
        | page_words(
            state.fleet,
            session,
            page,
            f"{state.root}/static/{state.assets.revision}/{PICTURES}",
            language,
        )
        | sheet_words(who)
        | ({"alarm_needs_control": role_reason(OPERATOR)} if no_role else {}),
        page_json=page_json(data, language),
        refresh_s=refresh_s,
        since=None if RELOADED in request.query_params else round(now, 3),
        again=f"{session.base}/pages/{page.id}?{urlencode(again)}",
        until=round(now + refresh_s + RELOADED_S, 3),
        browser=who.client.id,
        refused=_refused(session, request.query_params.get("control", "")),
        back=f"{state.root}/{alarms_page}" if is_alarms else back,
        alarm_refused=_alarm_refused(state, request.query_params.get("act", "")),
    )


def _faded(receipt: Receipt | None) -> Receipt | None:
    """The receipt, without its sentence once that is too old to be shown."""
    if receipt is None:
        return None
    age_s = time.time() - datetime.fromisoformat(receipt.at).timestamp()
    kept_s = GOOD_S if receipt.outcome in GOOD_OUTCOMES else BAD_S
    return receipt if age_s < kept_s else replace(receipt, reason="")


def _refused(session: RobotSession, query: str) -> TextLike:
    """Why an act on control was refused: `query` is its id, or the code where it is not kept."""
    if query == TOO_OFTEN.code:
        return TOO_OFTEN
    receipt = session.control_acts.receipt(query)
    return receipt.reason if receipt else ""


def _alarm_refused(state: AppState, query: str) -> TextLike:
    """What the receipt of an act on alarms says: `query` is its id, or the code where it is not
    kept."""
    if query in (TOO_OFTEN.code, TOO_SOON.code):
        return say(query)
    for session in state.fleet.sessions:
        if receipt := session.alarm_acts.receipt(query):
            return command_text(session, query) or receipt.reason
    return ""
