"""Sources: a topic that several tables of a panel file name by an id."""

from pathlib import Path
from typing import Any

import pytest

from app.panel import load_panel
from app.panel.checks.notes import find_notes
from app.panel.file.load import faults_of_text
from app.panel.widgets.displays import Indicator, Readout
from app.system.errors import Fault, PanelError
from tests.support.builders import INTERFACES

SOURCE = """title = "Cell"
[[source]]
id = "battery"
topic = "/battery"
type = "sensor_msgs/msg/BatteryState"
field = "percentage"
max_age_s = 10
scale = 100
unit = "%"
format = ".0f"
states = [{ value = 1, text = "Charging", shape = "circle" }]
qos = { reliability = "best_effort" }
"""
PAGE = """
[[interlock]]
id = "charge"
source = "battery"
min = 15

[[page]]
id = "main"
title = "Main"

[[page.widget]]
id = "soc"
kind = "readout"
label = "Charge"
source = "battery"

[[page.widget]]
id = "volt"
kind = "readout"
label = "Voltage"
source = "battery"
field = "voltage"
unit = "V"
max_age_s = 2.0

[[page.widget]]
id = "supply"
kind = "indicator"
label = "Supply"
source = "battery"
field = "power_supply_status"
states = [{ value = 2, text = "Discharging", shape = "square" }]

[[page.widget]]
id = "history"
kind = "trend"
label = "Charge"
[[page.widget.pen]]
label = "Charge"
source = "battery"
"""


def loaded(folder: Path, text: str) -> Any:
    path = folder / "cell.toml"
    path.write_text(text)
    return load_panel(path)


def test_tables_have_what_their_source_says_where_they_do_not(tmp_path: Path) -> None:
    panel = loaded(tmp_path, SOURCE + PAGE)
    soc, volt, supply = (
        panel.widget("soc", Readout),
        panel.widget("volt", Readout),
        panel.widget("supply", Indicator),
    )
    assert (soc.topic, soc.type, soc.field, soc.max_age_s) == (
        "/battery", "sensor_msgs/msg/BatteryState", "percentage", 10.0,
    )  # fmt: skip
    assert (soc.scale, soc.unit, soc.format, soc.qos.reliability) == (100.0, "%", ".0f", "best_effort")
    assert (volt.field, volt.scale, volt.unit, volt.max_age_s) == ("voltage", 1.0, "V", 2.0)
    assert (volt.offset, volt.format) == (0.0, None)  # what is about one field is not that of another
    assert [state.text for state in supply.states] == ["Discharging"]
    (interlock,) = panel.interlocks
    assert (interlock.topic, interlock.max_age_s) == ("/battery", 10.0)
    assert (interlock.unit, interlock.format) == ("%", ".0f")
    assert interlock.min == pytest.approx(0.15)  # 15 % in the message
    assert panel.subscriptions() == {"/battery": "sensor_msgs/msg/BatteryState"}


def faults(folder: Path, text: str) -> list[Fault]:
    return list(faults_of_text(text, folder))


@pytest.mark.parametrize(
    ("old", "new", "place", "line", "words"),
    [
        ('topic = "/battery"', 'topic = "battery"', "source[0].topic", 4, "not an absolute"),
        ('topic = "/battery"', "", "source[0].topic", 2, "is missing"),
        ("BatteryState", "BateryState", "source[0].type", 5, "did you mean"),
        ('"percentage"', '"percent"', "source[0].field", 6, "there is no"),
        ('id = "battery"', 'id = "akku"', "interlock[0].source", 16, "there is akku"),
        ("min = 15", 'type = "a/msg/B"', "interlock[0].type", 17, "stands beside source"),
    ],
)
def test_a_mistake_is_named_where_it_stands(
    tmp_path: Path, old: str, new: str, place: str, line: int, words: str
) -> None:
    fault = faults(tmp_path, (SOURCE + PAGE).replace(old, new, 1))[0]
    assert (fault.place, fault.line) == (place, line)
    assert words in fault.message


def test_a_source_can_not_be_published(tmp_path: Path) -> None:
    button = """
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
source = "battery"
message = {}
"""
    messages = [fault.message for fault in faults(tmp_path, SOURCE + PAGE + button)]
    assert any('"source"' in message or "unknown key" in message for message in messages)


def test_two_sources_with_one_id_and_one_that_nothing_names(tmp_path: Path) -> None:
    twice = SOURCE + SOURCE.removeprefix('title = "Cell"\n') + PAGE
    (fault,) = faults(tmp_path, twice)
    assert fault.place == "source[1].id"
    assert fault.message == '"battery" is already the id of source[0], line 2'
    spare = SOURCE + SOURCE.removeprefix('title = "Cell"\n').replace("battery", "spare") + PAGE
    notes = [str(note.message) for note in find_notes(loaded(tmp_path, spare), INTERFACES)]
    assert 'nothing has source = "spare"' in notes


def test_without_sources_a_named_one_is_asked_for(tmp_path: Path) -> None:
    words = r'no source "battery": write a \[\[source\]\] with this id'
    with pytest.raises(PanelError, match=words):
        loaded(tmp_path, 'title = "Cell"\n' + PAGE)


def test_scale_offset_and_unit_are_shared_together_or_not_at_all(tmp_path: Path) -> None:
    celsius = SOURCE.replace("scale = 100", "scale = 2\noffset = -273.15").replace('"%"', '"°C"')
    alarm = """
[[alarm]]
id = "warm"
text = "Warm"
source = "battery"
high = 50.0
"""
    own_scale = PAGE.replace(
        'source = "battery"\n\n[[page.widget]]\nid = "volt"',
        'source = "battery"\nscale = 3\n\n[[page.widget]]\nid = "volt"',
    )
    panel = loaded(tmp_path, celsius + own_scale + alarm)
    soc = panel.widget("soc", Readout)
    assert (soc.scale, soc.offset, soc.unit) == (3.0, 0.0, "")
    (warm,) = panel.alarms
    assert (warm.scale, warm.offset, warm.unit) == (2.0, -273.15, "°C")
    panel = loaded(tmp_path, SOURCE + PAGE + alarm)
    (warm,) = panel.alarms
    assert (warm.scale, warm.unit) == (100.0, "%")
