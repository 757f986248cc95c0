"""Two changed texts of one panel file become one, or name what both have changed."""

import tomllib
from typing import Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.tools.editor.document import (
    Delete,
    Document,
    Edit,
    EditError,
    Insert,
    Move,
    Rename,
    SetValue,
)
from app.tools.editor.merge import Choices, merge, merged_lines
from tests.support.form import several
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("panel file")

BASE: Final = """\
# The cell.
title = "Cell"
screens = ["1280x800"]

[[interlock]]
id = "ready"
topic = "/ready"

[[page]]
id = "cell"
title = "Cell"

[[page.group]]
title = "A"

# What starts.
[[page.group.widget]]
id = "start"
kind = "publish"
label = "Start"

[[page.group.widget]]
id = "stop"
kind = "publish"
label = "Stop" # red

[[page.group]]
title = "B"

[[page]]
id = "more"
title = "More"
"""
START: Final = ("page", 0, "group", 0, "widget", 0)
STOP: Final = ("page", 0, "group", 0, "widget", 1)


def changed(*edits: Edit, text: str = BASE) -> str:
    document = Document(text)
    document.apply(edits, "test")
    return document.text


@pytest.mark.parametrize(
    ("ours", "theirs"),
    [
        ((), (SetValue(("title",), "X"),)),
        ((SetValue(("title",), "X"),), (SetValue(("screens",), []),)),
        ((SetValue((*START, "label"), "Go"),), (SetValue((*STOP, "label"), "Halt"),)),
        ((SetValue((*START, "label"), "Go"),), (SetValue((*START, "kind"), "call"),)),
        ((SetValue((*START, "label"), "Go"),), (SetValue((*START, "label"), "Go"),)),
        ((SetValue((*START, "label"), "Go"),), (Delete(STOP),)),
        ((Delete(START),), (Delete(START),)),
        ((Delete(START),), (SetValue((*STOP, "label"), "Halt"),)),
        ((Insert(START, {"id": "a", "kind": "text"}),), (SetValue((*START, "label"), "Go"),)),
        ((SetValue((*START, "label"), "Go"),), (Insert(("page", 0), {"id": "new", "title": "N"}),)),
        ((Insert(("page", 2), {"id": "end", "title": "N"}),), (SetValue(("title",), "X"),)),
        ((SetValue(("title",), "X"),), (Insert(("page", 2), {"id": "end", "title": "N"}),)),
        ((SetValue((*START, "label"), "Go"),), (Move(("page", 0), ("page", 1)),)),
        ((Move(("page", 0), ("page", 1)),), (SetValue((*START, "label"), "Go"),)),
        ((SetValue(("page", 0, "group", 1, "title"), "C"),), (Delete(("page", 0, "group", 0)),)),
        ((Delete(("interlock", 0)),), (SetValue(("log",), {"days": 3}),)),
    ],
)  # fmt: skip
def test_what_one_side_has_changed_is_taken(ours: tuple[Edit, ...], theirs: tuple[Edit, ...]) -> None:
    merged = merge(BASE, changed(*ours), changed(*theirs))
    assert merged.conflicts == ()
    both = Document(changed(*theirs))
    for edit in ours:
        both.apply([follow(edit, both)], "ours")
    assert tomllib.loads(merged.text) == both.tables
    comments = [line for line in merged.text.splitlines() if line.startswith("#")]
    assert comments == [line for line in both.text.splitlines() if line.startswith("#")]


def follow(edit: Edit, document: Document) -> Edit:
    """The same edit in a file in which the tables of its path may be elsewhere, or are gone."""
    pages = [page["id"] for page in document.tables["page"]]
    if isinstance(edit, SetValue | Insert) and edit.path[:2] == ("page", 0) and len(edit.path) > 2:
        path = ("page", pages.index("cell"), *edit.path[2:])
        if path[2:4] == ("group", 1) and len(document.tables["page"][path[1]]["group"]) == 1:
            path = (*path[:2], "group", 0, *path[4:])
        return SetValue(path, edit.value) if isinstance(edit, SetValue) else Insert(path, edit.value)
    try:
        document.get(edit.path)
    except EditError:
        return SetValue(("title",), document.tables["title"]) if isinstance(edit, Delete) else edit
    is_there = isinstance(edit, Delete) and document.get(edit.path).get("id") != "start"
    return SetValue(("title",), document.tables["title"]) if is_there and edit.path == START else edit


