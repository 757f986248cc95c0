"""What `app.check` says of texts that are cut, without a browser."""

from typing import Any

import pytest

from app.panel import Panel
from app.panel.widths.boxes import line_count, widest_piece
from app.panel.widths.cut_texts import cut_notes

pytestmark = pytest.mark.promise("layout")

KEY = {"kind": "publish", "topic": "/a", "type": "std_msgs/msg/Empty", "message": {}}
GOAL = {
    "kind": "action",
    "action": "/goal",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": 1},
}


def noted(*widgets: dict[str, Any], **more: Any) -> list[str]:
    """The notes of a page with these widgets in four columns, on the screen of 800 x 480 pixels."""
    group = {"columns": 4, "widget": [{"id": f"w{n}", **each} for n, each in enumerate(widgets)]}
    page = {"id": "p", "title": "P", "group": [group]}
    panel = {"title": "T", "screens": ["800x480"], "languages": ["en", "de"], "page": [page], **more}
    return [f"{note.place}: {note.message}" for note in cut_notes(Panel.model_validate(panel))]


def test_a_word_that_is_wider_than_its_button_is_named_with_both_widths() -> None:
    (note,) = noted({**KEY, "label": "Verpackungsmaschine"}, {**KEY, "label": "Start"})
    assert note == (
        "page[0].group[0].widget[0].label: "
        '"Verpackungsmaschine" (en, de) needs 180 px, the button has 159 at 800x480'
    )


def test_a_button_is_narrower_by_the_word_that_cancels() -> None:
    english, german = noted({**GOAL, "label": "Verpackung"})
    assert english.endswith('"Verpackung" (en) needs 95 px, the button has 67 at 800x480')
    assert german.endswith('"Verpackung" (de) needs 95 px, the button has 34 at 800x480')


def test_a_reason_has_the_lines_that_its_button_is_high() -> None:
    locked = "Close the guard door at the north side of the cell until it locks, then touch Reset"
    interlock = {"id": "guard", "topic": "/guard", "locked": {"en": locked, "de": "Tür zu"}}
    (note,) = noted({**KEY, "label": "Start", "interlock": "guard"}, interlock=[interlock])
    assert note.startswith("page[0].group[0].widget[0].interlock: ")
    assert "(en) needs 4 lines, the button has 3 of 159 px" in note


def test_what_to_use_instead_of_a_stop_is_whole_on_its_button() -> None:
    """The text of the catalogue is so on the smallest rail; one of the panel file is measured."""
    stop = {**KEY, "id": "stop", "label": "Stop", "role": "stop"}
    frame: dict[str, Any] = {"frame": {"widget": [stop]}}
    frame |= {"screens": ["1280x800", "1024x600", "800x480"], "languages": ["en", "de", "ja"]}
    assert noted({**KEY, "label": "Start"}, **frame) == []
    (note,) = noted({**KEY, "label": "Start"}, **frame, stop_hint="Use the red button at the gate.")
    assert note.startswith("frame.widget[0].stop_hint: ")


def test_a_label_has_one_line_while_its_button_is_locked() -> None:
    (note,) = noted({**KEY, "label": "Close both guard doors"})
    assert '"Close both guard doors" (en, de) needs 2 lines' in note
    assert "the locked button has 1 of 159 px at 800x480" in note


def test_rows_of_conditions_and_tabs_of_robots_are_measured() -> None:
    name = (
        "Guard door at the north side of the palletizing cell, beside the conveyor of the empty pallets"
    )
    guard = {"id": "guard", "label": name, "topic": "/guard"}
    rows = {"kind": "conditions", "label": "All", "conditions": ["guard"], "span": 2}
    note = noted(rows, interlock=[guard])[0]
    assert note.startswith("page[0].group[0].widget[0].conditions[0]: ")
    assert "the row has 1 of" in note
    robots = [
        {"id": f"r{number}", "name": f"Depalletizing robot {number}", "namespace": f"/r{number}"}
        for number in range(6)
    ]
    notes = noted({**KEY, "label": "Start"}, robot=robots)
    assert [note.partition(":")[0] for note in notes] == [f"robot[{n}].name" for n in range(6)]
    assert "the tab has" in notes[0]


def test_texts_of_all_screens_are_in_one_note() -> None:
    key = {**KEY, "label": "Verpackungsmaschinensteuerung"}
    (note,) = noted(key, screens=["800x480", "1024x600"])
    assert note.count("Verpackungsmaschinensteuerung") == 1
    assert "at 800x480" in note
    assert "at 1024x600" in note


@pytest.mark.parametrize(
    ("text", "lines"),
    [("Close door", 1), ("Close the door", 2), ("安全扉を閉める", 2), ("Tür\u00adschließer", 2)],
)
def test_lines_end_where_a_browser_ends_them(text: str, lines: int) -> None:
    assert line_count(text, 100, 20, bold=False) == lines


def test_no_line_begins_with_a_full_stop() -> None:
    word, _ = widest_piece("閉める。", 20, bold=False)
    assert word == "る。"
