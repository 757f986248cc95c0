"""A press that a person confirms, by forms for a browser without scripts: a page asks for the PIN."""

from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from app.access.access import Attempt, Checked
from app.access.confirmer import Question
from app.access.secrets_hash import LONGEST
from app.access.users import LONGEST_NAME
from app.errors import InputError, TooMany
from app.i18n import TextLike, say
from app.panel.widgets.families import PressCommand
from app.permission.confirmations import ConfirmedBy
from app.permission.principal import Principal
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState
from app.web.confirmations import inputs_of
from app.web.rendering.confirm_sheet import Subject, confirm_sheet, digits_key, press_subject
from app.web.rendering.display_choice import DisplaySettings

# The fields of the sheet. None of them is shown again, logged or taken for an input.
FIELDS: Final = ("_digit", "_user", "_pin", "_password", "_badge")


class Reader(NamedTuple):
    """The language and the display choices of a browser."""

    language: str
    display: DisplaySettings


@dataclass(frozen=True, slots=True)
class ConfirmForm:
    """A form that a person may confirm. `fields` are its texts: of inputs, and of the page, whose names
    begin with "_"; the latter are removed as they are read. `session` is the id of the session of a
    signed-in user."""

    principal: Principal
    fields: dict[str, str] = field(repr=False)
    session: str = field(repr=False)


@dataclass(frozen=True, slots=True)
class PressForm(ConfirmForm):
    """A form that presses a widget."""

    widget: PressCommand
    reader: Reader


def entered_fields(fields: dict[str, str]) -> dict[str, str]:
    """What is entered in the sheet, which the fields lose with it."""
    return {name: fields.pop(name, "")[:LONGEST] for name in FIELDS}


async def confirmed_by_form(
    state: AppState, session: RobotSession, form: PressForm, too_soon: bool
) -> tuple[ConfirmedBy | None, dict[str, Any]]:
    """Who has confirmed the press of a form; else the sheet to be shown, with what is missing. A tap
    that comes `too_soon` confirms nothing."""
    entered, who = entered_fields(form.fields), form.principal
    value = form.fields.get(form.widget.id, "")
    subject = press_subject(state, session, form.widget, value)
    failed: TextLike = ""
    if entered["_digit"] not in ("", "enter"):
        state.access.typed_digits.press(who.client.id, digits_key(subject.id), entered["_digit"])
    elif entered["_digit"] == "enter" and not too_soon:
        inputs = inputs_of(form.widget, dict(form.fields))
        confirmed, checked = await checked_entry(state, subject, inputs, form, entered)
        if confirmed is not None:
            return confirmed, {}
        failed = checked.reason
        if checked.tries_left:
            failed = say("signin_tries_left", why=failed, count=str(checked.tries_left))
    sheet = confirm_sheet(state, subject, who, entered["_user"])
    return None, {**sheet, "failed": failed, "scripted": False}


async def checked_entry(
    state: AppState, subject: Subject, inputs: str, form: ConfirmForm, entered: dict[str, str]
) -> tuple[ConfirmedBy | None, Checked]:
    """Who confirmed it with what was entered; else what was wrong. `inputs` is their fingerprint."""
    who, digits = form.principal, digits_key(subject.id)
    entered["_pin"] = entered["_pin"] or state.access.typed_digits.read(who.client.id, digits)
    state.access.typed_digits.press(who.client.id, digits, "clear")
    ways = [way for way in ("_badge", "_password", "_pin") if entered[way]]
    if not ways:
        return None, _missing("confirm_empty")
    (way, *_) = ways
    name = entered["_user"][:LONGEST_NAME] if way != "_badge" else ""
    if subject.confirmation == "two_persons" and way != "_badge" and not name:
        return None, _missing("confirm_who")
    question = Question(subject.id, inputs, subject.confirmation, subject.needs)
    attempt = Attempt(name, _WAYS[way], entered[way])
    user_session = state.access.sessions.get(form.session, who.client.id)
    try:
        checked, token = await state.confirmer.confirm(who, user_session, question, attempt)
    except (InputError, TooMany) as error:
        return None, Checked(None, error.text, "confirm_busy")
    return state.confirmer.take(token, form.session, subject.id, inputs), checked


def _missing(code: str) -> Checked:
    return Checked(None, say(code), code)


_WAYS: Final[dict[str, Any]] = {"_badge": "badge", "_password": "password", "_pin": "pin"}