@pytest.mark.parametrize(
    ("ours", "theirs", "name"),
    [
        (SetValue((*START, "label"), "Go"), SetValue((*START, "label"), "Los"),
         "page:cell/group[0]/widget:start"),
        (SetValue(("title",), "A"), SetValue(("title",), "B"), "keys"),
        (SetValue((*START, "label"), "Go"), Delete(START), "page:cell/group[0]/widget:start"),
        (Delete(START), SetValue((*START, "label"), "Go"), "page:cell/group[0]/widget:start"),
        (Insert(START, {"id": "new", "kind": "a"}), Insert(START, {"id": "new", "kind": "b"}),
         "page:cell/group[0]/widget:new"),
        (Delete(("page", 0)), SetValue((*STOP, "label"), "Halt"), "page:cell"),
    ],
)  # fmt: skip
def test_what_both_have_changed_is_a_conflict_until_one_is_chosen(
    ours: Edit, theirs: Edit, name: str
) -> None:
    sides = {"base": BASE, "ours": changed(ours), "theirs": changed(theirs)}
    texts = (sides["base"], sides["ours"], sides["theirs"])
    merged = merge(*texts)
    assert [conflict.name for conflict in merged.conflicts] == [name]
    assert merged.text == sides["ours"]
    (conflict,) = merged.conflicts
    assert len({conflict.base, conflict.ours, conflict.theirs}) == 3
    choices: list[Choices] = [{name: "ours"}, {name: "theirs"}, {name: "base"}]
    for choice in choices:
        chosen = merge(*texts, choice)
        assert chosen.conflicts == ()
        side = str(choice[name])
        assert tomllib.loads(chosen.text) == tomllib.loads(sides[side])
    if conflict.ours and conflict.theirs and name != "keys":
        other = conflict.ours.replace("[[", "# both\n[[", 1)
        chosen = merge(*texts, {name: (other,)})
        assert "# both\n[[" in chosen.text
        assert tomllib.loads(chosen.text) == tomllib.loads(sides["ours"])


def test_two_orders_are_a_conflict() -> None:
    base = BASE + '\n[[page]]\nid = "third"\ntitle = "3"\n'
    ours = changed(Move(("page", 0), ("page", 2)), text=base)
    theirs = changed(Move(("page", 0), ("page", 1)), text=base)
    merged = merge(base, ours, theirs)
    assert [conflict.name for conflict in merged.conflicts] == ["order of the file"]
    assert merge(base, ours, theirs, {"order of the file": "theirs"}).text == theirs
    assert merge(base, ours, theirs, {"order of the file": "ours"}).text == ours


def test_a_file_whose_tables_are_scattered_is_merged_by_its_lines() -> None:
    base = '[[page]]\nid = "a"\n\n[log]\ndays = 3\n\n[[page.widget]]\nid = "w"\n'
    ours, theirs = base.replace("3", "4"), base.replace('"w"', '"v"')
    assert (
        merge(base, ours, theirs).text
        == '[[page]]\nid = "a"\n\n[log]\ndays = 4\n\n[[page.widget]]\nid = "v"\n'
    )
    other = base.replace("3", "5")
    (conflict,) = merge(base, ours, other).conflicts
    assert conflict.name == "file"
    assert merge(base, ours, other, {"file": "theirs"}).text == other


def test_lines_are_merged_unless_both_change_the_same() -> None:
    base = "a\nb\nc\nd\n"
    assert merged_lines(base, "a\nB\nc\nd\n", "a\nb\nC\nd\n") == "a\nB\nC\nd\n"
    assert merged_lines(base, "a\nB\nc\nd\n", "a\nX\nc\nd\n") is None
    assert merged_lines(base, "a\nb\nc\nd\nour\n", "a\nb\nc\nd\ntheir\n") is None
    assert merged_lines(base, "x\na\nb\nc\nd\n", "a\nb\nc\nd\ny\n") == "x\na\nb\nc\nd\ny\n"


@pytest.mark.parametrize("name", ["palletizer.toml", "recipes.toml", "mobile-robot/panel.toml"])
@settings(max_examples=several(15, 300))
@given(data=st.data())
def test_changes_of_different_widgets_are_always_merged(name: str, data: st.DataObject) -> None:
    base = (ROOT / "docs/examples" / name).read_text()
    document = Document(base)
    widgets = [
        ("page", p, *path)
        for p, page in enumerate(document.tables["page"])
        for path in [
            *(("widget", w) for w in range(len(page.get("widget", ())))),
            *(
                ("group", g, "widget", w)
                for g, group in enumerate(page.get("group", ()))
                for w in range(len(group.get("widget", ())))
            ),
        ]
    ]
    first, second = data.draw(st.permutations(widgets).map(lambda order: order[:2]))
    label = data.draw(st.sampled_from(["x", "y"]))
    edits: list[Edit] = [
        SetValue((*second, "note"), "ä"), SetValue((*second, "label"), label), Delete(second),
        Rename(second, "renamed"), Insert((*second[:-1], 0), {"id": "new", "kind": "text"}),
    ]  # fmt: skip
    edit = data.draw(st.sampled_from(edits))
    try:
        theirs = changed(edit, text=base)
    except EditError:  # a widget of another page has no id
        return
    ours = changed(SetValue((*first, "label"), "ours"), text=base)
    expected = Document(theirs)
    at = first
    if isinstance(edit, Delete | Insert) and second[:-1] == first[:-1]:
        index, moved = int(str(first[-1])), isinstance(edit, Insert) or second[-1] < first[-1]  # type: ignore[operator]
        at = (*first[:-1], index + (1 if isinstance(edit, Insert) else -1) * moved)
    expected.apply([SetValue((*at, "label"), "ours")], "ours")
    for sides in ((ours, theirs), (theirs, ours)):
        merged = merge(base, *sides)
        if merged.conflicts:  # a reference to what was renamed is in the same table
            assert isinstance(edit, Rename)
            return
        assert tomllib.loads(merged.text) == expected.tables
        assert sorted(merged.text.split()) == sorted(expected.text.split())
