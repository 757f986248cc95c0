"""The page of recipes: the list of a set, the values of one recipe beside those of the robot, and its
history."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal, TypedDict

from app.cell.recipes.book import RecipeBook
from app.cell.recipes.recipe import (
    LONGEST_NAME,
    Act,
    Recipe,
    Values,
    checked_values,
    differences,
    differences_text,
    reported_text,
    value_text,
)
from app.cell.recipes.reported import (
    Reported,
    ReportedFields,
    differing,
    loaded,
    reported_fields,
    unknown_reason,
)
from app.cell.robot.state import RobotState
from app.panel.values import number_text
from app.panel.widgets.families import BaseWidget, Input
from app.panel.widgets.inputs import SelectInput, TextInput, ToggleInput
from app.panel.widgets.numbers import Numeric
from app.panel.widgets.recipe_load import RecipeLoad
from app.system.clock import format_datetime
from app.system.errors import InputError
from app.system.texts import Text, TextLike, joined, number, say
from app.web.pages.log_words import who_of

Mode = Literal["show", "edit", "new", "copy", "rename", "delete", "history", "csv"]
State = Literal["same", "differs", "unknown"]
NO_VALUES: Final[Values] = {}
NO_TYPED: Final[Mapping[str, str]] = {}
NAME_FIELD: Final = "-name"


@dataclass(frozen=True, slots=True)
class FieldRow:
    """A field: the recipe's value and what the robot has. `at` is where the value is between its
    limits, in percent, None where there are none; `fault`: why the value can't be loaded."""

    input: Input
    value: TextLike
    robot: TextLike
    state: State
    low: TextLike = ""
    high: TextLike = ""
    at: float | None = None
    fault: TextLike = ""


@dataclass(frozen=True, slots=True)
class ListRow:
    """A recipe in the list. `reason`: why its file can't be read."""

    id: str
    name: TextLike
    about: TextLike
    is_loaded: bool = False
    reason: TextLike = ""


@dataclass(frozen=True, slots=True)
class VersionRow:
    """A version: what changed with it."""

    number: int
    at: Text
    by: TextLike
    act: Text
    changes: TextLike
    is_now: bool


class RecipesContext(TypedDict):
    """The variables of `recipes.html`, beside those of the frame."""

    load: RecipeLoad
    sets: Sequence[RecipeLoad]
    mode: Mode
    rows: list[ListRow]
    count: TextLike
    chosen: Recipe | None
    gone: bool
    detailed: bool
    fields: list[FieldRow]
    summary: TextLike
    loads: TextLike
    unloadable: TextLike
    history: list[VersionRow]
    entered: Mapping[str, Any]
    name_input: TextInput
    csv: str
    said: TextLike


def entries_of(load: RecipeLoad, mode: Mode) -> tuple[BaseWidget, ...]:
    """What is entered on the page in a mode."""
    named = (name_input(),) if mode in ("new", "copy", "rename") else ()
    return (*named, *(load.fields if mode in ("new", "edit") else ()))


def name_input() -> TextInput:
    """The input of a recipe's name: no input of a panel has its id."""
    fixed: dict[str, Any] = {"id": NAME_FIELD, "kind": "text", "label": word("name")}
    return TextInput.model_construct(None, max_length=LONGEST_NAME, **fixed)


ACT_WORDS: Final[Mapping[Act, str]] = {
    "created": "recipes_act_created",
    "saved": "recipes_act_saved",
    "renamed": "recipes_act_renamed",
    "restored": "recipes_act_restored",
    "imported": "recipes_act_imported",
}


def word(name: str, /, **about: Any) -> Text:
    return say(f"recipes_{name}", **about)


def recipes_context(
    book: RecipeBook,
    sets: Sequence[RecipeLoad],
    robot: RobotState,
    recipe_id: str,
    mode: Mode,
    said: TextLike,
    typed: Mapping[str, str] = NO_TYPED,
) -> RecipesContext:
    """What the page shows now; `typed` is what a refused form had."""
    load, recipes = book.load, book.recipes
    reported = reported_fields(load, robot, time.monotonic())
    in_robot = loaded(load.fields, recipes, reported) or ()
    chosen = book.recipe(recipe_id) or (recipes[0] if recipes and not recipe_id else None)
    listed = [ListRow(r.id, r.name, _about(r), r.id in in_robot) for r in recipes]
    listed += [ListRow(b.id, b.id, "", reason=word("broken", why=b.reason)) for b in book.broken]
    values = chosen.values if chosen else NO_VALUES
    fields = [_field_row(field, values, reported[field.id]) for field in load.fields]
    return RecipesContext(
        load=load,
        sets=sets,
        mode=mode if chosen or mode in ("new", "csv") else "show",
        rows=listed,
        count=word("count", count=number(str(len(listed)))),
        chosen=chosen,
        gone=bool(recipe_id) and chosen is None,
        detailed=bool(recipe_id) and chosen is not None,
        fields=fields,
        summary=_summary(load, values, reported) if chosen else "",
        loads=loads_text(load, values, reported) if chosen else "",
        unloadable=_unloadable(load, values) if chosen else "",
        history=list(_history(load, chosen)) if chosen else [],
        entered=_entered(load, values if mode == "edit" else NO_VALUES)
        | ({NAME_FIELD: chosen.name} if chosen and mode == "rename" else {})
        | _typed(load, typed),
        csv=typed.get("-csv", ""),
        name_input=name_input(),
        said=said,
    )


