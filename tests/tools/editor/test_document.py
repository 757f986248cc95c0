"""Edits of a panel file: each makes of the text what it says, and leaves every other line as it is."""

import json
import re
import time
import tomllib
from collections.abc import Iterator
from copy import copy, deepcopy
from pathlib import Path as FilePath
from typing import Any, Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.panel.file.toml_lines import Path
from app.system.settings import PACKAGE
from app.tools.editor.document import (
    Delete,
    DiffLine,
    Document,
    Duplicate,
    Edit,
    EditError,
    Insert,
    Move,
    Rename,
    ReplaceText,
    SetValue,
    diff_lines,
    edit_from,
)
from app.tools.editor.references import owners
from tests.support.form import several
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("panel file")

FILES: Final = sorted(
    [
        *(ROOT / "docs/examples").glob("**/*.toml"),
        *(ROOT / "bench").glob("**/panel*.toml"),
        PACKAGE / "panel.toml",
        ROOT / "tests/everything.toml",
        ROOT / "tests/three_languages.toml",
    ]
)
SMALL: Final = """\
# The panel of cell 1.
title = "Cell"   # on the header
screens = ["1280x800", "1024x600"]

# What permits.
[[interlock]]
id = "ready"
topic = "/ready"
help.text.en = "Close it"
help.text.de = "Schließen"
# The end of the interlock.

# The pages.

# The first page.
[[page]]
id = "cell"
title = { en = "Cell", de = "Zelle" }

[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"

# Starts it.
[[page.widget]] # beside
id = "start"
kind = "publish"
label = "Start"
interlock = ["ready"]
# what is sent
message = { data = "{speed} {{x}}", list = [1, 2] }
states = [
  { value = 1, text = "One" }, # the first
  # above the second
  { value = 2, text = "Two" },
]
[page.widget.qos]
depth = 5

[[page]]
id = "second"
title = "Second"

[[page.group]]
title = "Group"

[[page.group.widget]]
same = "start"

[alarms]
sound = true

[access.oidc]
issuer = "https://id.example"
"""
START: Final = ("page", 0, "widget", 1)


def read(file: FilePath) -> str:
    return file.read_bytes().decode()


def edited(*edits: Edit, text: str = SMALL) -> str:
    document = Document(text)
    document.apply(edits, "test")
    assert document.tables == tomllib.loads(document.text)
    return document.text


def changed(*edits: Edit, text: str = SMALL) -> list[str]:
    """The lines that edits remove (-) and add (+)."""
    signs = {"removed": "-", "added": "+"}
    lines = diff_lines(text, edited(*edits, text=text))
    return [signs[line.kind] + line.text for line in lines if line.kind in signs]


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_a_file_without_edits_has_the_same_bytes_and_tables(file: FilePath) -> None:
    text = read(file)
    for written in (text, text.replace("\n", "\r\n"), "\ufeff" + text, text.rstrip("\n")):
        document = Document(written)
        assert document.data == written.encode()
        assert_in_order(document.tables, tomllib.loads(written.removeprefix("\ufeff")))


def assert_in_order(tables: Any, expected: Any) -> None:
    assert json.dumps(tables, default=str) == json.dumps(expected, default=str)


