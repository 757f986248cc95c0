"""The repair of a fault where there is exactly one: the sentence of the fault names it, and the file is
better with it. Pure."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Final

from app.panel.file.keys import path_of
from app.panel.file.toml_lines import Path
from app.system.errors import Fault, Note, Remark

Tables = Mapping[str, Any]
# The remarks about tables: faults, and notes if there is no fault.
Check = Callable[[Tables], Sequence[Remark]]

_MEANT: Final = re.compile(r'did you mean (?:"([^"]+)"|([^\s"?]+))\?')
_NAMED: Final = re.compile(r'"([^"]+)"')
_ADDED: Final = re.compile(r'\badd (\w+) = (true|false|"[^"]*")(?:,? in the question)?$')


@dataclass(frozen=True, slots=True)
class Repair:
    """Edits of a document as JSON, and in few words what they do, as TOML has it."""

    edits: Sequence[Mapping[str, Any]]
    words: str


def repair_of(remark: Remark, tables: Tables, check: Check) -> Repair | None:
    """The repair of a fault or note; None where there is none, or several, or it does not help."""
    repairs = list(_repairs(remark, tables))
    if len(repairs) != 1:
        return None
    mended = deepcopy(dict(tables))
    for edit in repairs[0].edits:
        _apply(mended, edit)
    return repairs[0] if _is_better(check(tables), check(mended), remark) else None


def _is_better(before: Sequence[Remark], after: Sequence[Remark], remark: Remark) -> bool:
    """Whether the remark is gone and no other came."""

    def names(remarks: Sequence[Remark]) -> set[tuple[str, str]]:
        return {(known.place, known.message) for known in remarks if isinstance(known, Fault)}

    is_gone = (remark.place, remark.message) not in {(known.place, known.message) for known in after}
    is_note = isinstance(remark, Note)
    return is_gone and (names(after) <= names(before) or (not is_note and len(after) < len(before)))


def _repairs(remark: Remark, tables: Tables) -> Iterator[Repair]:
    path = path_of(remark.place)
    if added := _ADDED.search(remark.message):
        key, text = added[1], added[2]
        value: Any = text == "true" if text in ("true", "false") else text.strip('"')
        yield Repair([{"op": "set", "path": [*path, key], "value": value}], f"{key} = {text}")
        return
    meant = {first or second for first, second in _MEANT.findall(remark.message)}
    value = _value(tables, path)
    for name in meant:
        if remark.message.startswith("unknown key"):
            yield Repair([{"op": "move", "path": [*path], "to": [*path[:-1], name]}], name)
        elif isinstance(value, str) and (text := _replaced(value, name, remark.message)) != value:
            yield Repair([{"op": "set", "path": [*path], "value": text}], text)


def _replaced(value: str, meant: str, message: str) -> str:
    """The value with the right name in it: in place of the whole, or of a part that the fault names."""
    wrong = [name for name in _NAMED.findall(message.partition("did you mean")[0]) if name in value]
    return value.replace(wrong[0], meant) if wrong else meant


def _value(tables: Any, path: Path) -> Any:
    try:
        for step in path:
            tables = tables[step]
    except (LookupError, TypeError):
        return None
    return tables


def _apply(tables: dict[str, Any], edit: Mapping[str, Any]) -> None:
    *around, key = edit["path"]
    table = _value(tables, tuple(around))
    if edit["op"] == "set":
        table[key] = edit["value"]
    else:
        table[edit["to"][-1]] = table.pop(key)