def _about(recipe: Recipe) -> Text:
    return word("by", by=_by(recipe.now.by), time=format_datetime(recipe.now.at))


def _by(who: str) -> TextLike:
    """A client without its address, in the reader's language."""
    return who_of(who.rpartition(" (")[0] or who)


def _field_row(field: Input, values: Values, reported: Reported) -> FieldRow:
    value = values.get(field.id)
    robot = reported_text(field, reported.value) if reported.is_known else word("unknown")
    state: State = "unknown"
    if reported.is_known:
        is_other = bool(differing([field], values, {field.id: reported}))
        state = "differs" if is_other else "same"
    fault: TextLike = "" if field.id in values else word("no_value")
    if field.id in values:
        try:
            field.check_value(value)
        except InputError:
            fault = word("outside")
    if not isinstance(field, Numeric):
        return FieldRow(field, value_text(field, value), robot, state, fault=fault)
    at = None
    if isinstance(value, int | float) and not isinstance(value, bool):
        share = (value - field.min) / (field.max - field.min)
        at = round(100 * min(max(share, 0.0), 1.0), 1)
    low, high = number(number_text(field.min)), number(number_text(field.max))
    return FieldRow(field, value_text(field, value), robot, state, low, high, at, fault)


def _summary(load: RecipeLoad, values: Values, reported: ReportedFields) -> TextLike:
    if why := unknown_reason(reported):
        return word("robot_unknown", why=why)
    wrong = differing(load.fields, values, reported)
    if not wrong:
        return word("all_same")
    counts = {"count": number(str(len(wrong))), "all": number(str(len(load.fields)))}
    return word("differ", **counts)


def loads_text(load: RecipeLoad, values: Values, reported: ReportedFields) -> Text:
    """What Load would change in the robot."""
    if unknown_reason(reported):
        return word("loads_unknown")
    wrong = differing(load.fields, values, reported)
    return word("loads", count=number(str(len(wrong)))) if wrong else word("loads_nothing")


def _unloadable(load: RecipeLoad, values: Values) -> TextLike:
    try:
        checked_values(load.fields, values)
    except InputError as error:
        return error.text
    return ""


def _history(load: RecipeLoad, recipe: Recipe) -> Sequence[VersionRow]:
    """The newest first; the oldest that is kept has all its values."""
    rows, names = [], [field.id for field in load.fields]
    for i, version in enumerate(recipe.versions):
        before = recipe.versions[i - 1] if i else None
        changed = differences(names, before.values if before else NO_VALUES, version.values)
        changes = differences_text(load.fields, changed)
        if before is not None and before.name != version.name:
            renamed = say("recipe_change", label=say("recipe_name"), old=before.name, new=version.name)
            changes = joined((renamed, changes), "between_names") if changed else renamed
        act, is_now = say(ACT_WORDS[version.act]), version is recipe.now
        changes = changes if changed or before else changes or say("recipe_no_change")
        at = format_datetime(version.at)
        rows.append(VersionRow(version.number, at, _by(version.by), act, changes, is_now))
    return rows[::-1]


def _typed(load: RecipeLoad, typed: Mapping[str, str]) -> dict[str, Any]:
    """What was typed, as `_entered` has it: a toggle is on or off, all else is text."""
    toggles = {field.id for field in load.fields if isinstance(field, ToggleInput)}
    return {name: text == "true" if name in toggles else text for name, text in typed.items()}


def _entered(load: RecipeLoad, values: Values) -> dict[str, Any]:
    """The values as the macros of inputs show what was entered."""
    entered: dict[str, Any] = {}
    for field in load.fields:
        if field.id not in values:
            continue
        value = values[field.id]
        if isinstance(field, SelectInput):
            keys = (option.key for option in field.own_options if option.value == value)
            value = next(keys, value)
        entered[field.id] = value
    return entered