@pytest.mark.parametrize(
    ("edit", "lines"),
    [
        (
            SetValue(("title",), "Press"),
            ['-title = "Cell"   # on the header', '+title = "Press"   # on the header'],
        ),
        (SetValue(("title",), "Cell"), []),
        (SetValue((*START, "qos", "depth"), 6), ["-depth = 5", "+depth = 6"]),
        (
            SetValue((*START, "states", 1, "text"), "2"),
            ['-  { value = 2, text = "Two" },', '+  { value = 2, text = "2" },'],
        ),
        (
            SetValue(("page", 0, "title", "ja"), "セル"),
            [
                '-title = { en = "Cell", de = "Zelle" }',
                '+title = { en = "Cell", de = "Zelle", ja = "セル" }',
            ],
        ),
        (
            SetValue(("page", 1, "title"), {"en": "Second", "de": "Zwei"}),
            ['-title = "Second"', '+title = { en = "Second", de = "Zwei" }'],
        ),
        (
            SetValue(("interlock", 0, "help", "text", "de"), "Zu"),
            ['-help.text.de = "Schließen"', '+help.text.de = "Zu"'],
        ),
        (SetValue(("interlock", 0, "label"), "Ready"), ['+label = "Ready"']),
        (SetValue(("interlock", 0, "max_age_s"), 3.5), ["+max_age_s = 3.5"]),
        (
            SetValue((*START, "interlock", 1), "door"),
            ['-interlock = ["ready"]', '+interlock = ["ready", "door"]'],
        ),
        (
            SetValue((*START, "states"), [{"value": 1, "text": "One"}, {"value": 2, "text": "2"}]),
            ['-  { value = 2, text = "Two" },', '+  { value = 2, text = "2" },'],
        ),
        (SetValue(("alarms",), {"sound": True, "days": 30}), ["+days = 30"]),
        (SetValue(("access", "idle_s"), 60), ["+[access]", "+idle_s = 60", "+"]),
        (
            SetValue(("frame", "widget"), [{"kind": "call", "label": "Halt", "id": "halt"}]),
            ["+[[frame.widget]]", '+id = "halt"', '+kind = "call"', '+label = "Halt"', "+"],
        ),
        (SetValue(("log",), {"days": 3}), ["+[log]", "+days = 3", "+"]),
        (
            Delete((*START, "message")),
            ["-# what is sent", '-message = { data = "{speed} {{x}}", list = [1, 2] }'],
        ),
        (Delete((*START, "states", 1)), ["-  # above the second", '-  { value = 2, text = "Two" },']),
        (Delete((*START, "qos")), ["-[page.widget.qos]", "-depth = 5"]),
        (
            Delete(("interlock", 0)),
            [
                "-# What permits.",
                "-[[interlock]]",
                '-id = "ready"',
                '-topic = "/ready"',
                '-help.text.en = "Close it"',
                '-help.text.de = "Schließen"',
                "-# The end of the interlock.",
                "-",
            ],
        ),
        (
            Delete(("page", 1, "group", 0, "widget", 0)),
            ["-[[page.group.widget]]", '-same = "start"', "-"],
        ),
        (
            Insert(("page", 1, "group", 0, "widget", 0), {"kind": "readout", "id": "x"}),
            ["+[[page.group.widget]]", '+id = "x"', '+kind = "readout"', "+"],
        ),
        (
            Insert(("page", 1, "group", 1), {"title": "G", "widget": [{"id": "y"}]}),
            ["+[[page.group]]", '+title = "G"', "+", "+[[page.group.widget]]", '+id = "y"', "+"],
        ),
        (Insert((*START, "states", 0), {"value": 0, "text": "Z"}), ['+  { value = 0, text = "Z" },']),
        (
            Move(("page", 0, "widget", 0), ("page", 1, "group", 0, "widget", 1)),
            [
                "-[[page.widget]]",
                '-id = "speed"',
                '-kind = "number"',
                '-label = "Speed"',
                "-",
                "+[[page.group.widget]]",
                '+id = "speed"',
                '+kind = "number"',
                '+label = "Speed"',
                "+",
            ],
        ),
        (
            Move(START, (*START[:-1], 0)),
            [
                "-[[page.widget]]",
                '-id = "speed"',
                '-kind = "number"',
                '-label = "Speed"',
                "-",
                "+[[page.widget]]",
                '+id = "speed"',
                '+kind = "number"',
                '+label = "Speed"',
                "+",
            ],
        ),
        (
            Move((*START, "states", 0), (*START, "states", 1)),
            [
                '-  { value = 1, text = "One" }, # the first',
                '+  { value = 1, text = "One" }, # the first',
            ],
        ),
        (Move(("alarms", "sound"), ("alarms", "panel")), ["-sound = true", "+panel = true"]),
        (
            Rename(("page", 0, "widget", 0), "tempo"),
            [
                '-id = "speed"',
                '+id = "tempo"',
                '-message = { data = "{speed} {{x}}", list = [1, 2] }',
                '+message = { data = "{tempo} {{x}}", list = [1, 2] }',
            ],
        ),
        (Rename(START, "go"), ['-id = "start"', '+id = "go"', '-same = "start"', '+same = "go"']),
        (
            ReplaceText(("interlock", 0), '[[interlock]]\nid = "ready"\ntopic = "/r" # new'),
            [
                "-# What permits.",
                '-topic = "/ready"',
                '+topic = "/r" # new',
                '-help.text.en = "Close it"',
                '-help.text.de = "Schließen"',
                "-# The end of the interlock.",
            ],
        ),
        (
            ReplaceText((*START, "message"), 'message = { data = "x" }'),
            ['-message = { data = "{speed} {{x}}", list = [1, 2] }', '+message = { data = "x" }'],
        ),
        (
            ReplaceText(("interlock", 0, "help"), 'help.text = { en = "Shut it" }'),
            ['-help.text.en = "Close it"', '-help.text.de = "Schließen"', '+help.text.en = "Shut it"'],
        ),
        (
            ReplaceText(("interlock", 0, "help"), ""),
            ['-help.text.en = "Close it"', '-help.text.de = "Schließen"'],
        ),
    ],
)
def test_an_edit_changes_its_own_lines(edit: Edit, lines: list[str]) -> None:
    assert sorted(changed(edit)) == sorted(lines)


