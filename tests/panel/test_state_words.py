"""Interlocks that lock in a state by the word of another one are named."""

from pathlib import Path

import pytest

from app.panel import check_panel
from tests.tools.simulator.test_machine import STATES

LOCK = '[[interlock]]\nid = "start"\ntopic = "/state"\ntype = "std_msgs/msg/String"\nmax_age_s = 3.0\n'


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ('one_of = ["PAUSED", "HOT"]\nlocked = "Already running"\n', "FAULT"),
        ('equals = "PAUSED"\nlocked = { en = "Running", de = "Läuft" }\n', "HOT"),
        ('not_equals = "RUNNING"\nlocked = "Already running"\n', None),
        ('equals = "RUNNING"\nlocked = "Not running"\n', None),
        ('equals = "PAUSED"\nlocked = "Pause first."\n', None),
    ],
)
def test_a_text_that_says_another_state_is_named(tmp_path: Path, table: str, named: str | None) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(STATES.replace('"Runs"', '"Running"') + LOCK + table)
    notes = [note for note in check_panel(path).notes if "locked" in note.place]
    assert [f"in the state {named} too" in note.message for note in notes] == [True] * (
        named is not None
    )
