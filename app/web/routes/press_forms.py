"""A press as a form, for a browser without scripts: the answer is the page again, with the receipt."""

import math
import re
import secrets
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final
from urllib.parse import quote

from fastapi.responses import HTMLResponse, RedirectResponse, Response

from app import clock
from app.commands.press import PRESS_ID, Press
from app.errors import InputError
from app.i18n import TextLike, say
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.widgets.families import PressCommand
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.switch import Switch
from app.printable import printable_texts
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState
from app.web.rendering.recipe_ask import question_before
from app.web.routes.confirm_forms import PressForm, confirmed_by_form

CONFIRMED: Final = "_confirmed"  # a form's field: the server has asked, and this is the yes
TAP_AGAIN_S: Final = 0.7  # as the page's scripts have it
QUESTION_LIFE_S: Final = 30.0  # the answer is a press, and no later one


async def pressed_by_form(
    state: AppState, page: RobotSession, session: RobotSession, form: PressForm
) -> Response:
    """The response to a press: a redirect to the page with its receipt, or the question before the
    press. `session` is that of the widget's robot, `page` that of the robot whose page it was."""
    fields, refusals = form.fields, session.presses.early_refusals
    too_soon, before = _is_second_tap(fields), fields.pop("_last", "")
    shown_on = fields.pop("_page", "")
    by, answered = None, fields.pop(CONFIRMED, "") == "yes" and not too_soon
    if form.widget.confirmation and form.principal.user:
        by, sheet = await confirmed_by_form(state, session, form, too_soon)
        if by is None:
            return _ask(state, page, session, form, shown_on, sheet)
    elif form.widget.asks and not answered:
        return _ask(state, page, session, form, shown_on, {})
    press = replace(_press_of(state, session, form), confirmed=by)
    if not state.limits.admit(press.principal):
        receipt = refusals.limited(press, shown=True)
    else:
        session.press_guard.receive(press)
        work = refusals.too_soon(press, before) if too_soon else session.presses.press(press)
        receipt = await state.counted(work)
    path = page_after(state, page, press.widget.id, receipt.id, shown_on)
    return RedirectResponse(path, status_code=303)


def _press_of(state: AppState, session: RobotSession, form: PressForm) -> Press[PressCommand]:
    """The press of a form. One rendered page has one id for all its buttons, and each button is a press
    of its own."""
    fields, widget = form.fields, form.widget
    page_id = fields.pop("_id", secrets.token_hex(8))
    if not re.fullmatch(PRESS_ID, page_id):
        raise InputError(f'_id: "{page_id:.40}" is not the id of a press')
    seen, until = fields.pop("_seen", ""), _until(fields)
    language = _language(state, form)
    inputs = session.dispatcher.parse_form(fields, language)
    return Press(f"{page_id}.{widget.id}", widget, inputs, form.principal, seen, until)


def _ask(
    state: AppState,
    page: RobotSession,
    session: RobotSession,
    form: PressForm,
    shown_on: str,
    sheet: Mapping[str, Any],
) -> Response:
    """The page that asks before a press; its answer is the press. `sheet` is that of a person who
    confirms it."""
    widget = form.widget
    question = question_before(state.fleet, session, widget, form.fields.get(widget.id, ""))
    html = state.templates.render(
        "ask.html",
        form.reader.language,
        site=state,
        display=form.reader.display,
        panel=state.fleet.panel,
        banner=session.publisher.view["notice"]["banner"],
        **({} if sheet else {"question": question}),
        action=f"{page.base}/widgets/{widget.id}",
        back=page_after(state, page, widget.id, "", shown_on),
        fields={
            **form.fields,
            "_page": shown_on,
            CONFIRMED: "yes",
            "_seen": page.publisher.id,
            "_until": str(round(clock.server_now() + QUESTION_LIFE_S, 3)),
            "_since": str(round(clock.server_now(), 3)),
        },
        entries=printable_texts(form.fields),
        no=say("back"),
        empty=say("empty"),
        label=_label(form),
        **sheet,
    )
    return HTMLResponse(html, headers={"cache-control": "no-store"})


def _label(form: PressForm) -> TextLike:
    """The label of the button that was touched."""
    widget = form.widget
    if isinstance(widget, Switch):
        return widget.on if form.fields.get(widget.id) == "true" else widget.off
    if isinstance(widget, RecipeLoad):
        return say("recipes_load")
    return widget.label


def _page_of(panel: Panel, widget: str, shown_on: str) -> Page:
    """The page of a widget that it was `shown_on`, else the first with it; one in the frame is on every
    page."""
    pressed_on = panel.page(shown_on)
    if any(shown.id == widget for shown in panel.frame.widgets):
        return pressed_on or panel.pages[0]
    if pressed_on and any(shown.id == widget for shown in pressed_on.widgets):
        return pressed_on
    return next(page for page in panel.pages if any(shown.id == widget for shown in page.widgets))


def _until(fields: dict[str, str]) -> float | None:
    """When a page without scripts should have reloaded, if that is over, else now.

    It can't say when it was pressed, but a page that does not reload itself is none to press on.
    """
    until = _moment(fields, "_until")
    return until if until is None else min(until, clock.server_now())


def _language(state: AppState, form: PressForm) -> str:
    """The language of the page whose form this is: another page of the browser may have changed its
    language since. A program's form has the language of its request."""
    language = form.fields.pop("_language", form.reader.language)
    panel = state.fleet.panel
    if language not in (*panel.readers_languages, panel.language):
        raise InputError(f'_language: "{language:.40}" is not a language of this panel')
    return language


def _is_second_tap(fields: dict[str, str]) -> bool:
    """Whether a page without scripts is pressed sooner than anyone reads it: by the second tap of what
    brought it. Scripts tell by themselves; a page that loaded itself was not tapped for."""
    shown_at = _moment(fields, "_since")
    return shown_at is not None and clock.server_now() - shown_at < TAP_AGAIN_S


def _moment(fields: dict[str, str], name: str) -> float | None:
    text = fields.pop(name, None)
    if text is None:
        return None
    try:
        moment = float(text)
    except ValueError:
        moment = math.nan
    if not math.isfinite(moment):
        raise InputError(f'{name}: "{text:.40}" is not that of a page')
    return moment


def page_after(
    state: AppState, page: RobotSession, widget: str, receipt_id: str, shown_on: str = ""
) -> str:
    """The path of a widget's page, with a receipt if there is one. `page` is the session of the robot
    whose page it was, `shown_on` the page's id where it was pressed, "" if unknown."""
    panel = state.fleet.panel
    loads = {load.id: load for load in panel.recipe_loads}
    if widget in loads:
        path = f"{page.base}/recipes/{widget}"
        recipe = recipe_of(page, loads[widget], receipt_id)
        path += f"?recipe={quote(recipe)}" if recipe else ""
    else:
        path = f"{page.base}/pages/{_page_of(panel, widget, shown_on).id}"
    receipt = f"{'&' if '?' in path else '?'}receipt={quote(receipt_id)}" if receipt_id else ""
    return path + receipt


def recipe_of(session: RobotSession, load: RecipeLoad, receipt_id: str) -> str:
    """The id of the recipe of a press; "" if it is not known."""
    receipt = session.presses.receipt(receipt_id)
    value = receipt.inputs.get(load.id, "") if receipt else ""
    return str(value).rpartition("@")[0]


def is_second_tap(form: Mapping[str, str]) -> bool:
    """Whether the form of an act, on a page without scripts, is sent sooner than anyone reads it."""
    return _is_second_tap({"_since": form["_since"]}) if "_since" in form else False
