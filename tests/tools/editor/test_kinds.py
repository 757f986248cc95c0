"""What can be added without the robot's list."""

import tomllib
from typing import Any, Final

import pytest

from app.panel.reference.schema import WORDS
from app.panel.widgets.kinds import KINDS
from app.system.pictures import icons
from app.system.texts import render
from app.tools.editor.kinds import FAMILIES, FAMILY_NAMES, NO_WIDGETS, PLACELESS, added, place_near

EVERY: Final = [kind for family in FAMILIES.values() for kind in family]
GROUP: Final = ("page", 0, "group", 0)
TABLES: Final[dict[str, Any]] = tomllib.loads("""
[[page]]
id = "page"
[[page.group]]
[[page.group.widget]]
id = "gauge"
""")


def test_each_kind_of_widgets_is_there_once_with_a_name_and_an_icon() -> None:
    names = [kind.table for kind in EVERY]
    assert sorted({*names} - {*NO_WIDGETS}) == sorted(KINDS)
    assert len(names) == len({*names})
    assert {kind.icon for kind in EVERY} <= {*icons()}
    for tag in ("en", "ja", "de"):
        assert all(render(kind.name, tag) for kind in EVERY)
    assert FAMILIES.keys() == FAMILY_NAMES.keys()


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.table)
def test_the_reference_says_what_a_kind_is_for(kind: Any) -> None:
    assert {kind.table, f"{kind.table}_widget"} & WORDS["tables"].keys()


@pytest.mark.parametrize(
    ("kind", "at", "edit"),
    [
        (
            "gauge",
            ("page", 0, "group", 0, "widget", 1),
            {"id": "gauge_2", "kind": "gauge", "label": "A"},
        ),
        ("group", ("page", 0, "group", 1), {"title": "A"}),
        ("page", ("page", 1), {"id": "page_2", "title": "A"}),
        ("alarm", ("alarm", 0), {"id": "alarm", "text": "A"}),
        ("interlock", ("interlock", 0), {"id": "interlock", "label": "A"}),
        ("source", ("source", 0), {"id": "source"}),
    ],
)
def test_an_added_table_has_an_id_of_its_own(kind: str, at: Any, edit: Any) -> None:
    drop = added(kind, "A", TABLES, at)
    assert drop.edits == [{"op": "insert", "path": [*at], "value": edit}]
    assert drop.select == at


@pytest.mark.parametrize("kind", EVERY, ids=lambda kind: kind.table)
def test_what_has_no_place_on_a_page_is_added_behind_its_like(kind: Any) -> None:
    name = kind.table
    at = place_near(TABLES, (), "page", group=name == "group")
    select = added(name, "A", TABLES, at).select
    assert select == ((name, len(TABLES.get(name, ()))) if name in PLACELESS else at)


VALUE: Final[dict[str, Any]] = tomllib.loads("""
[[page]]
id = "page"
[[page.widget]]
id = "air"
kind = "gauge"
label = "Air"
topic = "/air"
type = "std_msgs/msg/Float64"
field = "data"
unit = "bar"
scale = 0.01
min = 0
max = 10
[[page.widget]]
id = "start"
kind = "call"
service = "/start"
type = "std_srvs/srv/Trigger"
[[page.widget]]
id = "note"
kind = "label"
label = "Note"
""")


@pytest.mark.parametrize(
    ("kind", "number", "keys", "locked"),
    [
        (
            "alarm",
            0,
            {
                "topic": "/air",
                "type": "std_msgs/msg/Float64",
                "field": "data",
                "scale": 0.01,
                "unit": "bar",
            },
            False,
        ),
        ("alarm", 1, {}, False),
        ("alarm", 2, {}, False),
        ("interlock", 0, {}, False),
        ("interlock", 1, {}, True),
        ("condition", 1, {}, False),
    ],
)
def test_an_alarm_is_about_the_value_and_an_interlock_locks_the_command_it_is_dropped_on(
    kind: str, number: int, keys: dict[str, Any], locked: bool
) -> None:
    on = ("page", 0, "widget", number)
    first, *others = added(kind, "A", VALUE, (), on).edits
    named = {"id": kind, "text" if kind == "alarm" else "label": "A"}
    assert first == {"op": "insert", "path": [kind, 0], "value": named | keys}
    lock = {"op": "set", "path": [*on, "interlock"], "value": "interlock"}
    assert others == ([lock] if locked else [])


PAGES: Final[dict[str, Any]] = tomllib.loads("""
[[page]]
id = "a"
[[page.group]]
[[page.group.widget]]
id = "x"
[[page.group.widget]]
id = "y"
[[page.group]]
[[page]]
id = "b"
[[page.widget]]
id = "z"
[[page]]
id = "c"
""")


@pytest.mark.parametrize(
    ("near", "page", "place"),
    [
        ((), "", ("page", 0, "group", 0, "widget", 2)),
        ((), "b", ("page", 1, "widget", 1)),
        ((), "c", ("page", 2, "widget", 0)),
        (("page", 0, "group", 0, "widget", 0), "b", ("page", 0, "group", 0, "widget", 1)),
        (("page", 0, "group", 1), "", ("page", 0, "group", 1, "widget", 0)),
        (("page", 1, "widget", 0), "", ("page", 1, "widget", 1)),
        (("interlock", 0), "b", ("page", 1, "widget", 1)),
        (("page", 7), "b", ("page", 1, "widget", 1)),
    ],
)
def test_a_widget_is_added_near_what_is_selected(near: Any, page: str, place: Any) -> None:
    assert place_near(PAGES, near, page) == place


@pytest.mark.parametrize(
    ("near", "place"),
    [
        ((), ("page", 0, "group", 2)),
        (("page", 0, "group", 0, "widget", 1), ("page", 0, "group", 1)),
        (("page", 1), ("page", 1, "group", 0)),
    ],
)
def test_a_group_is_added_behind_the_selected(near: Any, place: Any) -> None:
    assert place_near(PAGES, near, "a", group=True) == place
