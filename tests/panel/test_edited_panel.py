"""A panel file that is checked after each of many changes: as if each version were checked alone."""

import random
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel.file.load import PanelChecker
from app.panel.file.toml_file import TomlFile, read_toml
from app.system.errors import Fault, Note, PanelError
from tests.support.places import ROOT

PANELS: Final = [
    ROOT / "app/panel.toml",
    *sorted((ROOT / "docs/examples").rglob("panel.toml")),
    *sorted((ROOT / "docs/examples").glob("*.toml")),
]
EDITS: Final = 25  # of each file
OTHERS: Final[tuple[Any, ...]] = (
    False,
    "/other",
    "",
    0,
    -1,
    2.5,
    True,
    "operation",
    "en",
    [],
    {},
    {"en": "One"},
    "std_msgs/msg/Bool",
)


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """(table or list, key or index) of everything in a file."""
    items = value.items() if isinstance(value, dict) else enumerate(value)
    for key, inner in list(items):
        yield value, key
        if isinstance(inner, dict | list):
            yield from places(inner)


def change(tables: dict[str, Any], chance: random.Random) -> None:
    """One change anywhere: another value, a key or table that goes, two that change places, a copy."""
    around, key = chance.choice(list(places(tables)))
    match chance.choice(("set", "set", "delete", "swap", "copy")):
        case "set":
            around[key] = deepcopy(chance.choice(OTHERS))
        case "delete":
            del around[key]
        case "swap" if isinstance(around, list):
            around.insert(chance.randrange(len(around)), around.pop(key))
        case "copy" if isinstance(around, list):
            around.insert(key, deepcopy(around[key]))


def result(checker: PanelChecker, file: TomlFile) -> tuple[tuple[Fault, ...], Any, tuple[Note, ...]]:
    """(faults, panel, notes)."""
    try:
        panel = checker.panel(file)
    except PanelError as error:
        return error.faults, None, ()
    return (), panel, checker.notes(panel, file)


@pytest.mark.parametrize("path", PANELS, ids=lambda path: path.stem)
def test_a_changed_panel_is_checked_as_a_new_one(path: Path) -> None:
    whole = read_toml(path)
    checker, chance = PanelChecker(), random.Random(path.name)
    tables = whole.tables
    valid = 0
    for _ in range(EDITS):
        before = deepcopy(tables)
        change(tables, chance)
        file = TomlFile(path, whole.text, tables, whole.revision)
        known, alone = result(checker, file), result(PanelChecker(), file)
        assert known == alone
        valid += not known[0]
        if known[0]:  # else there is soon no panel without faults
            tables = before
    assert valid
