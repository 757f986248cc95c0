"""The context of a page: the frame around it, and what its scripts read when they start."""

import json
import secrets
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any, Final, NamedTuple, TypedDict
from urllib.parse import urlencode

from fastapi import Request
from fastapi.responses import HTMLResponse, Response
from markupsafe import Markup

from app.cell.commands.alarm_acts import press_id_of, sentence_of
from app.cell.commands.receipts import Receipt
from app.cell.permission.roles import role_reason, unmet
from app.cell.session.session import RobotSession
from app.cell.view.publisher import SECTIONS, Section
from app.cell.view.times import BAD_S, GOOD_S
from app.cell.view.view import View, audience, audience_of
from app.panel.frame_keys import FrameKey, frame_keys
from app.panel.layout import FRAME_OF_ALL, FRAME_ONLY, FRAMES, Page
from app.panel.model import Panel
from app.panel.roles import MAINTENANCE, OPERATOR
from app.panel.widgets.families import BaseWidget, Command
from app.panel.widgets.key_parts import confirmation_of
from app.records.entry import GOOD_OUTCOMES
from app.records.principal import Principal
from app.system import clock
from app.system.clock import format_datetime, format_day, format_time, iso_time
from app.system.printable import printable_texts
from app.system.texts import Text, TextLike, localized, say
from app.web.acts import said_of
from app.web.app_state import AppState
from app.web.assets import PICTURES
from app.web.caller import QUERY as EMBED
from app.web.caller import caller_of, only_shows
from app.web.pages.alarms import sheet_words
from app.web.pages.display_choice import (
    Choice,
    DisplaySettings,
    choices,
    language_choice,
)
from app.web.pages.sign_in import SignedIn, signed_in
from app.web.pages.words import page_words

# What the scripts of a page read when they start: one block of JSON in its markup.

# The sentences that the browser shows by itself, by their names in the scripts.
SENTENCES: Final = {
    "lost": say("server_lost"),
    "lostShort": say("lost"),
    "locksAll": say("locks_all"),
    "unknown": say("unknown"),
    "unsure": say("server_no_response"),
    "broken": say("widget_failed"),
    "unsent": say("page_press_not_sent"),
    "faulty": say("page_incomplete"),
    "tooOld": say("browser_too_old"),
    "stateUnknown": say("state_unknown"),
}
ESCAPED: Final = str.maketrans({sign: f"\\u{ord(sign):04x}" for sign in "<>&"})


def panel_data(panel: Panel, page: Page, scripts: Mapping[str, str]) -> Mapping[str, Any]:
    """What a page has from the panel file; `scripts` has the script of each kind of widgets that has
    one."""
    kinds = dict.fromkeys(widget.kind for widget in (*page.widgets, *panel.frame.widgets))
    return {
        "page": page.id,
        "keyboard": panel.keyboard,
        "dimAfterS": panel.screen.dim_after_s,
        "sections": [section.name for section in SECTIONS if section.on_page],
        "confirms": [widget.id for widget in confirmed_commands(panel, page)],
        "kinds": {kind: scripts[kind] for kind in kinds if kind in scripts},
    }


def confirmed_commands(panel: Panel, page: Page) -> list[Command]:
    """The commands that a page may press and that a person confirms."""
    shown = (*page.widgets, *panel.frame.widgets, *panel.recipe_loads)
    return [w for w in shown if isinstance(w, Command) and confirmation_of(w)]


def locked_without_scripts(view: View, panel: Panel, page: Page) -> View:
    """The view as a page shows it until its scripts have started: what a person confirms with a PIN,
    and the loads of recipes, are locked."""
    confirmed = {
        command.id: say("confirm_needs_javascript") for command in confirmed_commands(panel, page)
    }
    reasons = confirmed | {load.id: say("recipes_need_javascript") for load in panel.recipe_loads}
    widgets = view["widgets"]
    locked = {
        name: {**widgets[name], "enabled": False, "reason": reason}
        for name, reason in reasons.items()
        if widgets.get(name, {}).get("enabled")
    }
    return {**view, "widgets": {**widgets, **locked}} if locked else view


def page_json(data: Mapping[str, Any], language: str) -> Markup:
    """`data` and the sentences as JSON for a `script` element that is not executed."""
    text = json.dumps(
        localized({**data, "sentences": SENTENCES}, language), ensure_ascii=False, separators=(",", ":")
    )
    return Markup(text.translate(ESCAPED))


# The context of `frame.html`, the frame around every page.

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
    tab: str
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
    me: SignedIn
    confirms: bool
    frame_keys: Sequence[FrameKey]
    good_outcomes: Collection[str]
    wall_now: Mapping[str, Any]
    machine_notes: Sequence[TextLike]


class Reader(NamedTuple):
    """For whom a page is rendered, and the query of its address. `embedded`: it is for a frame of
    another page. `as_shown`: it only shows what a page whose scripts run had shown."""

    who: Principal
    language: str
    display: DisplaySettings
    query: Mapping[str, str] = {}
    embedded: bool = False
    as_shown: bool = False


def reader_of(request: Request, who: Principal, embedded: bool = False) -> Reader:
    caller = caller_of(request)
    return Reader(who, caller.language, caller.display, request.query_params, embedded)


