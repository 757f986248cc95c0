"""The shift report: alarms, presses and states of a time, on one page of paper."""

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.cell.alarms.report import NAME as STATES
from app.cell.alarms.report import StateRow, write_states
from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_history import written
from tests.browser.test_alarm_line import SIZES, started
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN
from tests.support.parts import TAP_AGAIN_MS, Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import LOW, PANEL, act, listed

pytestmark = pytest.mark.long("detail")

MORE = """
[[page.widget]]
id = "go"
kind = "publish"
label = "Start conveyor"
topic = "/go"
type = "std_msgs/msg/Empty"
message = {}
[state]
topic = "/state"
type = "std_msgs/msg/String"
states = [
  { value = "RUNNING", text = "Running", shape = "play" },
  { value = "FAULT", text = "Fault", shape = "cross", colour = "red" },
]
[demo]
"/state" = { values = ["RUNNING"] }"""
FAULT = '{"text": "Fault", "shape": "cross", "colour": "red"}'
PAGE_OF_PDF = re.compile(rb"/Type\s*/Page\b")


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """A cell that was in a fault, whose history is long."""
    data = tmp_path / "data"
    data.mkdir()
    now = time.time()
    written(data, now)
    rows = [StateRow(now - 7 * 86_400, "", FAULT)]
    write_states(data / STATES, rows, [("", now - 5)])
    panel = PANEL.replace("[demo]", MORE) % LOW
    with demo_server(tmp_path, panel, KIOSK_DATA=str(data)) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        yield server


def test_the_report_has_alarms_presses_and_states_without_scripts(
    cell: Server, without_scripts: Page
) -> None:
    page = without_scripts
    cell.http.post("/widgets/go", json={"inputs": {}})
    shown = listed(cell)["air_latched"]["occurrence"]
    act(cell, "air_latched", "acknowledge", occurrence=shown)
    page.goto(f"{cell.url}/alarms/history")
    page.get_by_role("link", name="Shift report").click()
    paper = page.locator(".paper")
    expect(paper).to_contain_text("Start conveyor")
    expect(paper).to_contain_text("Acknowledge alarm")
    expect(paper).to_contain_text(re.compile("Air was lost.*, after [0-9.]+ s", re.DOTALL))
    expect(paper.locator(".state-list")).to_contain_text("Fault")
    expect(page.locator(".report-choice ul [aria-current]")).to_contain_text("This shift")
    expect(page.get_by_role("button", name="Print")).to_be_hidden()
    page.get_by_role("link", name="Last shift").click()
    expect(page.locator(".report-choice ul [aria-current]")).to_contain_text("Last shift")
    expect(page.locator(".paper .state-list")).to_contain_text("Fault 8 h 00 min")
    expect(page.locator(".paper")).not_to_contain_text("Start conveyor")


def test_a_time_is_chosen_from_and_to(cell: Server, without_scripts: Page) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/alarms/report")
    page.get_by_label("From").fill("2026-01-01T06:00")
    page.get_by_label("To", exact=True).fill("2026-01-01T14:00")
    page.get_by_role("button", name="Show").click()
    expect(page.locator(".paper")).to_contain_text("2026-01-01 06:00 to 14:00")
    expect(page.locator(".paper")).to_contain_text("No state was recorded in this time.")
    expect(page.locator(".report-choice ul [aria-current]")).to_have_count(0)
    assert cell.http.get("/alarms/report?since=2026-02-30T00:00").status_code == 422


def test_the_state_is_recorded_while_the_server_runs(cell: Server) -> None:
    def shown() -> bool:
        page = cell.http.get("/alarms/report").text
        return re.search(r"Running <b>\d+ s</b>", page) is not None

    until(shown, "the state of the robot is in the report")


def test_the_paper_is_one_page_and_stands_alone(cell: Server, own_page: Page) -> None:
    for _ in range(12):
        cell.http.post("/widgets/go", json={"inputs": {}})
    since = time.strftime("%Y-%m-%dT%H:%M", time.localtime(time.time() - 86_000))
    started(own_page, f"{cell.url}/alarms/report?since={since}")
    own_page.emulate_media(media="print")
    expect(own_page.locator(".paper")).to_be_visible()
    for hidden in ("header", ".pages", ".alarm-line", ".report-choice", ".alarm-pages >> nth=0"):
        expect(own_page.locator(hidden).first).to_be_hidden()
    expect(own_page.locator(".paper")).to_contain_text("more, in the operator's log")
    printed = own_page.pdf(prefer_css_page_size=True)
    assert len(PAGE_OF_PDF.findall(printed)) == 1


def test_axe_finds_nothing_and_nothing_is_cut_at_any_size(cell: Server, axe_page: Page) -> None:
    started(axe_page, f"{cell.url}/alarms/report")
    expect(axe_page.get_by_role("button", name="Print")).to_be_visible()
    for width, height in (*SIZES, (390, 844)):
        sized(axe_page, width, height).evaluate(DRAWN)
        assert axe_page.evaluate("document.documentElement.scrollWidth") == width
        if (width, height) in SIZES:
            assert violations(axe_page) == [], width


def test_a_message_to_the_next_shift_is_on_the_report_and_in_the_log(
    cell: Server, without_scripts: Page
) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/alarms/report")
    assert page.locator(".bar-marks span").count() == page.locator(".paper .alarm-plot rect").count()
    page.locator("#message").fill("Hose of gripper 2 leaks <b>")
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Leave message").click()
    expect(page.locator(".paper .shift-message h3")).to_have_text("Message to the next shift")
    expect(page.locator(".paper .shift-message p")).to_have_text("Hose of gripper 2 leaks <b>")
    at = time.time()
    since, end = (time.strftime("%Y-%m-%dT%H:%M", time.localtime(at + s)) for s in (60, 7200))
    page.goto(f"{cell.url}/alarms/report?since={since}&until={end}")
    expect(page.locator(".paper .shift-message h3")).to_have_text("Message from the shift before")
    page.goto(f"{cell.url}/log")
    expect(page.locator(".entries")).to_contain_text("Message to the next shift")


def test_a_message_for_programs(cell: Server) -> None:
    left = cell.http.post("/alarms/report", json={"text": "Look at valve V1", "id": "left-1"})
    assert (left.status_code, left.json()["outcome"]) == (200, "succeeded")
    again = cell.http.post("/alarms/report", json={"text": "Look at valve V1", "id": "left-1"})
    assert again.json() == left.json()
    assert "Look at valve V1" in cell.http.get("/alarms/report").text
    empty = cell.http.post("/alarms/report", json={"text": "  "})
    assert (empty.status_code, empty.json()["code"]) == (409, "alarms_message_empty")
    assert cell.http.post("/alarms/report", json={"text": "x" * 401}).status_code == 422


def test_the_keyboard_writes_a_message(cell: Server, touch_page: Page) -> None:
    page = started(touch_page, f"{cell.url}/alarms/report")
    page.locator("#message").tap()
    keyboard = page.locator(".sheet.keyboard")
    expect(keyboard).to_be_visible()
    keyboard.get_by_role("button", name="v", exact=True).tap()
    keyboard.locator(".set-entry").tap()
    expect(page.locator("#message")).to_have_value(re.compile("^v$", re.IGNORECASE))
