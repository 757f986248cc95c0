"""The repair of a fault, where there is exactly one."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel.file.load import PanelChecker
from app.panel.file.toml_file import TomlFile
from app.system.errors import PanelError, Remark
from app.tools.editor.repairs import repair_of

FILE: Final = """title = "Cell"

[[interlock]]
id = "ready"
label = "operation"
topic = "/ready"
type = "std_msgs/msg/Bool"
require_publisher = true

[[page]]
id = "cell"
title = "Cell"

[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0
max = 100

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
interlock = "ready"
topic = "/go"
type = "std_msgs/msg/Float64"
message = { data = "{speed}" }
"""


def remarks_of(tables: Any) -> Sequence[Remark]:
    checker = PanelChecker()
    file = TomlFile(Path("/tmp/panel.toml"), "", dict(tables), "", lambda _: 0)
    try:
        panel = checker.panel(file)
    except PanelError as error:
        return error.faults
    return checker.notes(panel, file)


@pytest.mark.parametrize(
    ("right", "wrong", "words"),
    [
        ('interlock = "ready"', 'interlock = "raedy"', "ready"),
        ("interlock = ", "interlok = ", "interlock"),
        ('kind = "publish"', 'kind = "pubish"', "publish"),
        ('"{speed}"', '"{sped}"', "{speed}"),
        ('"{speed}"', '"-{sped}"', "-{speed}"),
        ('type = "std_msgs/msg/Float64"', 'type = "std_msgs/msg/Flaot64"', "std_msgs/msg/Float64"),
        ('topic = "/go"', 'topic = "/go"\nconsequence = "It moves."', "confirm_press = true"),
        ("min = 0", 'min = "low"', None),  # no value is said
        ('interlock = "ready"', 'interlock = "guard_door"', None),
        ('id = "ready"', 'id = "reddy"', "reddy"),  # at the button, which names it
        ('"/ready"', '"ready"', None),
    ],
)
def test_the_only_repair_of_a_fault_is_offered(right: str, wrong: str, words: str | None) -> None:
    assert right in FILE
    tables = tomllib.loads(FILE.replace(right, wrong, 1))
    known = remarks_of(tables)
    assert known
    repairs = [repair for remark in known if (repair := repair_of(remark, tables, remarks_of))]
    assert [repair.words for repair in repairs] == ([words] if words else [])


def test_a_key_is_renamed_in_its_place() -> None:
    tables = tomllib.loads(FILE.replace("interlock = ", "interlok = "))
    (fault,) = remarks_of(tables)
    repair = repair_of(fault, tables, remarks_of)
    assert repair is not None
    at = ["page", 0, "widget", 1]
    assert repair.edits == [{"op": "move", "path": [*at, "interlok"], "to": [*at, "interlock"]}]
