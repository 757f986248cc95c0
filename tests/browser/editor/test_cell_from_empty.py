"""The shipped palletizer's page, built from an empty file with mouse and keyboard only, saved, checked,
and run: Start, and the robot moves."""

import tomllib
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, expect

from app.panel.file.toml_lines import Path as EditPath
from tests.browser.editor.hands import Hands
from tests.support.browser.browsers import opened
from tests.support.editor import editing, preview
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.processes import command
from tests.support.processes.command import COMMAND
from tests.support.servers import ready

BUILT_WITHIN_S: Final = 900
pytestmark = [pytest.mark.long("real time"), pytest.mark.timeout(BUILT_WITHIN_S)]
LANGUAGES: Final = {"en", "ja", "de"}
# Kind → its name in the pane "Parts".
PARTS: Final = {
    **{"figure": "Figure", "pallet": "Pallet", "readout": "Value", "action": "Action button"},
    **{"call": "Service button", "sequence": "Sequence", "trend": "Trend", "select": "Choice"},
    **{"hold": "Hold-to-run button", "switch": "Switch"},
}
# Widgets that come from the pane "Robot", by what they show or call, and as what.
FROM_ROBOT: Final = {
    "cycle": ("/cell/last_cycle", "Value"),
    "rate": ("/cell/rate", "Value"),
    "start": ("/cell/start", "Service button"),
}


def english(value: Any) -> Any:
    """A table of the panel with its English texts, in one line as a form has them."""
    if isinstance(value, dict):
        if value and value.keys() <= LANGUAGES:
            return value["en"].replace("\n", " ")
        plain = {key: english(each) for key, each in value.items()}
        if isinstance(locks := plain.get("interlock"), list) and isinstance(locks[0], str):
            plain["interlock"] = sorted(locks)  # ticked in a list
        return plain
    return [english(each) for each in value] if isinstance(value, list) else value


SHIPPED_TABLES: Final = english(tomllib.loads(SHIPPED.read_text()))
CELL: Final = SHIPPED_TABLES["page"][0]
ABOVE: Final = ("title", "mode", "demo_story", "mm_per_px")
STEPS: Final = next(w for w in CELL["group"][1]["widget"] if w["id"] == "steps")


def named(name: str) -> list[dict[str, Any]]:
    """The tables of a list that the page names. The form writes the type beside a topic."""
    widgets = [widget for group in CELL["group"] for widget in group["widget"]]
    if name == "interlock":
        used = {each for widget in widgets for each in listed(widget.get("interlock"))}
    elif name == "condition":
        used = {*STEPS["fault"], *(row["condition"] for row in STEPS["recovery"] if "condition" in row)}
    else:
        used = {*STEPS["alarms"]}
    tables = [table for table in SHIPPED_TABLES[name] if table["id"] in used]
    typed = {} if name == "alarm" else {"type": "std_msgs/msg/Bool"}
    return [
        {key: value for key, value in (table | typed | table).items() if key != "help"}
        for table in tables
    ]


def listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [] if value is None else [value]


def build(hands: Hands) -> None:
    """The page and what it names, from the top of the file."""
    for key in ABOVE:
        hands.put((key,), SHIPPED_TABLES[key])
    for name, part in (("interlock", "Interlock"), ("condition", "Condition"), ("alarm", "Alarm")):
        for number, table in enumerate(named(name)):
            hands.add("parts", part)
            hands.added((name, number))
            hands.fill((name, number), table)
    page: EditPath = ("page", 0)
    hands.click(hands.page.locator("#tab-outline"))
    hands.click(hands.page.locator(".tr[data-path='[\"page\", 0]']"))
    hands.added(page)
    hands.fill(page, CELL)
    for number, group in enumerate(CELL["group"]):
        hands.add("parts", "Group")
        hands.added((*page, "group", number))
        hands.fill((*page, "group", number), group)
        for place, widget in enumerate(group["widget"]):
            at = (*page, "group", number, "widget", place)
            if widget["id"] in FROM_ROBOT:
                key, title = FROM_ROBOT[widget["id"]]
                hands.add("robot", key)
                hands.pick(title)
            else:
                hands.add("parts", PARTS[widget["kind"]])
            hands.added(at)
            hands.fill(at, widget)


def test_the_shipped_cell_is_built_from_an_empty_file(chromium: Browser, tmp_path: Path) -> None:
    with editing(tmp_path, "") as editor, opened(chromium, locale="en") as context:
        page = context.new_page()
        page.set_viewport_size({"width": 1440, "height": 900})
        page.goto(editor.address)
        expect(preview(page).locator("main")).to_be_attached()
        hands = Hands(page, editor)
        build(hands)
        expect(page.locator("#faults .is-fault")).to_have_count(0)
        expect(preview(page).locator("#at-start")).to_be_visible()
        page.keyboard.press("Control+s")
        expect(page.locator("#status")).to_have_text("Saved")
    saved = tomllib.loads(editor.file.read_text())
    assert [english(page) for page in saved["page"]] == [CELL]
    for name in ("interlock", "condition", "alarm"):
        assert [english(table) for table in saved[name]] == named(name)
    checked = command.run(COMMAND, "check", str(editor.file))
    assert checked.returncode == 0, checked.stderr
    with ready(Server(ROOT, KIOSK_PANEL=str(editor.file), KIOSK_MODE="demo")) as cell:
        runs(chromium, cell)


def runs(chromium: Browser, cell: Server) -> None:
    """Start is pressed, after Pause as it runs already, and the robot moves on."""
    with opened(chromium, locale="en") as context:
        page = context.new_page()
        page.goto(cell.url)
        start = page.locator("#at-start button").first
        expect(page.locator("#at-start")).to_contain_text("Already started")
        page.locator("#at-pause button").first.click()
        expect(page.locator("#at-pause")).to_contain_text("Not running")
        expect(page.locator("#at-start")).not_to_contain_text("Already started")
        standing = page.locator("#at-boxes").inner_text()
        start.click()
        expect(page.locator("#at-start")).to_contain_text("Already started")
        expect(page.locator("#at-boxes")).not_to_have_text(standing, use_inner_text=True)
        current = page.locator("#at-steps [aria-current]")
        step = current.inner_text()
        expect(current).not_to_have_text(step, use_inner_text=True)