def test_a_table_that_goes_up_takes_its_comments_along() -> None:
    text = edited(Move(START, (*START[:-1], 0)))
    assert text.index("# Starts it.\n[[page.widget]] # beside") < text.index('id = "speed"')
    assert tomllib.loads(text)["page"][0]["widget"][1]["id"] == "speed"


def test_comments_that_stand_alone_stay() -> None:
    text = edited(Delete(("interlock", 0)), Delete(("page", 0)))
    assert "# The pages.\n" in text
    assert "# The first page." not in text


def test_a_copy_has_new_ids_and_its_references_name_them() -> None:
    document = Document(SMALL)
    document.apply([Duplicate(("page", 0), ("page", 1))], "copy")
    first, copy, third = document.tables["page"]
    assert [first["id"], copy["id"], third["id"]] == ["cell", "cell_2", "second"]
    assert [widget["id"] for widget in copy["widget"]] == ["speed_2", "start_2"]
    assert copy["widget"][1]["message"]["data"] == "{speed_2} {{x}}"
    assert copy["widget"][1]["interlock"] == ["ready"]
    assert first == tomllib.loads(SMALL)["page"][0]
    assert '# The first page.\n[[page]]\nid = "cell_2"' in document.text


@pytest.mark.parametrize(
    ("edit", "code"),
    [
        (SetValue((), 1), "edit_whole_file"),
        (SetValue(("page", 7, "id"), "x"), "edit_index"),
        (SetValue(("title", "en"), "x"), "edit_not_a_table"),
        (SetValue(("title",), None), "edit_value"),
        (SetValue(("page", 0), 5), "edit_needs_table"),
        (Delete(("page", 7)), "edit_no_place"),
        (Delete((*START, "states", 7)), "edit_no_place"),
        (Insert(("page", 3), {"id": "x"}), "edit_index"),
        (Insert((*START, "states", 5), {"value": 1}), "edit_index"),
        (Insert(("title", 0), 1), "edit_not_a_list"),
        (Insert(("alarms", "sound"), 1), "edit_not_a_list"),
        (Insert(("page", 0), 5), "edit_needs_table"),
        (Move(("page", 0), ("page", 0, "group", 0)), "edit_into_itself"),
        (Move(("page", 0), ("page", 2)), "edit_index"),
        (Move(("page", 0), ("title",)), "edit_move"),
        (Move(("alarms", "sound"), ("title",)), "edit_key_taken"),
        (Move(START, ("page", 1, "widget", 1)), "edit_index"),
        (Rename(("page", 1, "group", 0), "x"), "edit_no_id"),
        (Rename(("page", 0), "X y"), "edit_id_form"),
        (Rename(("page", 0), "second"), "edit_id_taken"),
        (ReplaceText((), "a = "), "edit_not_toml"),
        (ReplaceText(("page", 0), "[[page]"), "edit_not_toml"),
        (ReplaceText(("page", 0), "[[pages]]"), "edit_other_table"),
        (ReplaceText(("page", 0), "x = 1\n[[page]]"), "edit_other_table"),
        (ReplaceText(("page", 0), "[[page]]\n[[page]]"), "edit_other_table"),
        (ReplaceText(("page", 0), "[page]"), "edit_other_table"),
        (ReplaceText(("alarms",), "[[alarms]]"), "edit_other_table"),
        (ReplaceText(("page", 0), ""), "edit_other_table"),
        (ReplaceText((*START, "message"), "message = "), "edit_not_toml"),
        (ReplaceText((*START, "message"), "a = 1\nmessage = {}"), "edit_other_key"),
        (ReplaceText(("interlock", 0, "help"), "help = "), "edit_not_toml"),
        (ReplaceText(("interlock", 0, "help"), "a = 1\nhelp.text = {}"), "edit_other_key"),
    ],
)  # fmt: skip
def test_what_can_not_be_done_is_refused_and_changes_nothing(edit: Edit, code: str) -> None:
    document = Document(SMALL)
    with pytest.raises(EditError) as refused:
        document.apply([SetValue(("title",), "other"), edit], "test")
    assert getattr(refused.value.text, "code", None) == code
    assert (document.text, document.revision) == (SMALL, 0)


