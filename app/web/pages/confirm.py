"""Questions before a press: the sheet in which a person confirms it, and the changes that a recipe
makes."""

import time
from dataclasses import dataclass
from typing import Any, Final, TypedDict

from app.cell.people.access import PIN_HERE
from app.cell.people.confirmer import able_users
from app.cell.permission.roles import SIGN_IN, WITHOUT_PIN
from app.cell.recipes.recipe import Recipe, reported_text, value_text
from app.cell.recipes.reported import differing, reported_fields
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.panel.widgets.families import Command
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.key_parts import ConfirmationKeys, confirmation_of
from app.panel.widgets.recipe_load import RecipeLoad
from app.records.principal import Principal
from app.system.texts import Text, TextLike, say
from app.web.app_state import AppState
from app.web.pages.recipes_page import loads_text, word
from app.web.pages.words import Ask, AskedChange, ask_of

# The question before a recipe is loaded: its name, and what it changes in the robot.


def question_before(fleet: Fleet, session: RobotSession, command: Command, value: Any) -> Ask:
    """The question before a press of a command; of a load `value` is the recipe with its version, as
    the press has it."""
    if not isinstance(command, RecipeLoad):
        return ask_of(session, command)
    book = fleet.recipes.book(command.id)
    recipe = book.recipe(str(value).rpartition("@")[0]) if book else None
    return ask_of(session, command) if recipe is None else recipe_ask(session, command, recipe)


def recipe_ask(session: RobotSession, load: RecipeLoad, recipe: Recipe) -> Ask:
    """The question before this recipe is loaded as it is now."""
    robot = session.entry.name if session.entry else ""
    sentence = say("recipes_ask_on" if robot else "recipes_ask", name=recipe.name, robot=robot)
    reported = reported_fields(load, session.robot, time.monotonic())
    unknown = [field for field in load.fields if not reported[field.id].is_known]
    changed = differing(load.fields, recipe.values, reported)
    changes = [
        AskedChange(
            field.label,
            word("unknown") if field in unknown else reported_text(field, reported[field.id].value),
            value_text(field, recipe.values.get(field.id)),
        )
        for field in load.fields
        if field in unknown or field in changed
    ]
    note = loads_text(load, recipe.values, reported)
    return Ask(sentence=sentence, inputs=[], changes=changes, note=note)


# What the sheet shows in which a person confirms a press with a PIN, password or badge.

TITLES: Final = {
    "pin": "confirm_title_pin",
    "password": "confirm_title_password",
    "badge": "confirm_title_badge",
}
WORDS: Final = {
    "clear": "signin_clear",
    "delete": "signin_delete",
    "password": "signin_password",
    "badge": "signin_badge",
    "name": "signin_name",
    "checking": "signin_checking",
    "second": "confirm_second",
    "scripts": "confirm_needs_javascript",
}


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
    `by_badge` are what can be entered."""

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
        command.consequence or "" if isinstance(command, ConfirmationKeys) else "",
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
    own = {way for user in users for way in user.ways} or {"pin", "password", "badge"}
    ways = {way for way in own if state.access.takes(way, who.client)}
    title = say("confirm_title_two") if two else say(_title(ways or own), name=who.user)
    return ConfirmSheet(
        title=title,
        question=subject.ask,
        consequence=subject.consequence,
        lock=_lock(state, two, who) or ("" if ways else say(PIN_HERE)),
        people=names if two else [],
        typed=two and not here,
        by_pin="pin" in ways,
        by_password="password" in ways and (two or "pin" not in ways),
        by_badge="badge" in ways,
        yes=subject.yes,
        chosen=chosen,
        words_of={name: say(code) for name, code in WORDS.items()},
    )


def _lock(state: AppState, two: bool, who: Principal) -> TextLike:
    """Why it can't be confirmed at this browser."""
    if not who.user or who.program:
        return say(SIGN_IN)
    return "" if two or state.access.book.user(who.user) else say(WITHOUT_PIN)


def _title(ways: set[Any]) -> str:
    return next(title for way, title in TITLES.items() if way in ways)


def _yes(command: Command) -> TextLike:
    if isinstance(command, HoldCommand):
        return say("confirm_done")
    return say("recipes_load") if isinstance(command, RecipeLoad) else command.label
