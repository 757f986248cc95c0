"""Edits of the keys of one table, in its own text: the lines of other keys, comments and the way in
which values are written stay. The only module that imports tomlrt.

A path begins at the table: ("label", "en"), ("states", 2, "text"). Each function returns the new text.
"""

from typing import Any, Final, cast

import tomlrt
from tomlrt import AoT, Array, Document, Table

from app.panel.file.toml_lines import Path, layout_of
from app.system.toml_values import key_text, value_text
from app.tools.editor.sections import FIRST, written

Container = Document | Table | Array


class NoPlace(LookupError):
    """A path that leads to nothing; its argument is the part of the path up to the step that is not
    there."""


def set_value(body: str, path: Path, value: Any) -> str:
    """A key or element gets a value; a key that is not there is added. Of a table or a list, only the
    keys and elements that differ are written."""
    if len(path) == 1 and path[0] in FIRST and path[0] not in (table := tomlrt.loads(body)):
        return _with_first_key(body, str(path[0]), value, list(table))
    table = tomlrt.loads(body)
    _put(_container(table, path), path[-1], value, len(path) == 1)
    return tomlrt.dumps(table)


def delete_value(body: str, path: Path) -> str:
    """Without a key or an element, with its comments."""
    table = tomlrt.loads(body)
    container = _container(table, path)
    if not _has(container, path[-1]):
        raise NoPlace(path)
    del cast(Any, container)[path[-1]]
    return tomlrt.dumps(table)


def insert_value(body: str, path: Path, value: Any) -> str:
    """With a further element; the path ends with its index."""
    table = tomlrt.loads(body)
    container = _container(table, path)
    index = path[-1]
    if not isinstance(container, Array) or not isinstance(index, int) or index > len(container):
        raise NoPlace(path)
    container.insert(index, _toml(value))
    return tomlrt.dumps(table)


def move_value(body: str, path: Path, index: int) -> str:
    """With an element at another index of its list, with its comments."""
    table = tomlrt.loads(body)
    array = _container(table, path)
    at = path[-1]
    if not isinstance(array, Array) or not isinstance(at, int):
        raise NoPlace(path)
    if max(at, index) >= len(array):
        raise NoPlace((*path[:-1], max(at, index)))
    value = _toml(_plain(array[at]))
    beside, above = array.comments.get(at), array.leading_comments.get(at)
    del array[at]
    array.insert(index, value)
    if above:
        array.leading_comments[index] = above
    if beside:
        array.comments[index] = beside
    return tomlrt.dumps(table)


def replace_value(body: str, path: Path, text: str) -> str:
    """With another text of a key with its value, or of an element. What is written with dots is in no
    one place: its keys get the values of the text."""
    span = layout_of(body).spans.get(path)
    if span is not None:
        return body[: span.start] + text + body[span.end :]
    values = tomlrt.loads(text).to_dict()
    if path[-1] not in values:
        body = delete_value(body, path)
    for key, value in values.items():
        body = set_value(body, (*path[:-1], key), value)
    return body


def is_same(first: Any, second: Any) -> bool:
    """Whether two values are the same for a panel: 1 is 1.0, but not true."""
    if isinstance(first, dict) and isinstance(second, dict):
        return first.keys() == second.keys() and all(is_same(first[k], second[k]) for k in first)
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(is_same, first, second))
    is_bool = isinstance(first, bool) is isinstance(second, bool)
    as_text = isinstance(first, str) is isinstance(second, str)
    return is_bool and as_text and bool(first == second)


def aligned(old: list[Any], new: list[Any]) -> tuple[int, int]:
    """How many elements are the same at the beginning and at the end of two lists."""
    most = min(len(old), len(new))
    begin = next((n for n in range(most) if not is_same(old[n], new[n])), most)
    rest = most - begin
    return begin, next((n for n in range(rest) if not is_same(old[-1 - n], new[-1 - n])), rest)


def _plain(value: Any) -> Any:
    """Of Python's own types."""
    if isinstance(value, Table):
        return value.to_dict()
    return value.to_list() if isinstance(value, Array | AoT) else value


def _toml(value: Any, begins: int = 0, *, several_lines: bool = False) -> Any:
    """A value for tomlrt, written in the style of the examples."""
    text = written(value, begins) if several_lines else value_text(value)
    return tomlrt.loads(f"_ = {text}")["_"]


def _has(container: Container, step: str | int) -> bool:
    if isinstance(container, Array):
        return isinstance(step, int) and 0 <= step < len(container)
    return step in container


def _container(table: Document, path: Path) -> Container:
    """The table or list that has the last step of a path."""
    node: Any = table
    for n, step in enumerate(path[:-1]):
        if not isinstance(node, Document | Table | Array) or not _has(node, step):
            raise NoPlace(path[: n + 1])
        node = cast(Any, node)[step]
    if not isinstance(node, Document | Table if isinstance(path[-1], str) else Array):
        raise NoPlace(path)
    return node


def _put(container: Container, step: str | int, value: Any, several_lines: bool) -> None:
    place = cast(Any, container)
    if isinstance(container, Array) and not _has(container, step):
        raise NoPlace((step,))
    old = place[step] if _has(container, step) else None
    if isinstance(old, Table) and isinstance(value, dict) and value and old:
        for key in [key for key in old if key not in value]:
            if len(old) > 1:  # a table of dotted keys goes with its last one
                del old[key]
            else:
                place[step] = _toml(value)
                return
        for key, item in value.items():
            _put(old, key, item, several_lines=False)
    elif isinstance(old, Array) and isinstance(value, list) and value and old:
        _put_elements(old, value)
    elif old is None or not is_same(_plain(old), value):
        if isinstance(old, float) and type(value) is int:
            value = float(value)
        place[step] = _toml(value, len(str(step)) + 3, several_lines=several_lines)


def _put_elements(array: Array, new: list[Any]) -> None:
    """An element that is the same before and after stays with its comments."""
    begin, end = aligned(_plain(array), new)
    middle = new[begin : len(new) - end]
    for n, value in enumerate(middle):
        at = begin + n
        if at < len(array) - end:
            _put(array, at, value, several_lines=False)
        else:
            array.insert(at, _toml(value))
    while len(array) > len(new):
        del array[len(array) - end - 1]


def _with_first_key(body: str, key: str, value: Any, present: list[str]) -> str:
    """With a key that an author reads first: after those that come before it, above all others."""
    before = [name for name in FIRST[: FIRST.index(key)] if name in present]
    layout = layout_of(body)
    ends = [span.end for _, name, span in layout.pairs if name in before]
    starts = [span.start for _, _, span in layout.pairs]
    if ends:
        at = body.find("\n", max(ends)) + 1 or len(body)
    else:
        at = body.rfind("\n", 0, min(starts)) + 1 if starts else 0
        while at and body[body.rfind("\n", 0, at - 1) + 1 :].lstrip(" \t").startswith("#"):
            at = body.rfind("\n", 0, at - 1) + 1
    newline = "\r\n" if "\r\n" in body else "\n"
    line = f"{key_text(key)} = {written(value, len(key) + 3)}".replace("\n", newline)
    ahead = newline if at == len(body) and body and not body.endswith("\n") else ""
    return f"{body[:at]}{ahead}{line}{newline}{body[at:]}"


PARSE_ERRORS: Final = (tomlrt.TOMLError, ValueError, RecursionError)