def test_edits_are_read_from_json() -> None:
    assert edit_from({"op": "set", "path": ["page", 0, "id"], "value": [1]}) == SetValue(
        ("page", 0, "id"), [1]
    )
    assert edit_from({"op": "move", "path": ["a", 0], "to": ["a", 1]}) == Move(("a", 0), ("a", 1))
    malformed: tuple[Any, ...] = (
        None, [], {}, {"op": "x"}, {"op": "set", "path": ["a"]}, {"op": "delete", "path": "a"},
        {"op": "delete", "path": [-1]}, {"op": "delete", "path": [True]},
        {"op": "delete", "path": [1.5]},
        {"op": "rename", "path": ["a"], "id": 1}, {"op": "text", "path": [], "text": None},
        {"op": "delete", "path": ["a"], "more": 1},
    )  # fmt: skip
    for data in malformed:
        with pytest.raises(EditError):
            edit_from(data)


def test_undo_and_redo() -> None:
    document = Document(SMALL)
    texts = [document.text]
    for number in range(300):
        document.apply([SetValue(("title",), f"Cell {number}")], f"step {number}")
        texts.append(document.text)
    for text in reversed(texts[:-1]):
        document.undo()
        assert document.text == text
    with pytest.raises(EditError):
        document.undo()
    for text in texts[1:]:
        document.redo()
        assert document.text == text
    with pytest.raises(EditError):
        document.redo()
    assert (document.revision, document.undo_label, document.redo_label) == (900, "step 299", None)
    document.undo()
    document.apply([Delete(("alarms",))], "other")
    assert document.redo_label is None


def test_a_file_that_is_not_toml_takes_only_another_text() -> None:
    document = Document("title = \n[[page]]\n")
    assert document.unreadable is not None
    assert document.unreadable.line == 1
    assert document.text == "title = \n[[page]]\n"
    with pytest.raises(EditError) as refused:
        document.apply([SetValue(("title",), "x")], "test")
    assert getattr(refused.value.text, "code", None) == "edit_unreadable"
    document.apply([ReplaceText((), "title = x\n")], "still wrong")
    document.apply([ReplaceText((), 'title = "x"\n')], "mended")
    assert document.unreadable is None
    assert document.tables == {"title": "x"}
    document.undo()
    assert document.text == "title = x\n"


def test_lines_and_texts() -> None:
    document = Document(SMALL)
    rows = SMALL.splitlines()
    for path, first, last in (
        (("title",), 'title = "Cell"   # on the header', 'title = "Cell"   # on the header'),
        (("interlock", 0), "[[interlock]]", "# The end of the interlock."),
        (("interlock", 0, "help"), 'help.text.en = "Close it"', 'help.text.de = "Schließen"'),
        (START, "[[page.widget]] # beside", "depth = 5"),
        ((*START, "states"), "states = [", "]"),
        ((*START, "states", 1), '  { value = 2, text = "Two" },', '  { value = 2, text = "Two" },'),
        (("page", 1), "[[page]]", 'same = "start"'),
        (("access", "oidc"), "[access.oidc]", 'issuer = "https://id.example"'),
        ((), rows[0], rows[-1]),
    ):  # fmt: skip
        begin, end = document.lines(path)
        assert (rows[begin - 1], rows[end - 1]) == (first, last), path
    assert document.lines(("page", 1))[0] > document.lines(START)[1]
    assert document.text_of(START).startswith("# Starts it.\n[[page.widget]] # beside\n")
    assert document.text_of(START).endswith("[page.widget.qos]\ndepth = 5\n")
    assert document.text_of((*START, "interlock")) == 'interlock = ["ready"]'
    assert document.text_of((*START, "states", 0)) == '{ value = 1, text = "One" }'
    assert document.text_of(("interlock", 0, "help", "text", "en")) == 'help.text.en = "Close it"'
    assert (
        document.text_of(("interlock", 0, "help", "text"))
        == 'text = { en = "Close it", de = "Schließen" }'
    )
    assert document.text_of(()) == SMALL
    with pytest.raises(EditError):
        document.text_of(("page", 5))
    with pytest.raises(EditError):
        document.lines(("page", 5))


