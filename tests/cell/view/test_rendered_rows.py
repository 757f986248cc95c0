"""Rows of alarms are rendered once for each language, and only for pages that list them."""

from typing import Any, Final

from app.cell.alarms.shown import NO_ALARMS
from app.cell.view.publisher import KEPT, RenderedRows, alarms_of_page
from app.panel.layout import FRAME_ONLY
from app.system.texts import say

ROW: Final = {"id": "air", "state_text": say("alarm_state_active")}


def test_a_row_is_rendered_once_for_each_language_until_it_is_another() -> None:
    rows = RenderedRows()
    first = rows.render({"air": ROW}, "en")["air"]
    assert first["state_text"] == "Active, acknowledged"
    assert rows.render({"air": ROW}, "en")["air"] is first
    assert rows.render({"air": ROW}, "ja")["air"]["state_text"] != first["state_text"]
    changed = {**ROW, "state_text": say("alarm_state_normal")}
    assert rows.render({"air": changed}, "en")["air"]["state_text"] == "Normal"
    assert rows.render({"air": None}, "en") == {"air": None}


def test_kept_rows_are_bounded() -> None:
    rows = RenderedRows()
    for number in range(3 * KEPT):
        assert rows.render({f"a{number}": ROW}, "en")
    assert len(rows._known["en"]) <= KEPT + 1


def test_only_the_page_of_the_list_gets_rows() -> None:
    section: dict[str, Any] = {**NO_ALARMS, "rows": {"air": ROW}, "standing": 1}
    assert alarms_of_page(section, "main")["rows"] == {}
    assert alarms_of_page(section, "main")["standing"] == 1
    for page in ("", FRAME_ONLY):
        assert alarms_of_page(section, page)["rows"] == {"air": ROW}