def page_context(
    state: AppState,
    session: RobotSession,
    page: Page,
    reader: Reader,
    refresh_s: int,
    framed: "FramedPage | None" = None,
) -> PageContext:
    """The context of a page for one reader, but `inside`, which the page's own template renders.
    `framed`: it is none of the panel's own."""
    who, language, display, query, embedded, as_shown = reader
    publisher, rules = session.publisher, session.control.rules
    receipt = _faded(state.fleet.receipt(session, query.get("receipt", "")))
    again = {RELOADED: 1} | ({"receipt": receipt.id} if receipt else {})
    again |= {EMBED: 1} if embedded else {}
    now, wall = clock.server_now(), time.time()
    panel = state.fleet.panel
    lacks = unmet(panel.needs.named, who)
    no_role = OPERATOR in lacks
    if only_shows(session.panel.embed, embedded):
        of_client = audience("embedded", language, lacks=lacks)
    else:
        others = publisher.shared.controls
        of_client = audience_of(
            who, publisher.view["control"], rules, language, others, panel.needs.named
        )
    with publisher.watching(publisher.shown_page(page.id)):
        view = publisher.for_audience(of_client)
    if not as_shown:
        view = locked_without_scripts(view, panel, page)
    embed = f"?{EMBED}=1" if embedded else ""
    back = f"{session.base}/pages/{page.id}"
    if framed:
        back = f"{session.base if framed.tab in ('recipes', 'places') else state.root}{framed.path}"
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
        railed=panel.has_rail or page.id in FRAMES,
        tab=framed.tab if framed else "",
        me=signed_in(state, who),
        confirms=bool(confirmed_commands(panel, page)),
        frame_keys=[*frame_keys(panel, session.entry.id if session.entry else None, page.id)],
        good_outcomes=GOOD_OUTCOMES,
        wall_now=_wall_now(state),
        machine_notes=_machine_notes(state, who),
        inside=None,
        base=session.base,
        robot=session.entry.id if session.entry else "",
        view=view,
        sections=SECTIONS,
        event_id=publisher.id,
        clock=format_time(wall),
        day=format_day(wall),
        clock_at=iso_time(wall),
        loaded=format_datetime(wall),
        press_id=secrets.token_hex(8),
        receipt=receipt,
        inputs=dict(receipt.entered) | printable_texts(receipt.entered) if receipt else {},
        words={
            "embed": embed,
            "root": state.root,
            "as_shown": as_shown,
            "may_act": of_client.has_control and not no_role,
            "no_role": no_role,
        }
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
        since=None if RELOADED in query else round(now, 3),
        again=f"{session.base}/pages/{page.id}?{urlencode(again)}",
        until=round(now + refresh_s + RELOADED_S, 3),
        browser=who.client.id,
        refused=said_of(query.get("control", ""), [session.control_acts]),
        back=back,
        alarm_refused=_alarm_refused(state, query.get("act", "")),
    )


def _wall_now(state: AppState) -> Mapping[str, Any]:
    """What the header of a wall's pages shows of its cells. Imported only there."""
    if state.wall is None:
        return {}
    from app.web.pages.wall import header_of

    return header_of(state.wall)


def _machine_notes(state: AppState, who: Principal) -> Sequence[TextLike]:
    """What those who maintain the panel are told of its PC. Imported only where it is watched."""
    if state.fleet.machine is None or not who.meets(MAINTENANCE):
        return ()
    from app.cell.view.machine_status import machine_notes

    return [*machine_notes(state.fleet.machine.now, time.time())]


def _faded(receipt: Receipt | None) -> Receipt | None:
    """The receipt, without its sentence once that is too old to be shown."""
    if receipt is None:
        return None
    age_s = time.time() - datetime.fromisoformat(receipt.at).timestamp()
    kept_s = GOOD_S if receipt.outcome in GOOD_OUTCOMES else BAD_S
    return receipt if age_s < kept_s else replace(receipt, reason="")


def _alarm_refused(state: AppState, query: str) -> TextLike:
    """What the receipt of an act on alarms says, and its command."""
    sessions = state.fleet.sessions
    for session in sessions:
        if session.alarm_acts.receipt(query) and (said := command_text(session, query)):
            return said
    return said_of(query, [session.alarm_acts for session in sessions])


# A page that is none of the panel's own, such as the operator's log, in the frame of the panel.

REFRESH_S: Final = 10  # a page without scripts counts as gone when it has not been loaded for so long


class FramedPage(NamedTuple):
    """`path` is the path and query of the page, below that of its robot for recipes and places. `tab`
    is the part of the panel whose scripts and style it has: "alarms", "diagnostics", "log", "places",
    "recipes", "" for another. `robot` is the id of the robot whose frame is around the page, "" for
    that of all, which has the state of the first. `entries` is what is entered on it. `status` is that
    of the answer, such as 404."""

    template: str
    title: Text
    path: str
    tab: str = ""
    robot: str = ""
    entries: Sequence[BaseWidget] = ()
    status: int = 200


def framed_page(
    request: Request, state: AppState, page: FramedPage, context: Mapping[str, Any]
) -> Response:
    """The page with the variables `context`, in the language of the request."""
    session = state.fleet.of_robot(page.robot)
    caller = caller_of(request)
    who, token = caller.identified()
    if session.control.rules.required:
        session.control.loaded(who, REFRESH_S, caller.opened_by_person)
        session.show()
    own, page_id = tuple(page.entries), FRAME_ONLY if page.robot else FRAME_OF_ALL
    frame = page_context(
        state,
        session,
        Page.model_construct(None, id=page_id, title=page.title, own=own, groups=()),
        reader_of(request, who),
        REFRESH_S,
        page,
    )
    html = state.templates.render(page.template, caller.language, **frame, **context)
    headers = {"cache-control": "no-store", "vary": "accept"}
    return caller.with_client_cookie(HTMLResponse(html, page.status, headers), token)


def command_text(session: RobotSession, act_id: str) -> TextLike:
    """What became of the command of an earlier act; "" if it had none."""
    receipt = session.presses.receipt(press_id_of(act_id))
    if receipt is None:
        return ""
    return sentence_of(session.presses.widget(receipt.widget).label, receipt)