def test_a_diff_has_the_lines_of_both_files_with_some_around() -> None:
    old = "".join(f"a{n} = {n}\n" for n in range(20))
    new = old.replace("a10 = 10\n", "a10 = 0\nb = 1\n").replace("a2 = 2\n", "")
    assert diff_lines(old, new) == [
        DiffLine("same", 1, "a0 = 0"), DiffLine("same", 2, "a1 = 1"), DiffLine("removed", 3, "a2 = 2"),
        DiffLine("same", 3, "a3 = 3"), DiffLine("same", 4, "a4 = 4"), DiffLine("same", 5, "a5 = 5"),
        DiffLine("gap", 6, ""),
        DiffLine("same", 7, "a7 = 7"), DiffLine("same", 8, "a8 = 8"), DiffLine("same", 9, "a9 = 9"),
        DiffLine("removed", 11, "a10 = 10"), DiffLine("added", 10, "a10 = 0"),
        DiffLine("added", 11, "b = 1"),
        DiffLine("same", 12, "a11 = 11"), DiffLine("same", 13, "a12 = 12"),
        DiffLine("same", 14, "a13 = 13"),
        DiffLine("gap", 15, ""),
    ]  # fmt: skip
    assert diff_lines(old, old) == []


# Random edits.

VALUES: Final[tuple[Any, ...]] = (
    "x", 'ä "b" \\ {c}', "", 5, -2.5, True, ["a", "b"], [], {}, {"en": "A", "de": "B"}, [[1, 2], [3]],
    [{"value": 1, "text": {"en": "x"}}, {"value": 2}], {"data": {"x": [1, 2]}},
)  # fmt: skip
TABLES: Final[tuple[dict[str, Any], ...]] = (
    {}, {"label": "L", "kind": "text", "id": "n"},
    {"title": "T", "widget": [{"id": "w", "x": {"y": 1}}]},
)  # fmt: skip


