"""The table of keys that name an id has each such key of the panel file."""

import tomllib
from collections.abc import Iterator, Mapping
from typing import Any, Final

import pytest

from app.panel.base import ID
from app.panel.reference.schema import WIDGET, kinds_of, models, panel_schema
from app.panel.template import placeholders
from app.tools.editor import form_keys
from app.tools.editor.document import Document, Rename
from app.tools.editor.references import (
    FREE_FORM,
    OWNERS,
    REFERENCES,
    free_id,
    owner_at,
    owners,
    references,
    taken_ids,
)
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("panel file")

SCHEMA: Final = panel_schema()
TABLES: Final[Mapping[str, Any]] = {
    "panel": SCHEMA,
    **{name: table for name, table in SCHEMA["definitions"].items() if name != WIDGET},
}
# Keys with ids that are in no other table, and free tables in which no id is filled in.
NO_REFERENCES: Final = {
    "access.groups", "demo.message", "demo.response", "demo.result", "demo.parameters",
    "options_from.request",
}  # fmt: skip
# Keys that the schema does not show as ids: by the functions that check them.
CHECKS: Final = ("_parse_interlocks", "_check_name")


def inner(schema: Any) -> Iterator[Mapping[str, Any]]:
    if isinstance(schema, dict):
        yield schema
        for key, value in schema.items():
            if key != "definitions":
                yield from inner(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from inner(value)


def names_ids(schema: Mapping[str, Any]) -> bool:
    parts = list(inner(schema))
    return any(
        part.get("pattern") == ID or ID in part.get("patternProperties", {}) for part in parts
    ) or any(str(part.get("title", "")).startswith("id of") for part in parts)


def is_free_form(schema: Mapping[str, Any]) -> bool:
    return any(
        part.get("type") == "object" and part.get("additionalProperties") is True
        for part in inner(schema)
    )


def keys() -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    for name, table in TABLES.items():
        for key, schema in table["properties"].items():
            if "$ref" not in str(schema):
                yield name, key, schema


def test_each_key_that_names_an_id_is_in_the_table() -> None:
    named = {
        f"{name}.{key}"
        for name, key, schema in keys()
        if key != "id" and (names_ids(schema) or is_free_form(schema))
    }
    named |= {
        f"{name}.{field.alias or key}"
        for name, model in models().items()
        for key, field in model.model_fields.items()
        if any(check in f"{field.annotation}{field.metadata}" for check in CHECKS)
    }
    assert {"alarm.inhibits", "sequence.fault", "place_widget.map", "hold.release"} <= named
    in_each = {row.removeprefix("*.") for row in REFERENCES if row.startswith("*.")}
    missing = {
        row for row in named - NO_REFERENCES - REFERENCES.keys() if row.split(".")[1] not in in_each
    }
    assert missing == set()


def test_the_table_has_only_keys_of_the_panel_file() -> None:
    known = {f"{name}.{key}" for name, table in TABLES.items() for key in table["properties"]}
    known |= {f"*.{key}" for _, key, _ in keys()}
    assert REFERENCES.keys() - known == set()


def test_a_form_offers_the_ids_of_each_such_key() -> None:
    by_text = [row.split(".") for row, (form, _) in REFERENCES.items() if form in ("id", "control")]
    assert [key for table, key in by_text if form_keys.references(table, key) is None] == []


def test_each_table_with_an_id_is_known() -> None:
    with_id = {name for name, table in TABLES.items() if "id" in table["properties"]}
    assert with_id - kinds_of(TABLES).keys() == {keys[-1] for keys in OWNERS} - {"widget"}


def test_what_is_free_of_keys_is_not_searched() -> None:
    free = {key for _, key, schema in keys() if is_free_form(schema)}
    assert {key for key in free if not any(row.endswith(f".{key}") for row in REFERENCES)} <= {
        *FREE_FORM, "response", "result",
    }  # fmt: skip


TEXT: Final = """\
access.groups = ["fitters"]
[[robot]]
id = "left"
[[source]]
id = "oven"
[[interlock]]
id = "ready"
source = "oven"
robot = "left"
[[condition]]
id = "air"
[[alarm]]
id = "hot"
source = "oven"
inhibits = ["go", "left/go", "*/go"]
ack_command = "go"
ack_input = "speed"
needs = "fitters"
[[place]]
id = "dock"
level = "ground"
[[recipe]]
id = "boxes"
fields = ["speed"]
interlock = "ready"
request = { v = ["{speed}"] }
[recipe.parameters]
speed = "v"
[recipe.readback]
parameters = { speed = "v" }
[demo]
"/x" = { message = { data = "{speed}" } }
[[page]]
id = "cell"
robot = "left"
[[page.widget]]
id = "speed"
kind = "number"
[[page.widget]]
id = "go"
kind = "publish"
interlock = ["ready", "air"]
message = { data = "{{speed}} {speed} {speed.x} {other}" }
confirm = { source = "oven", equals = "{speed}" }
[[page.widget]]
id = "stick"
kind = "joystick"
interlock = "air"
message = { x = "{x}", z = "{speed}" }
[[page.widget]]
id = "hall"
kind = "map"
level = [{ id = "ground" }]
plan = { src = "x.svg", level = "ground" }
[[page.widget]]
id = "goal"
kind = "place"
map = "hall"
places = ["dock"]
[[page.widget]]
id = "list"
kind = "conditions"
conditions = ["air", "ready"]
[[page.widget]]
id = "steps"
kind = "sequence"
fault = ["air"]
alarms = ["hot"]
steps = [{ text = "x", condition = "ready" }]
recovery = [{ text = "y", condition = "air" }]
[[page]]
id = "more"
[[page.group]]
needs = "fitters"
[[page.group.widget]]
same = "go"
[[page.group.widget]]
id = "back"
kind = "link"
page = "cell"
"""


@pytest.mark.parametrize(
    ("path", "places"),
    [
        (("robot", 0), 3),
        (("source", 0), 3),
        (("interlock", 0), 4),
        (("condition", 0), 5),
        (("alarm", 0), 1),
        (("place", 0), 1),
        (("recipe", 0), 0),
        (("access", "groups", 0), 2),
        (("page", 0), 1),
        (("page", 0, "widget", 0), 8),
        (("page", 0, "widget", 1), 5),
        (("page", 0, "widget", 3), 1),
        (("page", 0, "widget", 3, "level", 0), 2),
        (("page", 1, "group", 0, "widget", 0), 0),
    ],
)
def test_an_id_is_renamed_where_it_is_named(path: Any, places: int) -> None:
    document = Document(TEXT)
    assert len(document.references(path)) == places
    owner = owner_at(document.tables, path)
    if owner is None:
        return
    document.apply([Rename(path, "new")], "rename")
    assert document.tables == tomllib.loads(document.text)
    assert len(document.references(path)) == places
    named = [text for _, text in texts(document.tables) if owner.id == text]
    named += [name for _, name in placeholders(list(texts(document.tables["page"])))]
    assert owner.id not in named
    document.apply([Rename(path, owner.id)], "back")
    assert document.text == TEXT


def texts(value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, str):
        yield "", value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield key, key
            yield from texts(item)
    elif isinstance(value, list):
        for item in value:
            yield from texts(item)


def test_braces_that_are_text_stay() -> None:
    document = Document(TEXT)
    document.apply([Rename(("page", 0, "widget", 0), "v")], "rename")
    widgets = document.tables["page"][0]["widget"]
    assert widgets[1]["message"]["data"] == "{{speed}} {v} {v.x} {other}"
    assert widgets[2]["message"] == {"x": "{x}", "z": "{v}"}
    assert document.tables["demo"]["/x"]["message"]["data"] == "{speed}"


def test_every_reference_of_the_panel_with_each_key_leads_to_a_table_or_to_a_name_of_the_file() -> None:
    tables = tomllib.loads((ROOT / "tests/everything.toml").read_text())
    taken = taken_ids(tables)
    named = list(references(tables))
    assert len({reference.form for reference, _ in named}) == 4
    assert len(list(owners(tables))) == sum(map(len, taken.values()))


def test_the_next_free_id() -> None:
    assert free_id("start", {"start", "start_2"}) == "start_3"
    assert free_id("start_2", {"start", "start_2"}) == "start_3"
    assert free_id("start", {"stop"}) == "start"
    assert len(free_id("a" * 64, {"a" * 64})) == 64
