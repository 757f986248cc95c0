"""Alarms of a panel file: one source each, with what that needs; a catalogue of faults."""

from pathlib import Path

import pytest

from app.panel import Panel, load_panel
from app.panel.fault_catalogue import CatalogueError, read_catalogue
from app.system.errors import PanelError
from app.system.texts import render

PANEL = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {}
"""
AIR = 'topic = "/air"\ntype = "std_msgs/msg/Float64"\ntext = "Air"\n'
STATE = """
[state]
topic = "/state"
type = "std_msgs/msg/String"
states = [{ value = "ON", text = "On", shape = "play" }]
"""
FAULTS = 'topic = "/faults"\ntype = "diagnostic_msgs/msg/DiagnosticArray"\n'
LIST = '[alarm.list]\nfield = "status"\ncode = "hardware_id"\n'
CATALOGUE = (
    "code,text,text:ja,cause,action\nE1,Axis 1 hot,軸1過熱,Fan blocked,Clean it\nE2,Axis 2 hot,,,\n"
)


def load(folder: Path, *alarms: str) -> Panel:
    path = folder / "cell.toml"
    path.write_text(
        PANEL + "".join(f'[[alarm]]\nid = "a{i}"\n{alarm}' for i, alarm in enumerate(alarms))
    )
    return load_panel(path)


def fault(folder: Path, *alarms: str) -> tuple[str, str]:
    """(place, message) of the only fault."""
    with pytest.raises(PanelError) as raised:
        load(folder, *alarms)
    (only,) = raised.value.faults
    return only.place, only.message


def test_shortest_alarm_table_has_a_limit(tmp_path: Path) -> None:
    panel = load(tmp_path, AIR + "low = 5.0\npriority = 2\n")
    (alarm,) = panel.alarms
    assert (alarm.source, alarm.limits, alarm.priorities) == ("limits", {"low": 5.0}, (2, 1))
    assert panel.subscriptions()["/air"] == "std_msgs/msg/Float64"
    assert panel.subscribed_fields()["/air"] == ["data"]


def test_diagnostics_have_their_topic_and_type(tmp_path: Path) -> None:
    (alarm,) = load(tmp_path, 'diagnostics = "motor *"\n').alarms
    assert (alarm.source, alarm.diagnostics, alarm.topic_name) == (
        "diagnostics",
        ("motor *",),
        "/diagnostics",
    )


@pytest.mark.parametrize(
    ("alarm", "place", "words"),
    [
        ('text = "Air"\n', "alarm[0]", "has no source"),
        (AIR + "low = 5.0\nstale_s = 2.0\n", "alarm[0].stale_s", "is another source"),
        (AIR + "low = 5.0\nhigh = 4.0\n", "alarm[0].high", "is not above low"),
        (AIR + "low = 5.0\nhigh = 6.0\ndeadband = 1.0\n", "alarm[0].deadband", "between low and high"),
        (AIR.replace("Float64", "String") + "low = 5.0\n", "alarm[0].field", "is string"),
        ('text = "Driver"\nnode = "/driver"\nformat = ".1f"\n', "alarm[0].format", "no meaning"),
        (AIR + 'low = 5.0\nstate = "FAULT"\n', "alarm[0].state", "the panel has no [state]"),
        (AIR + 'low = 5.0\nstate = "OFF"\n' + STATE, "alarm[0].state", 'no state "OFF"; there is ON'),
        ('text = "Air"\nlow = 5.0\ntype = "std_msgs/msg/Float64"\n', "alarm[0].topic", "is missing"),
        ('node = "/driver"\n', "alarm[0].text", "is missing"),
        ('text = "Driver"\nnode = "/driver"\ndeadband = 1.0\n', "alarm[0].deadband", "no meaning"),
        (AIR + 'low = 5.0\ninhibits = ["stop"]\n', "alarm[0].inhibits[0]", 'no control "stop"'),
        ('diagnostics = "*"\ntype = "std_msgs/msg/Bool"\n', "alarm[0].type", "DiagnosticArray"),
        (FAULTS + LIST, "alarm[0].list.text", "is missing"),
        (FAULTS + LIST + 'text = "words"\n', "alarm[0].list.text", "words"),
        (FAULTS + LIST + 'text = "message"\nactive = "level"\n', "alarm[0].list.active", "a bool"),
        (FAULTS + LIST.replace("status", "header") + 'text = "x"\n', "alarm[0].list.field", "a list"),
    ],
)
def test_a_mistake_is_named_with_its_place(tmp_path: Path, alarm: str, place: str, words: str) -> None:
    where, message = fault(tmp_path, alarm)
    assert where == place
    assert words in message


def test_two_alarms_have_two_ids_and_none_is_the_panels_own(tmp_path: Path) -> None:
    twice = f'[[alarm]]\nid = "a0"\n{AIR}high = 9.0\n'
    assert fault(tmp_path, AIR + "low = 5.0\n" + twice)[0] == "alarm[1].id"
    with pytest.raises(PanelError, match="the panel's own alarms"):
        load(tmp_path, AIR + f'low = 5.0\n[[alarm]]\nid = "panel_log"\n{AIR}high = 9.0\n')


def test_a_topic_has_one_type_in_alarms_too(tmp_path: Path) -> None:
    place, message = fault(tmp_path, AIR + "low = 5.0\n", AIR.replace("64", "32") + "high = 9.0\n")
    assert (place, "above" in message) == ("alarm[1].type", True)


def test_a_catalogue_has_texts_by_code_and_language(tmp_path: Path) -> None:
    (tmp_path / "faults.csv").write_text(CATALOGUE, encoding="utf-8")
    (alarm,) = load(tmp_path, FAULTS + LIST + 'catalogue = "faults.csv"\n').alarms
    assert alarm.listed is not None
    assert alarm.listed.catalogue is not None
    texts = read_catalogue(alarm.listed.catalogue, "en")["E1"]
    assert texts.text is not None
    assert texts.cause is not None
    assert (render(texts.text), render(texts.text, "ja")) == ("Axis 1 hot", "軸1過熱")
    assert render(texts.cause, "ja") == "Fan blocked"
    assert read_catalogue(alarm.listed.catalogue, "en")["E2"].action is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("code,text\nE1,Hot\nE1,Cold\n", 'line 3: "E1" is already the code of line 2'),
        ("code,text\nE1\n", "line 2: has 1 values"),
        ("code,words\nE1,Hot\n", 'line 1: there is no column "words"'),
        ("code,cause\nE1,Hot\n", "line 1: the header needs"),
        ("code,text\n,Hot\n", "line 2: has no code"),
        ("", "line 1: the header needs"),
    ],
)
def test_a_mistake_in_a_catalogue_is_named_with_its_line(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "faults.csv").write_text(text)
    place, message = fault(tmp_path, FAULTS + LIST + 'catalogue = "faults.csv"\n')
    assert place == "alarm[0].list.catalogue"
    assert words in message


def test_a_catalogue_of_two_thousand_rows_in_three_languages_is_read(tmp_path: Path) -> None:
    rows = "".join(f"E{i},Fault {i},故障{i},Störung {i}\n" for i in range(2000))
    path = tmp_path / "faults.csv"
    path.write_text("code,text,text:ja,text:de\n" + rows, encoding="utf-8")
    catalogue = read_catalogue(path, "en")
    assert len(catalogue) == 2000
    text = catalogue["E1999"].text
    assert text is not None
    assert render(text, "de") == "Störung 1999"
    path.write_bytes(b"code,text\nE1,\xff\n")
    with pytest.raises(CatalogueError, match="UTF-8"):
        read_catalogue(path, "en")