def walk(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    yield path, value
    inner: Any = ()
    if isinstance(value, dict):
        inner = value.items()
    elif isinstance(value, list):
        inner = enumerate(value)
    for step, item in inner:
        yield from walk(item, (*path, step))


def is_whole(document: Document, path: Path) -> bool:
    """Whether the lines of a table are together: no other table is between its own ones."""
    return bool(path) and (len(path) > 1 or document.text_of(path) in document.text)


def random_edit(draw: st.DrawFn, document: Document) -> Edit:
    known = [(path, value) for path, value in walk(document.tables) if is_whole(document, path)]
    lists = [(path, value) for path, value in known if isinstance(value, list) and value]
    kind = draw(st.sampled_from(("set", "add", "delete", "insert", "move", "carry", "text")))
    path, value = draw(st.sampled_from(known))
    if kind == "set":
        many = isinstance(path[-1], int) and isinstance(value, dict)
        return SetValue(path, draw(st.sampled_from(TABLES if many else VALUES)))
    if kind == "add":
        table = draw(st.sampled_from([p for p, v in known if isinstance(v, dict)]))
        key = draw(st.sampled_from(("id", "label", "new key", "qos", "zz")))
        return SetValue((*table, key), draw(st.sampled_from(VALUES)))
    if kind == "delete":
        return Delete(path)
    if kind == "text":
        return ReplaceText(path, "")
    path, items = draw(st.sampled_from(lists))
    index = draw(st.integers(0, len(items)))
    if kind == "insert":
        values = TABLES if isinstance(items[0], dict) else VALUES
        return Insert((*path, index), draw(st.sampled_from(values)))
    if kind == "carry":
        same = [(p, v) for p, v in lists if p[-1] == "widget" and isinstance(v[0], dict)]
        if len(same) > 1:
            (path, items), (to, others) = (draw(st.sampled_from(same)) for _ in range(2))
            if to[: len(path)] != path:
                return Move((*path, 0), (*to, draw(st.integers(0, len(others)))))
    return Move((*path, min(index, len(items) - 1)), (*path, draw(st.integers(0, len(items) - 1))))


def at(tables: Any, path: Path) -> Any:
    for step in path:
        tables = tables[step]
    return tables


def intended(tables: dict[str, Any], edit: Edit) -> dict[str, Any]:
    """The same edit of plain tables."""
    model = deepcopy(tables)
    around = at(model, edit.path[:-1])
    match edit:
        case SetValue(path, value):
            around[path[-1]] = value
        case Delete(path):
            del around[path[-1]]
        case Insert(path, value):
            around.insert(path[-1], value)
        case Move(path, to):
            moved = around.pop(path[-1])
            at(model, to[:-1]).insert(to[-1], moved)
    return model


def without_empty(value: Any) -> Any:
    """Without tables and lists that have nothing in them: those with headers go with their last one."""
    if isinstance(value, dict):
        inner = {key: without_empty(item) for key, item in value.items()}
        return {key: item for key, item in inner.items() if item not in ({}, [])}
    return [without_empty(item) for item in value] if isinstance(value, list) else value


def region(document: Document, path: Path) -> set[int]:
    """The lines of a table or key, with the comments above it; none if it is not there."""
    try:
        first, last = document.lines(path)
    except EditError:
        return set()
    rows = document.text.splitlines()
    while first > 1 and rows[first - 2].lstrip().startswith("#"):
        first -= 1
    return set(range(first, last + 1))


def outside(document: Document, *paths: Path) -> list[str]:
    """The lines outside of some tables and keys that are not blank."""
    inside = set().union(*(region(document, path) for path in paths))
    rows = enumerate(document.text.splitlines(), 1)
    return [row for number, row in rows if number not in inside and row.strip()]


def header(document: Document, path: Path) -> tuple[str, ...]:
    """The keys of the first header of a table; () for what has none."""
    try:
        row = document.text.splitlines()[document.lines(path)[0] - 1]
    except EditError:
        return ()
    if not re.match(r'\s*\[\[?[a-zA-Z"].*\]', row):
        return ()
    keys, inner = [], tomllib.loads(row)
    while inner:
        ((key, inner),) = inner.items()
        inner = inner[0] if isinstance(inner, list) else inner
        keys.append(key)
    return tuple(keys)


def scope(document: Document, path: Path) -> Path:
    """What of a path has lines of its own: a table or key that is in no value."""
    ends = (n for n in range(1, len(path)) if not header(document, path[:n]))
    return path[: next(ends, len(path))]


def scopes(before: Document, edit: Edit) -> tuple[list[Path], list[Path]]:
    """What may have other lines after an edit: before it and after it."""
    path = scope(before, edit.path)
    around = [path] if path != edit.path else []
    parent = edit.path[:-1]
    if isinstance(edit, Move):
        to = scope(before, edit.to)
        around += [to] if to != edit.to else []
        return [path, *around], [edit.to, *(after(edit, table) for table in around)]
    if around:
        return around, around
    if parent and header(before, parent) and header(before, parent) != keys_of(parent):
        return [parent], [parent]  # it gets a header of its own
    match edit:
        case Delete():
            return [path], []
        case Insert():
            return [], [path]
    return [path], [path]


def after(move: Move, path: Path) -> Path:
    """Where a table is that is not moved itself."""
    for (*around, at), by in ((move.path, -1), (move.to, 1)):
        n = len(around)
        step = path[n] if path[:n] == tuple(around) and n < len(path) else None
        if isinstance(step, int) and isinstance(at, int) and step >= at:
            path = (*around, step + by, *path[n + 1 :])
    return path


def keys_of(path: Path) -> Path:
    return tuple(step for step in path if isinstance(step, str))


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
@settings(max_examples=several(12, 300))
@given(data=st.data())
def test_random_edits_make_the_intended_tables_and_touch_no_other_line(
    file: FilePath, data: st.DataObject
) -> None:
    text = read(file)
    if data.draw(st.booleans()):
        text = text.replace("\n", "\r\n")
    document = Document(text)
    for _ in range(4):
        edit = data.draw(st.composite(lambda draw: random_edit(draw, document))())
        assert_edit(document, edit)
    while document.undo_label is not None:
        document.undo()
    assert document.data == text.encode()
    assert document.tables == tomllib.loads(text)


def assert_edit(document: Document, edit: Edit) -> None:
    before = copy(document)
    old = deepcopy(document.tables)
    if isinstance(edit, ReplaceText):
        edit = ReplaceText(edit.path, document.text_of(edit.path))
    document.apply([edit], "random")
    parsed = tomllib.loads(document.text)
    assert_in_order(document.tables, parsed)
    assert old == before.tables  # the tables before are never changed
    if isinstance(edit, ReplaceText):
        assert document.text == before.text
        return
    assert without_empty(parsed) == without_empty(intended(old, edit))
    old_scopes, new_scopes = scopes(before, edit)
    assert outside(before, *old_scopes) == outside(document, *new_scopes)


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_a_renamed_id_is_named_nowhere_and_comes_back(file: FilePath) -> None:
    text = read(file)
    document = Document(text)
    for owner in list(owners(document.tables)):
        places = document.references(owner.path)
        document.apply([Rename(owner.path, "renamed_here")], "rename")
        renamed = document.references(owner.path)
        assert len(renamed) == len(places)
        assert document.tables == tomllib.loads(document.text)
        document.apply([Rename(owner.path, owner.id)], "back")
        assert document.text == text


def large_panel(pages: int, widgets: int) -> str:
    """A panel with many widgets."""
    head, _, _ = read(ROOT / "docs/examples/palletizer.toml").partition("[[page]]")
    widget = (
        '[[page.group.widget]]\nid = "w{0}"\nkind = "publish"\nrole = "start"\n'
        'label = {{ en = "Start {0}", ja = "起動", de = "Start" }}\ntopic = "/operation1"\n'
        'type = "std_msgs/msg/String"\nmessage = {{ data = "start" }}\ninterlock = "automatic"\n'
        "states = [\n"
        '  {{ value = true, text = {{ en = "Permitted", ja = "許可" }}, shape = "circle" }},\n'
        '  {{ value = false, text = {{ en = "Off", ja = "不許可" }}, colour = "red" }},\n]\n\n'
    )
    page = '[[page]]\nid = "p{0}"\ntitle = "Page"\n\n[[page.group]]\ntitle = "Group"\n\n'
    return head + "".join(
        page.format(p) + "".join(widget.format(p * widgets + w) for w in range(widgets))
        for p in range(pages)
    )


def test_an_edit_of_a_large_panel_takes_a_fraction_of_reading_it() -> None:
    text = large_panel(16, 20)
    assert len(text) > 120_000
    start = time.process_time()
    tomllib.loads(text)
    whole = time.process_time() - start
    document = Document(text)
    path: Path = ("page", 7, "group", 0, "widget", 9)
    edits: tuple[Edit, ...] = (
        SetValue((*path, "label", "en"), "Go"), Delete(path), Insert(path, {"id": "n", "kind": "text"}),
        Move(path, ("page", 2, "group", 0, "widget", 1)), ReplaceText(path, document.text_of(path)),
    )  # fmt: skip
    for edit in edits:
        taken = []
        for _ in range(5):
            start = time.process_time()
            document.apply([edit], "edit")
            assert document.text
            taken.append(time.process_time() - start)
            document.undo()
        assert min(taken) < whole / 5, edit


def test_tables_beside_an_edit_are_the_same_objects() -> None:
    document = Document(large_panel(5, 3))
    before = document.tables
    document.apply([SetValue(("page", 2, "group", 0, "widget", 1, "label"), "x")], "set")
    document.apply([Delete(("page", 2, "group", 0, "widget", 0))], "delete")
    document.apply([Insert(("page", 0), {"id": "new", "title": "New"})], "insert")
    text = document.text.replace('title = "New"', 'title = "Newer"')
    document.apply([ReplaceText((), text)], "as text")
    after = document.tables
    assert after["interlock"] is before["interlock"]
    same = [any(page is each for each in before["page"]) for page in after["page"]]
    assert same == [False, True, True, False, True, True]
