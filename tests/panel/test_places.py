"""Where in its file something of a panel stands."""

import tomllib
from typing import Any, Final

import pytest

from app.panel.file.keys import add_locations, id_at, lines_in, place_of
from app.panel.file.toml_lines import Path
from app.system.errors import Fault, Note

TEXT: Final = """title = "Cell"
interfaces = [
  "a",
  "b",
]

[[interlock]]
id = "operation"

[[page]]
id = "one"
[[page.widget]]
id = "speed"
message.linear = { x = 1, y = [1, 2] }
states = [
  { value = 1 },
]
[[page.widget]]
id = 5
"a b" = 1
[[page]]
"""
TABLES: Final[dict[str, Any]] = tomllib.loads(TEXT)


@pytest.mark.parametrize(
    ("path", "place"),
    [
        ((), ""),
        (("title",), "title"),
        (("page", 0, "widget", 2, "topic"), "page[0].widget[2].topic"),
        (("record", "topics", 1), "record.topics[1]"),
    ],
)
def test_a_path_is_written_as_a_place(path: Path, place: str) -> None:
    assert place_of(path) == place


@pytest.mark.parametrize(
    ("place", "where"),
    [
        ("", ""),
        ("title", "title, line 1"),
        ("mode", "mode"),
        ("interfaces", "interfaces, line 2"),
        ("interfaces[1]", "interfaces[1], line 4"),
        ("interlock[0].topic", 'interlock[0].topic "operation", line 7'),
        ("page[0]", 'page[0] "one", line 10'),
        ("page[0].title", 'page[0].title "one", line 10'),
        ("page[0].widget[0]", 'page[0].widget[0] "speed", line 12'),
        ("page[0].widget[0].id", 'page[0].widget[0].id "speed", line 13'),
        ("page[0].widget[0].topic", 'page[0].widget[0].topic "speed", line 12'),
        ("page[0].widget[0].message", 'page[0].widget[0].message "speed", line 14'),
        ("page[0].widget[0].message.linear.z", 'page[0].widget[0].message.linear.z "speed", line 14'),
        (
            "page[0].widget[0].message.linear.y[5]",
            'page[0].widget[0].message.linear.y[5] "speed", line 14',
        ),
        ("page[0].widget[0].states[0].text", 'page[0].widget[0].states[0].text "speed", line 16'),
        ("page[0].widget[0].states[3]", 'page[0].widget[0].states[3] "speed", line 15'),
        ("page[0].widget[1].topic", "page[0].widget[1].topic, line 18"),
        ("page[0].widget[1].a b", "page[0].widget[1].a b, line 20"),
        ("page[1].title", "page[1].title, line 21"),
        ("page[1].widget[0].id", "page[1].widget[0].id, line 21"),
        ("page[7].widget[0].id", "page[7].widget[0].id, line 10"),
    ],
)
def test_a_place_has_its_id_and_its_line(place: str, where: str) -> None:
    (fault,) = add_locations([Fault(place, "is wrong")], lines_in(TEXT), TABLES)
    assert fault.location == where
    assert str(fault) == (f"{where}: is wrong" if where else "is wrong")


def test_known_line_is_not_replaced() -> None:
    (note,) = add_locations([Note("page[0]", "is long", id="mine", line=7)], lines_in(TEXT), TABLES)
    assert str(note) == 'note: page[0] "mine", line 7: is long'


@pytest.mark.parametrize(
    "tables",
    [{}, {"page": 5}, {"page": {"a": 1}}, {"page": [5]}, {"page": [{"widget": {}}]}],
)
def test_tables_of_any_shape_have_no_id(tables: Any) -> None:
    assert id_at("page[0].widget[0].topic", tables) == ""


def test_an_id_is_no_longer_than_an_id_may_be() -> None:
    assert id_at("interlock[0]", {"interlock": [{"id": "x" * 1000}]}) == "x" * 64


def test_too_deeply_nested_place_is_reported_without_lines() -> None:
    text = "a = " + "[" * 3000 + "]" * 3000
    (fault,) = add_locations([Fault("a", "is wrong")], lines_in(text), {})
    assert fault.line == 0
