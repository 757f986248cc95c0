"""A press as a form, for a browser without scripts: the answer is the page again, with the receipt."""

import math
import re
import secrets
from typing import Final, NamedTuple
from urllib.parse import quote

from fastapi.responses import HTMLResponse, RedirectResponse, Response

from app import clock
from app.commands.press_context import PRESS_ID
from app.errors import InputError
from app.i18n import say
from app.panel.layout import Page
from app.permission.principal import Principal
from app.printable import printable_texts
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState
from app.web.rendering.display_choice import Display
from app.web.rendering.page_words import ask_of


class Reader(NamedTuple):
    """The language and the display choices of a browser."""

    language: str
    display: Display


CONFIRMED: Final = "_confirmed"  # a form's field: the server has asked, and this is the yes
TAP_AGAIN_S: Final = 0.7  # as the page's scripts have it
QUESTION_LIFE_S: Final = 30.0  # the answer is a press, and no later one


async def pressed_by_form(
    state: AppState,
    session: RobotSession,
    who: Principal,
    widget: str,
    inputs: dict[str, str],
    reader: Reader,
) -> Response:
    """The response to a press: a redirect to the page with its receipt, or the question before the
    press."""
    too_soon, before = _is_second_tap(inputs), inputs.pop("_last", "")
    shown_on = inputs.pop("_page", "")
    asks = session.presses.widget(widget).confirm_press
    if asks and (inputs.pop(CONFIRMED, "") != "yes" or too_soon):
        return _ask(state, session, widget, inputs, reader, shown_on)
    # One rendered page has one id for all its buttons, and each button is a press of its own.
    page_id = inputs.pop("_id", secrets.token_hex(8))
    if not re.fullmatch(PRESS_ID, page_id):
        raise InputError(f'_id: "{page_id:.40}" is not the id of a press')
    press_id = f"{page_id}.{widget}"
    seen, until = inputs.pop("_seen", ""), _until(inputs)
    typed = session.dispatcher.parse_form(inputs, _language(state, inputs, reader))
    if not state.limits.admit(who):
        receipt = session.presses.early_refusals.limited(widget, typed, press_id, shown=True)
        return RedirectResponse(page_after(session, widget, receipt.id, shown_on), status_code=303)
    by = session.press_guard.context_for(widget, who, seen, until)
    if too_soon:
        work = session.presses.early_refusals.too_soon(widget, typed, press_id, before, by.origin)
    else:
        work = session.presses.press(widget, typed, press_id, by)
    receipt = await state.counted(work)
    return RedirectResponse(page_after(session, widget, receipt.id, shown_on), status_code=303)


def _ask(
    state: AppState,
    session: RobotSession,
    widget: str,
    inputs: dict[str, str],
    reader: Reader,
    shown_on: str,
) -> Response:
    """The page that asks before a press; its answer is the press."""
    pressed = session.presses.widget(widget)
    html = state.templates.render(
        "ask.html",
        reader.language,
        site=state,
        display=reader.display,
        panel=session.panel,
        banner=session.publisher.view["notice"]["banner"],
        question=ask_of(session, pressed),
        action=f"{session.base}/widgets/{widget}",
        back=page_after(session, widget, "", shown_on),
        fields={
            **inputs,
            "_page": shown_on,
            CONFIRMED: "yes",
            "_seen": session.publisher.id,
            "_until": str(round(clock.server_now() + QUESTION_LIFE_S, 3)),
            "_since": str(round(clock.server_now(), 3)),
        },
        entries=printable_texts(inputs),
        no=say("back"),
        empty=say("empty"),
        label=pressed.label,
    )
    return HTMLResponse(html, headers={"cache-control": "no-store"})


def _page_of(session: RobotSession, widget: str, shown_on: str) -> Page:
    """The page of a widget; of one in the frame the page that it was `shown_on`, else the first."""
    panel = session.panel
    if any(one.id == widget for one in panel.frame.widgets):
        return panel.page(shown_on) or panel.pages[0]
    return next(page for page in panel.pages if any(one.id == widget for one in page.widgets))


def _until(inputs: dict[str, str]) -> float | None:
    """When a page without scripts should have reloaded, if that is over, else now.

    It can't say when it was pressed, but a page that does not reload itself is none to press on.
    """
    until = _moment(inputs, "_until")
    return until if until is None else min(until, clock.server_now())


def _language(state: AppState, inputs: dict[str, str], reader: Reader) -> str:
    """The language of the page whose form this is: another page of the browser may have changed its
    language since. A program's form has the language of its request."""
    language = inputs.pop("_language", reader.language)
    panel = state.fleet.panel
    if language not in (*panel.readers_languages, panel.language):
        raise InputError(f'_language: "{language:.40}" is not a language of this panel')
    return language


def _is_second_tap(inputs: dict[str, str]) -> bool:
    """Whether a page without scripts is pressed sooner than anyone reads it: by the second tap of what
    brought it. Scripts tell by themselves; a page that loaded itself was not tapped for."""
    shown_at = _moment(inputs, "_since")
    return shown_at is not None and clock.server_now() - shown_at < TAP_AGAIN_S


def _moment(inputs: dict[str, str], name: str) -> float | None:
    given = inputs.pop(name, None)
    if given is None:
        return None
    try:
        moment = float(given)
    except ValueError:
        moment = math.nan
    if not math.isfinite(moment):
        raise InputError(f'{name}: "{given:.40}" is not that of a page')
    return moment


def page_after(session: RobotSession, widget: str, receipt_id: str, shown_on: str = "") -> str:
    """The path of a widget's page, with a receipt if there is one; `shown_on` is the page's id where
    it was pressed, "" if unknown."""
    page = f"{session.base}/pages/{_page_of(session, widget, shown_on).id}"
    return f"{page}?receipt={quote(receipt_id)}" if receipt_id else page
