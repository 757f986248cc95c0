"""A press that a person confirms, by forms for a browser without scripts: a page asks for the PIN."""

from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from app.access.access import Attempt
from app.access.secrets_hash import LONGEST
from app.access.users import LONGEST_NAME
from app.errors import InputError, TooMany
from app.i18n import TextLike, say
from app.panel.widgets.families import PressCommand
from app.permission.confirmations import ConfirmedBy
from app.permission.principal import Principal
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState
from app.web.confirmations import question_of
from app.web.rendering.confirm_sheet import confirm_sheet, digits_key
from app.web.rendering.display_choice import DisplaySettings

# The fields of the sheet. None of them is shown again, logged or taken for an input.
FIELDS: Final = ("_digit", "_user", "_pin", "_password", "_badge")


class Reader(NamedTuple):
    """The language and the display choices of a browser."""

    language: str
    display: DisplaySettings


@dataclass(frozen=True, slots=True)
class PressForm:
    """A form that presses a widget. `fields` are the texts of inputs, and fields of the page, whose
    names begin with "_"; the latter are removed as they are read. `session` is the id of the session of
    a signed-in user."""

    widget: PressCommand
    principal: Principal
    fields: dict[str, str] = field(repr=False)
    reader: Reader
    session: str = field(default="", repr=False)


async def confirmed_by_form(
    state: AppState, session: RobotSession, form: PressForm, too_soon: bool
) -> tuple[ConfirmedBy | None, dict[str, Any]]:
    """Who has confirmed the press of a form; else the sheet to be shown, with what is missing. A tap
    that comes `too_soon` confirms nothing."""
    entered = {name: form.fields.pop(name, "")[:LONGEST] for name in FIELDS}
    widget, who, digits = form.widget, form.principal, digits_key(form.widget)
    failed: TextLike = ""
    if entered["_digit"] not in ("", "enter"):
        state.access.type_digit(who.client.id, digits, entered["_digit"])
    elif entered["_digit"] == "enter" and not too_soon:
        entered["_pin"] = entered["_pin"] or state.access.typed_digits(who.client.id, digits)
        state.access.type_digit(who.client.id, digits, "clear")
        confirmed, failed = await _checked(state, form, entered)
        if confirmed is not None:
            return confirmed, {}
    value = form.fields.get(widget.id, "")
    sheet = confirm_sheet(state, session, widget, who, value, entered["_user"])
    return None, {**sheet, "failed": failed, "scripted": False}


async def _checked(
    state: AppState, form: PressForm, entered: dict[str, str]
) -> tuple[ConfirmedBy | None, TextLike]:
    """Who confirmed it with what was entered; else why nobody did."""
    ways = [way for way in ("_badge", "_password", "_pin") if entered[way]]
    if not ways:
        return None, say("confirm_empty")
    (way, *_) = ways
    name = entered["_user"][:LONGEST_NAME] if way != "_badge" else ""
    inputs = dict(form.fields)
    question = question_of(state, form.widget, inputs)
    if question.confirmation == "two_persons" and way != "_badge" and not name:
        return None, say("confirm_who")
    attempt = Attempt(name, _WAYS[way], entered[way])
    user_session = state.access.sessions.get(form.session, form.principal.client.id)
    try:
        checked, token = await state.confirmer.confirm(form.principal, user_session, question, attempt)
    except (InputError, TooMany) as error:
        return None, error.text
    by = state.confirmer.take(token, form.session, form.widget.id, question.inputs)
    if by is not None:
        return by, ""
    if checked.tries_left:
        left = str(checked.tries_left)
        return None, say("signin_tries_left", why=checked.reason, count=left)
    return None, checked.reason


_WAYS: Final[dict[str, Any]] = {"_badge": "badge", "_password": "password", "_pin": "pin"}
