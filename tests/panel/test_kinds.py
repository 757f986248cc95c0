"""Every kind of widgets has its row in each table, and a macro of its name."""

import pytest
from jinja2 import Environment, FileSystemLoader

from app.commands.dispatch import Dispatcher
from app.panel.widgets.families import BaseWidget, Command, EntryWidget, PressCommand
from app.panel.widgets.kinds import KINDS, find_row
from app.permission.interlocks import COMMAND_CHECKS
from app.settings import shipped_path
from app.view.kinds import ATTRIBUTES
from tests.support.builders import FakeTransport, panel_of, robot_there, sending_of

EACH = pytest.mark.parametrize(("kind", "of"), KINDS.items())


@pytest.fixture(scope="module")
def dispatcher() -> Dispatcher:
    panel = panel_of()
    return sending_of(panel, robot_there(panel), FakeTransport())


def widget(of: type[BaseWidget], kind: str) -> BaseWidget:
    return of.model_construct(id="one", label="One", kind=kind)


@EACH
def test_a_kind_is_the_one_that_its_class_names(kind: str, of: type[BaseWidget]) -> None:
    assert of.model_json_schema()["properties"]["kind"]["const"] == kind


@EACH
def test_a_kind_is_shown(kind: str, of: type[BaseWidget]) -> None:
    assert callable(find_row(ATTRIBUTES, widget(of, kind)))


@EACH
def test_a_kind_has_a_macro_of_its_name(kind: str, of: type[BaseWidget]) -> None:
    environment = Environment(loader=FileSystemLoader(shipped_path("templates")))
    macro = getattr(environment.get_template(f"widgets/{kind}.html").module, kind)
    assert macro.arguments == ("widget", "shown", "inputs", "receipt", "words")


@EACH
def test_a_command_is_judged_and_sent(kind: str, of: type[BaseWidget], dispatcher: Dispatcher) -> None:
    if issubclass(of, Command):
        assert callable(find_row(COMMAND_CHECKS, widget(of, kind)))
    if issubclass(of, PressCommand):
        assert callable(find_row(dispatcher.senders, widget(of, kind)))
        assert callable(find_row(dispatcher.refusals, widget(of, kind)))
    if issubclass(of, EntryWidget):
        assert callable(find_row(dispatcher.checks, widget(of, kind)))


def test_a_kind_without_a_row_is_named() -> None:
    with pytest.raises(TypeError, match='no row for a widget of the kind "text"'):
        find_row(COMMAND_CHECKS, widget(KINDS["text"], "text"))
