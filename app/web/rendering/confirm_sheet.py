"""What the sheet shows in which a person confirms a press with a PIN, password or badge."""

from dataclasses import dataclass
from typing import Any, Final, TypedDict

from app.access.confirmer import able_users
from app.i18n import Text, TextLike, say
from app.panel.widgets.confirmed import Confirmed, confirmation_of
from app.panel.widgets.families import Command
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.recipe_load import RecipeLoad
from app.permission.confirmations import SIGN_IN, WITHOUT_PIN
from app.permission.principal import Principal
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState
from app.web.rendering.page_words import Ask
from app.web.rendering.recipe_ask import question_before

TITLES: Final = {
    "pin": "confirm_title_pin",
    "password": "confirm_title_password",
    "badge": "confirm_title_badge",
}
WORDS: Final = ("clear", "delete", "password", "badge", "name")


@dataclass(frozen=True, slots=True)
class Subject:
    """What a person confirms, a press or an act on an alarm. `id` is that of the command or of the
    alarm's entry, `needs` what both persons need, and `yes` the word of the button."""

    id: str
    confirmation: str
    needs: frozenset[str]
    ask: Ask
    yes: TextLike
    consequence: TextLike = ""


class ConfirmSheet(TypedDict):
    """`lock`: why it can't be confirmed at this browser, "" if it can. `people` are those who can
    be chosen as the second person; without names (`typed`) they are typed. `by_pin`, `by_password` and
    `by_badge` are what can be entered, `typed_digits` how many digits the server has already."""

    title: TextLike
    question: Ask
    consequence: TextLike
    lock: TextLike
    people: list[str]
    typed: bool
    by_pin: bool
    by_password: bool
    by_badge: bool
    yes: TextLike
    chosen: str
    typed_digits: int
    words_of: dict[str, Text]


def press_subject(state: AppState, session: RobotSession, command: Command, value: str = "") -> Subject:
    """A press of a command as what a person confirms; `value` is that of its button, such as the recipe
    that it loads."""
    return Subject(
        command.id,
        confirmation_of(command),
        state.fleet.panel.needs.commands.get(command.id, frozenset()),
        question_before(state.fleet, session, command, value),
        _yes(command),
        command.consequence or "" if isinstance(command, Confirmed) else "",
    )


def confirm_sheet(state: AppState, subject: Subject, who: Principal, chosen: str = "") -> ConfirmSheet:
    """The sheet for what a client wants to do. Names of users are shown at the kiosk's own
    machine only: elsewhere they are typed. `chosen` is the second person so far."""
    two, book = subject.confirmation == "two_persons", state.access.book
    others = [
        user.user
        for user in able_users(state.access)
        if user.user != who.user and all(user.meets(need) for need in subject.needs)
    ]
    here = who.client.local
    names = (others if here else []) if two else [who.user]
    users = [user for user in map(book.user, names) if user is not None]
    ways = {way for user in users for way in user.ways} or {"pin", "password", "badge"}
    title = say("confirm_title_two") if two else say(_title(ways), name=who.user)
    return ConfirmSheet(
        title=title,
        question=subject.ask,
        consequence=subject.consequence,
        lock=_lock(state, two, who),
        people=names if two else [],
        typed=two and not here,
        by_pin="pin" in ways,
        by_password="password" in ways and (two or "pin" not in ways),
        by_badge="badge" in ways,
        yes=subject.yes,
        chosen=chosen,
        typed_digits=len(state.access.typed_digits.read(who.client.id, digits_key(subject.id))),
        words_of={name: say(f"signin_{name}") for name in WORDS} | {"second": say("confirm_second")},
    )


def _lock(state: AppState, two: bool, who: Principal) -> TextLike:
    """Why it can't be confirmed at this browser."""
    if not who.user or who.program:
        return say(SIGN_IN)
    return "" if two or state.access.book.user(who.user) else say(WITHOUT_PIN)


def digits_key(subject: str) -> str:
    """Under which the server keeps the digits that a browser without scripts types."""
    return f"\0{subject}"


def _title(ways: set[Any]) -> str:
    return next(title for way, title in TITLES.items() if way in ways)


def _yes(command: Command) -> TextLike:
    if isinstance(command, HoldCommand):
        return say("confirm_done")
    return say("recipes_load") if isinstance(command, RecipeLoad) else command.label
