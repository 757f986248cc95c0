"""A recipe is loaded by parameters only if the node's ranges permit each value."""

import asyncio
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from app.cell.commands.parameters import ParameterSync
from app.cell.commands.press import PressHandle
from app.cell.commands.recipe_loads import ChosenRecipe, RecipeLoader
from app.cell.commands.services import ServiceCalls
from app.cell.recipes.recipe import new_recipe
from app.cell.robot.parameter_state import ParameterState
from app.cell.session.recipes import Recipes
from app.panel import load_panel
from app.panel.numbers import Range
from app.records.entry import Outcome
from app.system.errors import InputError
from tests.cell.recipes.panels import CARTON, PANEL
from tests.support.builders import INTERFACES, FakeTransport, robot_there
from tests.support.words import english


async def unexpected(*_: object) -> Outcome:
    raise AssertionError("nothing is sent")


class Prepared(NamedTuple):
    fields: dict[str, Any]
    handle: PressHandle


def test_a_value_beyond_the_range_of_the_node_sends_nothing(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(PANEL)
    panel = load_panel(path)
    robot, link = robot_there(panel), FakeTransport()
    calls = ServiceCalls(INTERFACES, robot, link, lambda _: None)
    parameters = ParameterSync(panel, INTERFACES, robot, link, calls, lambda: None)
    loader = RecipeLoader(INTERFACES, robot, parameters, Recipes(panel), lambda _: None)
    (load,) = panel.recipe_loads
    limited = load.parameters["length"]
    robot.parameters[limited.id] = ParameterState("live", 0.3, Range(0.0, 0.35))
    recipe = new_recipe("carton", "created", 0.0, "Ann", "Carton", CARTON)
    handle = PressHandle("p1", lambda _: None, lambda: None, "")
    prepared = Prepared({"value": ChosenRecipe(recipe, CARTON)}, handle)
    with pytest.raises(InputError) as refusal:  # 400 mm are 0.4 m; the link expects no query
        asyncio.run(loader.load(load, prepared, unexpected))
    assert "Length" in english(refusal.value.text)
    assert load.id not in robot.command_status
