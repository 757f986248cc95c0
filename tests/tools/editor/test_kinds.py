"""What can be added without the robot's list."""

import tomllib
from typing import Any, Final

import pytest

from app.panel.reference.schema import WORDS
from app.panel.widgets.kinds import KINDS
from app.system.icons import icons
from app.system.texts import render
from app.tools.editor.kinds import FAMILIES, FAMILY_NAMES, NO_WIDGETS, added, place_near

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
