"""The table of widget kinds: each kind has all its parts, and one that lacks a part is named."""

from typing import Final

import pytest
from jinja2 import Environment, FileSystemLoader

from app.cell.commands.dispatch import Dispatcher
from app.cell.permission.interlocks import COMMAND_CHECKS
from app.cell.view.kinds import ATTRIBUTES, COMMANDS
from app.panel.widgets.families import BaseWidget, Command, EntryWidget, PressCommand
from app.panel.widgets.kinds import KINDS, find_row, require_rows
from app.panel.widgets.publish import Publish
from app.system.errors import KindError
from app.system.settings import shipped_path
from app.tools.simulator.kinds import SIMULATED
from tests.support.builders import FakeTransport, panel_of, robot_there, sending_of


@pytest.mark.parametrize("kind", KINDS)
def test_kind_has_the_name_in_its_class(kind: str) -> None:
    assert KINDS[kind].model.model_json_schema()["properties"]["kind"]["const"] == kind


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_has_a_macro_of_its_name(kind: str) -> None:
    environment = Environment(loader=FileSystemLoader(shipped_path("templates")))
    macro = getattr(environment.get_template(f"widgets/{kind}.html").module, kind)
    assert macro.arguments == ("widget", "shown", "inputs", "receipt", "words")


# What a phone has though a value is entered in it: there it only shows.
SHOWS_TOO: Final = {"parameter", "place", "tour"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_phone_has_each_kind_that_shows_and_none_that_acts(kind: str) -> None:
    acts = issubclass(KINDS[kind].model, Command | EntryWidget) or kind == "link"
    assert KINDS[kind].model.on_phone == (not acts or kind in SHOWS_TOO)


@pytest.fixture(scope="module")
def dispatcher() -> Dispatcher:
    panel = panel_of()
    return sending_of(panel, robot_there(panel), FakeTransport())


def test_each_part_of_a_kind_is_required(dispatcher: Dispatcher) -> None:
    """Without the rows of a family, the first kind of the family is named."""
    for rows, family in (
        ({**ATTRIBUTES, **COMMANDS}, BaseWidget),
        (COMMAND_CHECKS, Command),
        (SIMULATED, BaseWidget),
        (dispatcher.dispatches, PressCommand),
        (dispatcher.checks, EntryWidget),
    ):
        require_rows("part", rows, family)
        with pytest.raises(KindError, match=r'^the widget kind "\w+" has no part: add a row for'):
            require_rows("part", {}, family)


def test_the_kind_and_the_missing_part_are_named() -> None:
    rows = {family: row for family, row in COMMANDS.items() if not issubclass(Publish, family)}
    with pytest.raises(KindError) as caught:
        require_rows("attributes", rows, Command)
    assert str(caught.value) == (
        'the widget kind "publish" has no attributes: add a row for Publish or its family'
    )


def test_a_widget_without_a_row_is_named() -> None:
    widget = KINDS["text"].model.model_construct(id="one", label="One", kind="text")
    with pytest.raises(KindError, match='the widget kind "text" has no row'):
        find_row(COMMAND_CHECKS, widget)
