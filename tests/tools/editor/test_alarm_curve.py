"""The curve of an alarm: how often it would have come in what was seen, and the limits as flags."""

import tomllib
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.alarms.states import Definition, define
from app.panel.file.load import PanelChecker
from app.panel.file.toml_file import TomlFile
from app.ros.messages import load_interfaces
from app.tools.editor.alarm_curve import evaluate, with_limits
from app.tools.editor.robot_list import LARGEST_KEPT, MOST_SAMPLES, Recording, Sample

INTERFACES: Final = load_interfaces("jazzy")
FLOAT: Final = "std_msgs/msg/Float64"
FILE: Final = """title = "Cell"
[[page]]
id = "cell"
title = "Cell"
[[alarm]]
id = "air_low"
topic = "/air"
type = "std_msgs/msg/Float64"
low = 5.0
text = "Air low"
{keys}
"""


def definition(tmp_path: Path, keys: str = "") -> Definition:
    text = FILE.format(keys=keys)
    file = TomlFile(tmp_path / "cell.toml", text, tomllib.loads(text), "", lambda _: 0)
    (made,) = define(PanelChecker().panel(file), "")
    return made


def samples(*values: float) -> list[Sample]:
    """One each second."""
    return [(100.0 + number, value) for number, value in enumerate(values)]


SEEN: Final = samples(5.5, 4.9, 5.1, 4.9, 5.3, 4.0, 4.0, 4.0, 4.0, 5.5)


@pytest.mark.parametrize(
    ("keys", "raised", "spans"),
    [
        ("", 3, [(101, 102), (103, 104), (105, 109)]),
        ("deadband = 0.2", 2, [(101, 104), (105, 109)]),
        ("on_delay_s = 2.0", 1, [(107, 109)]),
        ("off_delay_s = 1.5", 1, [(101, 109)]),
        ("low_low = 4.5", 3, [(101, 102), (103, 104), (105, 109)]),
    ],
)
def test_the_alarm_is_counted_as_the_panel_raises_it(
    tmp_path: Path, keys: str, raised: int, spans: Any
) -> None:
    result = evaluate(definition(tmp_path, keys), SEEN)
    assert result.raised == raised
    assert result.spans == [*map(tuple, spans)]


def test_a_value_that_ends_is_not_known_and_raises_nothing_again(tmp_path: Path) -> None:
    seen = [(100.0, 4.0), (200.0, 4.0)]
    assert evaluate(definition(tmp_path, "max_age_s = 5.0"), seen).raised == 1


def test_a_moved_limit_counts_in_place_of_that_of_the_file(tmp_path: Path) -> None:
    moved = with_limits(definition(tmp_path), {"low": 4.5})
    assert evaluate(moved, SEEN).raised == 1


def test_the_last_occurrence_has_its_value_for_the_line_of_operators(tmp_path: Path) -> None:
    last = evaluate(definition(tmp_path), SEEN).last
    assert (last.value, last.limit, last.status.occurrence) == (4.0, 5.0, 3)


def test_a_recording_is_bounded_and_decodes_each_message_once() -> None:
    recording = Recording(FLOAT)
    payload = INTERFACES.encode(FLOAT, {"data": 4.5})
    for number in range(MOST_SAMPLES + 500):
        recording.add(number * 0.2, payload)
    recording.add(0.2 * MOST_SAMPLES + 100.01, payload)  # a tenth of a second apart from the last
    recording.add(1e6, b"0" * (LARGEST_KEPT + 1))
    assert len(recording.payloads) == MOST_SAMPLES
    values = recording.values("data", INTERFACES)
    assert len(values) == MOST_SAMPLES
    assert values[-1][1] == 4.5
    assert recording.size == MOST_SAMPLES * len(payload)
    recording.add(1e6, INTERFACES.encode(FLOAT, {"data": 6.0}))
    assert recording.values("data", INTERFACES)[-1] == (1e6, 6.0)
    assert not recording.values("nothing", INTERFACES)
