"""Forms of tables: each key of each table can be reached and set, and a form says what the file has."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from html.parser import HTMLParser
from pathlib import Path as FilePath
from typing import Any, Final

import pytest

from app.panel.file.load import faults_of_text
from app.panel.file.toml_lines import Path
from app.panel.reference.schema import SAME, WIDGET
from app.ros.messages import Interfaces, load_interfaces
from app.system.settings import shipped_path
from app.system.texts import render
from app.system.toml_values import value_text
from app.tools.editor.document import Document, edit_from
from app.tools.editor.forms import (
    Field,
    Form,
    FormPage,
    RobotNames,
    element_id,
    form_context,
    form_of,
    schema,
    table_at,
    table_path,
    value_at,
)
from app.tools.editor.kinds import NO_WIDGETS, added
from app.web.pages.page_templates import PageTemplates
from docs._generate.keys import examples_of
from tests.support.parts import TESTS

EVERYTHING: Final = (TESTS / "everything.toml").read_text()
TABLES: Final[dict[str, Any]] = tomllib.loads(EVERYTHING)
INTERFACES: Final[Interfaces] = load_interfaces("jazzy", ())
EXAMPLES: Final[dict[str, Any]] = examples_of(schema())
TEMPLATES: Final = PageTemplates(shipped_path("templates"))
# Tables that tests/everything.toml has no example of, each with a place for one.
MORE: Final[Mapping[str, tuple[Path, Any]]] = {
    "options_from": (
        ("page", 0, "widget", 3, "options_from"),
        {"topic": "/stations", "type": "sensor_msgs/msg/JointState", "field": "name"},
    ),
}
PANEL_OF_TWO: Final = """
title = "Cell"
languages = ["en", "ja"]

