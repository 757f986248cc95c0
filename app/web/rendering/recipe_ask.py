"""The question before a recipe is loaded: its name, and what it changes in the robot."""

import time
from typing import Any

from app.i18n import say
from app.panel.widgets.families import Command
from app.panel.widgets.recipe_load import RecipeLoad
from app.recipes.field_text import reported_text, value_text
from app.recipes.recipe import Recipe
from app.recipes.reported import differing, reported_fields
from app.runtime.fleet import Fleet
from app.runtime.robot_session import RobotSession
from app.web.rendering.page_words import Ask, AskedChange, ask_of
from app.web.rendering.recipes_page import loads_text, word


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
