"""The `[demo]` table: its faults are found at their places, by names that have "/" and "." in them."""

from pathlib import Path
from typing import Final

import pytest

from app.panel import load_panel
from app.panel.file.keys import add_locations, lines_in, path_of, place_of
from app.system.errors import Fault, PanelError

PANEL: Final = """title = "Cell"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "joint"
kind = "readout"
label = "Joint"
topic = "/joint_states"
type = "sensor_msgs/msg/JointState"
field = "position[name=axis_2]"
[[page.widget]]
id = "door"
kind = "readout"
label = "Door"
topic = "/door"
type = "std_msgs/msg/Bool"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Empty"
message = {}
[[page.widget]]
id = "tries"
kind = "parameter"
label = "Tries"
node = "/arm"
parameter = "planner.tries"
type = "integer[]"
"""
LINE: Final = PANEL.count("\n") + 2  # of the first key of an entry


def faults(folder: Path, table: str) -> list[Fault]:
    path = folder / "cell.toml"
    path.write_text(PANEL + table)
    try:
        load_panel(path)
    except PanelError as error:
        return list(error.faults)
    return []


@pytest.mark.parametrize(
    "table",
    [
        '[demo."/joint_states"]\nranges = { "position[name=axis_2]" = [-1, 1] }',
        '[demo."/joint_states"]\nrange = [-1.5, 1.5]\nperiod_s = 5\nhz = 50',
        '[demo."/door"]\nvalues = [true, false]',
        '[demo."/go"]\nsilent = true',
        '[demo."/arm"]\nparameters = { "planner.tries" = [1, 2] }',
        '[demo]\n"/door" = { silent = true }',
    ],
)
def test_an_entry_is_for_a_name_that_the_panel_uses(tmp_path: Path, table: str) -> None:
    assert faults(tmp_path, table) == []


@pytest.mark.parametrize(
    ("table", "place", "words"),
    [
        (
            '[demo."/joint_states"]\nranges = { "position[name=axis_2]" = [1] }',
            'demo."/joint_states".ranges."position[name=axis_2]"',
            "must be the lowest and the highest value",
        ),
        (
            '[demo."/joint_states"]\nranges = { "position[0]" = [0, 1] }',
            'demo."/joint_states".ranges',
            "the panel shows no number at position[0]; there is position[name=axis_2]",
        ),
        ('[demo."/door"]\nrange = [0, 1]', 'demo."/door".range', "the panel shows no number of /door"),
        (
            '[demo."/door"]\nvalues = [true, 1]',
            'demo."/door".values[1]',
            '"data": must be true or false',
        ),
        (
            '[demo."/door"]\nvalues = [{}]',
            'demo."/door".values',
            "must be numbers, true or false, or texts",
        ),
        ('[demo."/go"]\nhz = 5', 'demo."/go".hz', "/go is a topic that the panel publishes"),
        (
            '[demo."/arm"]\nparameters = { "planner.tries" = 3 }',
            'demo."/arm".parameters',
            "planner.tries must be integer[], not 3",
        ),
        ('[demo."/door"]\nhzz = 5', 'demo."/door".hzz', 'did you mean "hz"?'),
        ('[demo]\n"/door" = 3', 'demo."/door"', "must be a table, not 3"),
        ('[demo."door"]\nhz = 5', "demo.door", "the panel does not use door; did you mean /door?"),
    ],
)
def test_a_mistake_is_one_fault_at_its_place(
    tmp_path: Path, table: str, place: str, words: str
) -> None:
    (fault,) = faults(tmp_path, table)
    assert (fault.place, words in fault.message) == (place, True), str(fault)
    assert fault.line in (LINE - 1, LINE)


def story_faults(folder: Path, panel: str) -> list[tuple[str, str]]:
    path = folder / "cell.toml"
    path.write_text(f'demo_story = "palletizing"\n{panel}')
    try:
        load_panel(path)
    except PanelError as error:
        return [(fault.place, fault.message) for fault in error.faults]
    return []


def test_a_story_is_for_a_panel_that_uses_its_names_with_their_types(tmp_path: Path) -> None:
    assert story_faults(tmp_path, PANEL) == []
    other = PANEL.replace('"/door"', '"/boxes"')
    ((place, message),) = story_faults(tmp_path, other)
    assert place == "demo_story"
    assert message.startswith(
        "plays /boxes as std_msgs/msg/UInt32, and the panel has std_msgs/msg/Bool"
    )
    assert story_faults(tmp_path, other + '[demo."/boxes"]\nvalues = [true]\n') == []


def test_a_story_without_a_name_that_the_panel_uses_is_a_fault(tmp_path: Path) -> None:
    ((place, message),) = story_faults(tmp_path, PANEL.replace('"/joint_states"', '"/joints"'))
    assert (place, "the panel uses no name of the story" in message) == ("demo_story", True)


def test_an_unknown_story_is_a_fault(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(f'demo_story = "welding"\n{PANEL}')
    with pytest.raises(PanelError) as raised:
        load_panel(path)
    (fault,) = raised.value.faults
    assert (fault.place, "palletizing" in fault.message) == ("demo_story", True)


def test_an_entry_of_a_widget_with_a_fault_is_no_second_fault(tmp_path: Path) -> None:
    table = '[demo."/door"]\nvalues = [true]\n[[page]]\nid = "two"\ntitle = "Two"\n'
    wrong = PANEL.replace('topic = "/door"\ntype = "std_msgs/msg/Bool"', 'topic = "/door"')
    path = tmp_path / "cell.toml"
    path.write_text(wrong + table)
    with pytest.raises(PanelError) as raised:
        load_panel(path)
    (fault,) = raised.value.faults
    assert fault.place == "page[0].widget[1].type"


def test_place_with_quotes_has_the_line_of_its_table() -> None:
    place = place_of(("demo", "/a", "ranges", "position[name='b.c']", 0))
    assert place == 'demo."/a".ranges."position[name=\'b.c\']"[0]'
    assert path_of(place) == ("demo", "/a", "ranges", "position[name='b.c']", 0)
    (located,) = add_locations([Fault(place, "wrong")], lines_in('[demo."/a"]\nhz = 1\n'), {})
    assert located.line == 1