[[page]]
id = "cell"
title = { en = "Cell" }
[[page.widget]]
id = "boxes"
kind = "figure"
label = "Boxes"
topic = "/boxes"
type = "std_msgs/msg/UInt32"
target = 144
segments = 6
"""


def tables_in(value: Any, path: Path = ()) -> Iterator[Path]:
    if isinstance(value, dict):
        yield path
        for key, each in value.items():
            yield from tables_in(each, (*path, key))
    elif isinstance(value, list):
        for number, each in enumerate(value):
            yield from tables_in(each, (*path, number))


def places() -> dict[str, tuple[dict[str, Any], Path]]:
    """Table of the reference → (a file, the path of such a table in it)."""
    known: dict[str, tuple[dict[str, Any], Path]] = {}
    for path in tables_in(TABLES):
        if table_path(TABLES, path) == path:
            known.setdefault(table_at(TABLES, path), (TABLES, path))
    for name, (path, value) in MORE.items():
        tables = tomllib.loads(EVERYTHING)
        value_at(tables, path[:-1])[path[-1]] = value
        known[name] = tables, path
    return known


PLACES: Final = places()


def form_around(tables: dict[str, Any], path: Path) -> Form:
    """The form in which a person meets the table: its own, or that which has it within."""
    for end in range(len(path) + 1):
        form = form_of(tables, path[:end], interfaces=INTERFACES)
        if form.path == path or any(field.path[:-1] == path for field in form.fields):
            return form
    raise AssertionError(f"no form has {path}")


def field_at(form: Form, path: Path) -> Field:
    return next(field for field in form.fields if field.path == path)


def edits_for(field: Field, value: Any) -> list[dict[str, Any]]:
    """The edits that a browser posts when the value is entered in the field."""
    path = [*field.path]
    at = {"op": "set", "path": path}
    match field.control:
        case "text" | "lines" | "suggest" | "icon" | "file" | "colour" | "id":
            return [at | {"value": value}]
        case "texts":
            return [at | {"value": value}]
        case "number" if isinstance(value, dict):
            (begin,) = field.acts[0].edits
            return [dict(begin), at | {"value": value}]
        case "number" | "numbers" | "literal" | "toml":
            return [at | {"toml": value_text(value)}]
        case "choice" | "kind":
            assert value in [choice.value for choice in field.choices] or field.of_ids
            return [at | {"value": value}]
        case "ticks" | "list":
            return [at | {"value": value}]
        case "table" if field.inner is None:
            (begin,) = field.acts[0].edits
            return [dict(begin), at | {"value": value}]
        case "fields":
            leaves = [*leaves_of(tuple(path), value)]
            return [{"op": "set", "path": [*leaf], "toml": value_text(each)} for leaf, each in leaves]
        case _:
            return [at | {"value": value}]


def leaves_of(path: Path, value: Any) -> Iterator[tuple[Path, Any]]:
    if isinstance(value, dict) and value:
        for key, each in value.items():
            yield from leaves_of((*path, key), each)
    else:
        yield path, value


@pytest.mark.parametrize("name", [name for name in schema() if name != WIDGET])
def test_each_key_of_a_table_can_be_reached_and_set(name: str) -> None:
    tables, path = PLACES[name]
    document = Document(EVERYTHING)
    if name in MORE:
        document.apply([edit_from({"op": "set", "path": [*path], "value": MORE[name][1]})], "")
    form = form_around(tables, path)
    examples = {key: EXAMPLES[f"{name}.{key}"] for key in schema()[name]["properties"]}
    for key, value in examples.items():
        field = field_at(form, (*path, key))
        assert field.label.endswith(key)
        document.apply([edit_from(edit) for edit in edits_for(field, value)], field.label)
    table = value_at(tomllib.loads(document.text), path)
    assert {key: table.get(key) for key in examples} == examples


class Elements(HTMLParser):
    """The paths of what can be typed or chosen, and the edits of buttons."""

    def __init__(self) -> None:
        super().__init__()
        self.paths: list[list[str | int]] = []
        self.edits: list[Any] = []
        self.opens: list[list[str | int]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        known = dict(attrs)
        if known.get("data-path"):
            self.paths.append(json.loads(str(known["data-path"])))
        if known.get("data-open"):
            self.opens.append(json.loads(str(known["data-open"])))
        if known.get("data-edits"):
            self.edits += json.loads(str(known["data-edits"]))


def rendered(form: Form, language: str = "en", page: FormPage = FormPage()) -> Elements:  # noqa: B008
    html = TEMPLATES.render("editor/_form.html", language, **form_context(form, page))
    elements = Elements()
    elements.feed(html)
    return elements


@pytest.mark.parametrize("name", [name for name in schema() if name != WIDGET])
def test_each_field_of_a_form_is_on_the_page(name: str) -> None:
    tables, path = PLACES[name]
    form = form_around(tables, path)
    elements = rendered(form)
    reached = {tuple(each) for each in elements.paths}
    reached |= {tuple(edit["path"]) for edit in elements.edits}
    for field in form.fields:
        below = {each[: len(field.path)] for each in reached if isinstance(each, tuple)}
        assert all([*link.path] in elements.opens for link in field.links), field.path
        if field.control not in ("opened", "rows", "table") or not field.raw:
            assert field.path in below, field.path


def fields(form: Form) -> dict[str, Field]:
    """The fields of the table itself, by their keys."""
    return {field.key: field for field in form.fields if len(field.path) == len(form.path) + 1}


def test_texts_of_the_panels_languages_stand_side_by_side_and_one_is_missing() -> None:
    tables = tomllib.loads(PANEL_OF_TWO)
    title = fields(form_of(tables, ("page", 0)))["title"]
    assert [(text.tag, text.text, text.missing) for text in title.texts] == [
        ("en", "Cell", False),
        ("ja", "", True),
    ]
    label = fields(form_of(tables, ("page", 0, "widget", 0)))["label"]
    assert [text.tag for text in label.texts] == ["en", "ja"]
    assert label.texts[1].around == {"en": "Boxes"}
    assert not any(text.missing for text in label.texts)  # one text is for all languages


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("colour", "grey (default)"),
        ("grow", "Off (default)"),
        ("priority", "Low"),
        ("needs", "everybody"),
    ],
)
def test_a_choice_names_what_counts_without_it(key: str, says: str) -> None:
    lamp = {
        "id": "l",
        "kind": "indicator",
        "states": [{"value": True, "text": "On", "shape": "circle"}],
    }
    tables = {"page": [{"id": "p", "widget": [lamp]}], "alarm": [{"id": "a", "low": 5}]}
    path = ("page", 0, "widget", 0) if key in ("colour", "grow") else ("alarm", 0)
    shown = next(each for each in form_of(tables, path).fields if each.key == key)
    assert render(shown.unset, "en") == says


def test_another_kind_keeps_what_it_knows_and_says_what_goes() -> None:
    tables = tomllib.loads(PANEL_OF_TWO)
    form = form_of(tables, ("page", 0, "widget", 0), kind="gauge")
    assert form.change is not None
    assert form.change.goes == ("target", "segments")
    assert form.change.needs == ("min", "max")
    document = Document(PANEL_OF_TWO)
    document.apply([edit_from(edit) for edit in form.change.edits], "")
    (widget,) = tomllib.loads(document.text)["page"][0]["widget"]
    assert widget == {
        "id": "boxes",
        "kind": "gauge",
        "label": "Boxes",
        "topic": "/boxes",
        "type": "std_msgs/msg/UInt32",
    }


def test_the_path_of_a_field_is_completed_from_the_message_with_live_values() -> None:
    robot = RobotNames(topics={"/boxes": "std_msgs/msg/UInt32"}, values={("/boxes", "data"): "92"})
    form = form_of(
        tomllib.loads(PANEL_OF_TWO),
        ("page", 0, "widget", 0),
        interfaces=INTERFACES,
        robot=robot,
    )
    known = fields(form)
    assert known["field"].unit == "uint32"
    assert form.suggestions[known["field"].suggestions] == (("data", "92"),)
    assert ("/boxes", "std_msgs/msg/UInt32") in form.suggestions[known["topic"].suggestions]
    assert known["topic"].type_path == ("page", 0, "widget", 0, "type")
    value = next(s for s in form.sections if s.code == "form_section_value")
    assert str(value.note) == "now 92"


@pytest.mark.parametrize(
    ("path", "key", "listed"),
    [
        (("page", 0, "widget", 8), "success", "result.successful"),  # of a service's response
        (("page", 0, "widget", 9), "progress", "sequence"),  # of an action's feedback
        (("page", 1, "widget", 6, "column", 0), "field", "level"),  # of the entries of a list
    ],
)
def test_a_field_is_of_the_message_that_its_key_speaks_of(path: Path, key: str, listed: str) -> None:
    form = form_of(TABLES, table_path(TABLES, path), interfaces=INTERFACES)
    around = form_of(TABLES, path[:4], interfaces=INTERFACES)
    field = field_at(around, (*path, key))
    assert listed in dict(around.suggestions[field.suggestions])
    assert form.path == path


def test_ids_are_chosen_from_those_of_the_file() -> None:
    known = fields(form_of(TABLES, ("page", 0, "widget", 5)))
    assert [choice.value for choice in known["interlock"].choices] == ["operation"]
    assert known["interlock"].single
    assert [choice.value for choice in known["needs"].choices][-1] == "quality"
    alarm = fields(form_of(TABLES, ("alarm", 0)))
    assert {"say", "jog", "r2/jog"} <= {choice.value for choice in alarm["inhibits"].choices}
    assert [choice.value for choice in alarm["inhibits"].choices if choice.chosen] == ["jog", "r2/jog"]
    assert [choice.value for choice in alarm["state"].choices] == ["RUNNING", "FAULT"]


def test_an_alarm_has_its_limits_with_their_priorities() -> None:
    form = form_of(TABLES, ("alarm", 0))
    limits = next(s for s in form.sections if s.code == "form_section_limits")
    rows = [(field.key, field.beside.key if field.beside else "") for field in limits.fields]
    assert rows[:4] == [
        ("high_high", "critical_priority"),
        ("high", "priority"),
        ("low", "priority"),
        ("low_low", "critical_priority"),
    ]
    door = next(n for n, alarm in enumerate(TABLES["alarm"]) if alarm["id"] == "door")
    codes = [section.code for section in form_of(TABLES, ("alarm", door)).sections]
    assert "form_section_value" in codes


def test_a_fault_stands_at_its_field_and_a_missing_key_at_the_form(tmp_path: FilePath) -> None:
    text = PANEL_OF_TWO.replace("segments = 6", 'segments = "six"').replace('topic = "/boxes"\n', "")
    faults = faults_of_text(text, tmp_path)
    form = form_of(tomllib.loads(text), ("page", 0, "widget", 0), faults=faults)
    known = fields(form)
    assert known["segments"].faults == ('must be a whole number, not "six"',)
    assert known["segments"].value == "six"
    assert [*known["topic"].faults, *form.faults] == ["is missing"]


def test_an_unknown_key_is_text_with_a_button_that_removes_it() -> None:
    text = PANEL_OF_TWO + "shade = 3\n"
    form = form_of(tomllib.loads(text), ("page", 0, "widget", 0))
    shade = fields(form)["shade"]
    assert (shade.control, shade.value) == ("toml", "3")
    assert shade.acts[0].edits == ({"op": "delete", "path": ["page", 0, "widget", 0, "shade"]},)


def test_the_form_of_a_key_or_a_message_is_that_of_the_table_around_it() -> None:
    assert form_of(TABLES, ("page", 0, "widget", 5, "message", "data")).path == ("page", 0, "widget", 5)
    assert form_of(TABLES, ("page", 99)).path == ()
    assert form_of({"title": "T", "page": 3}, ("page", 0)).path == ()


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_each_form_of_the_shipped_panel_is_rendered(language: str) -> None:
    tables = tomllib.loads(shipped_path("panel.toml").read_text(encoding="utf-8"))
    for path in tables_in(tables):
        if table_path(tables, path) == path:
            form = form_of(tables, path, interfaces=INTERFACES, language=language)
            elements = rendered(form, language)
            assert elements.paths or elements.edits


def test_a_widget_moves_to_another_group_and_a_row_up_and_down() -> None:
    form = form_of(TABLES, ("page", 1, "widget", 0))
    group = next(f for f in form.fields if f.by_edits)
    document = Document(EVERYTHING)
    document.apply([edit_from(edit) for edit in group.choices[1].value], "")
    assert document.tables["page"][1]["group"][0]["widget"][-1]["id"] == "note"
    parts = form_of(TABLES, ("page", 1, "widget", 6))
    columns = fields(parts)["column"]
    down = columns.rows[0].acts[1]
    document = Document(EVERYTHING)
    document.apply([edit_from(edit) for edit in down.edits], "")
    moved = value_at(document.tables, ("page", 1, "widget", 6, "column"))
    assert [column["label"] for column in moved][:2] == ["Name", "Level"]


def test_a_copy_of_a_widget_has_only_its_place() -> None:
    number = next(n for n, w in enumerate(TABLES["page"][2]["widget"]) if SAME in w)
    assert set(fields(form_of(TABLES, ("page", 2, "widget", number)))) >= {SAME, "span", "rows", "grow"}


def test_a_widget_names_the_alarms_of_its_value() -> None:
    text = PANEL_OF_TWO + '\n[[alarm]]\nid = "full"\ntopic = "/boxes"\npriority = 2\n'
    form = form_of(tomllib.loads(text), ("page", 0, "widget", 0))
    alarms = next(field for field in form.fields if field.links and field.key == "alarm")
    assert [(link.path, link.text, str(link.note)) for link in alarms.links] == [
        (("alarm", 0), "full", "Medium")
    ]


def test_the_width_is_chosen_in_parts_of_the_groups_columns() -> None:
    known = fields(form_of(TABLES, ("page", 1, "group", 0, "widget", 0)))
    assert [choice.value for choice in known["span"].choices] == [3]  # of three columns only the whole
    known = fields(form_of(TABLES, ("page", 0, "widget", 0)))
    assert [(choice.value, choice.chosen) for choice in known["span"].choices] == [
        (3, False),
        (6, True),
        (12, False),
    ]


LOCKED: Final = """
title = "Cell"
[[interlock]]
id = "ready"
topic = "/ready"
[[alarm]]
id = "new"
text = "New"
[[alarm]]
id = "hot"
text = "Hot"
topic = "/heat"
type = "std_msgs/msg/Float64"
high = 80.0
[[alarm]]
id = "open"
text = "Open"
when = { topic = "/door", type = "std_msgs/msg/Bool", equals = false }
[[page]]
id = "cell"
title = "Cell"
[[page.widget]]
id = "go"
kind = "call"
label = "Go"
service = "/go"
type = "std_srvs/srv/Trigger"
interlock = "ready"
[[page.widget]]
id = "home"
kind = "call"
label = "Home"
service = "/home"
type = "std_srvs/srv/Trigger"
"""


def test_an_interlock_says_what_it_locks_and_can_lock_another_command() -> None:
    form = form_of(tomllib.loads(LOCKED), ("interlock", 0))
    assert [link.text for link in field_at(form, ("interlock", 0, "locks")).links] == ["go"]
    (choice,) = field_at(form, ("interlock", 0, "lock")).choices
    assert choice.text == "home"
    document = Document(LOCKED)
    document.apply([*map(edit_from, choice.value)], "")
    assert document.tables["page"][0]["widget"][1]["interlock"] == "ready"


def test_a_command_gets_an_interlock_of_its_own_from_its_form() -> None:
    field = field_at(form_of(tomllib.loads(LOCKED), ("page", 0, "widget", 0)), GO_LOCK)
    (act,) = field.acts
    document = Document(LOCKED)
    document.apply([*map(edit_from, act.edits)], "")
    assert document.tables["interlock"][1]["id"] == "interlock_1"
    assert value_at(document.tables, GO_LOCK) == ["ready", "interlock_1"]
    assert act.opens == ("interlock", 1)


GO_LOCK: Final = ("page", 0, "widget", 0, "interlock")


@pytest.mark.parametrize(
    ("number", "first", "there", "folded"),
    [
        (0, "form_section_value", {"topic", "when", "high"}, {"list"}),
        (1, "form_section_limits", {"topic", "high", "deadband"}, {"when", "stale_s"}),
        (2, "form_section_value", {"when", "priority"}, {"topic", "high", "deadband", "stale_s"}),
    ],
)
def test_the_form_of_an_alarm_begins_with_what_raises_it(
    number: int, first: str, there: set[str], folded: set[str]
) -> None:
    form = form_of(tomllib.loads(LOCKED), ("alarm", number))
    assert next(section.code for section in form.sections if section.code) == first
    shown = {f.key for s in form.sections if not s.folded for f in s.fields}
    shown |= {f.beside.key for s in form.sections if not s.folded for f in s.fields if f.beside}
    assert there <= shown
    assert not folded & shown


def test_texts_of_several_lines_have_a_field_for_them() -> None:
    action = field_at(form_of(tomllib.loads(LOCKED), ("alarm", 1)), ("alarm", 1, "action"))
    assert action.control == "texts"
    assert action.tall


@pytest.mark.parametrize(
    ("kind", "key"),
    [
        *(("readout", "topic"), ("call", "service"), ("number", "min"), ("trend", "pen")),
        *(("sequence", "steps"), ("label", "label"), ("page", "title"), ("group", "title")),
        *(("interlock", "topic"), ("condition", "topic"), ("alarm", "topic"), ("source", "topic")),
    ],
)
def test_the_field_to_fill_in_first(kind: str, key: str, tmp_path: FilePath) -> None:
    document = Document('[[page]]\nid = "page"\ntitle = "Page"\n[[page.group]]\ntitle = "Group"\n')
    at: Path = (
        ("page", 0, "group", 0, "widget", 0) if kind not in NO_WIDGETS else ("page", 0, "group", 1)
    )
    drop = added(kind, "A", document.tables, at)
    document.apply(map(edit_from, drop.edits), "added")
    faults = faults_of_text(document.text, tmp_path)
    form = form_of(document.tables, drop.select, faults=faults)
    assert form.needed == element_id((*drop.select, key))
