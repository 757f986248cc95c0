"""A locked button that is touched says why it is locked and what to do, in a sheet beside it."""

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_accessibility import ALL, AXE, RUN
from tests.support.browser.browsers import sized
from tests.support.browser.pages import place
from tests.support.browser.touch import overlap
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("locks")

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
SVG: Final = '<svg xmlns="http://www.w3.org/2000/svg" width="160" height="90" viewBox="0 0 160 90"/>'
# The demo robot says on /last_heard what it heard: a press sets the interlock.
BUTTON: Final = """
[[page.widget]]
id = "%s"
kind = "publish"
label = "%s"
topic = "/%s"
type = "std_msgs/msg/String"
message = { data = "%s" }
"""
PANEL: Final = (
    """
title = "Palletizing cell 2"
mode = "demo"
mm_per_px = 0.22
pictures = "pictures"
[[interlock]]
id = "order"
label = "Order"
topic = "/last_heard"
type = "std_msgs/msg/String"
equals = "go (/operation2)"
locked = "The order is not released."
[interlock.help]
text = "Look at the order.\\nTouch Go."
picture = "order.svg"
[[interlock]]
id = "air"
label = "Air at the inlet"
topic = "/air"
type = "std_msgs/msg/Float64"
min = 5
unit = "bar"
[demo."/air"]
message = { data = 5.6 }
[[frame.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = "Stop"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "stop" }
[[frame.widget]]
id = "fast"
kind = "publish"
label = "Fast"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "fast" }
interlock = "order"
[[page]]
id = "one"
title = "One"
fit = true
"""
    + BUTTON % ("start", "Start", "operation1", "start")
    + 'interlock = ["air", "order"]\n'
    + BUTTON % ("halt", "Halt", "operation2", "halt")
    + BUTTON % ("other", "Other", "operation2", "other")
    + BUTTON % ("go", "Go", "operation2", "go")
    + BUTTON % ("below", "Below", "operation1", "below")
    + """
[[page.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/last_heard"
type = "std_msgs/msg/String"
"""
)
RINGED: Final = "(button) => getComputedStyle(button).outlineStyle"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with lock_server(tmp_path_factory.mktemp("panel")) as mine:
        yield mine


def lock_server(folder: Path) -> Server:
    (folder / "pictures").mkdir()
    (folder / "pictures/order.svg").write_text(SVG)
    server = demo_server(folder, PANEL)
    until(lambda: server.widget("halt")["enabled"], "the robot is there")
    return server


def says(cell: Server, order: str) -> None:
    cell.http.post(f"/widgets/{order}", json={"inputs": {}})
    heard = f"{order} (/operation2)"
    until(lambda: cell.widget("heard")["text"] == heard, f"{order} is heard")


def opens(cell: Server, page: Page) -> Page:
    """The page with Start locked, and its scripts there."""
    says(cell, "halt")
    page.goto(cell.url)
    expect(page.locator("[data-widget=start] .more")).to_be_attached()
    return page


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", ["start", "fast"])
def test_a_touch_says_the_condition_its_value_what_is_needed_and_what_to_do(
    cell: Server, chromium: Browser, size: tuple[int, int], name: str
) -> None:
    context = chromium.new_context(viewport={"width": size[0], "height": size[1]}, has_touch=True)
    page = opens(cell, context.new_page())
    sheet, key = page.locator("#whole"), page.locator(f"[data-widget={name}]")
    key.tap()
    expect(sheet.get_by_role("heading", level=2)).to_have_text(f"{name.capitalize()} is locked")
    row = sheet.locator("li[data-met]").first
    expect(row.locator(".name")).to_have_text("OrderThe order is not released.")
    expect(row.locator("b")).to_have_text('"halt (/operation2)"')
    expect(row.locator("> small")).to_have_text('needs "go (/operation2)"')
    expect(sheet.locator("ol > li")).to_have_text(["Look at the order.", "Touch Go."])
    until(lambda: sheet.locator("img").evaluate("(picture) => picture.naturalWidth") == 160, "it shows")
    expect(sheet).to_be_in_viewport(ratio=1)
    assert sheet.evaluate("(sheet) => sheet.scrollHeight <= sheet.clientHeight")
    for covered in ("nav.pages", "[data-widget=stop]", f"[data-widget={name}]"):
        assert not overlap(page, "#whole", covered), covered
    assert key.locator("> button:not(.more)").evaluate(RINGED) == "solid"
    assert place(sheet.locator(".close"))["height"] * 0.22 >= 11.9
    assert cell.widget(name)["enabled"] is False
    context.close()


def test_it_follows_the_value_and_goes_with_the_lock(cell: Server, page: Page) -> None:
    sheet = opens(cell, page).locator("#whole")
    page.locator("[data-widget=start]").click()
    expect(sheet.locator("li b").first).to_have_text('"halt (/operation2)"')
    says(cell, "other")
    expect(sheet.locator("li b").first).to_have_text('"other (/operation2)"')
    says(cell, "go")
    expect(sheet).to_be_hidden()
    expect(page.locator("[data-asked]")).to_have_count(0)
    expect(page.locator("[data-widget=start] > button:not(.more)")).to_be_enabled()


def test_a_touch_that_was_meant_for_the_sheet_presses_nothing_below(cell: Server, page: Page) -> None:
    opens(cell, page).locator("[data-widget=start]").click()
    close = page.locator("#whole .close")
    close.dblclick()
    expect(page.locator("#whole")).to_be_hidden()
    assert page.evaluate("getComputedStyle(document.querySelector('main')).pointerEvents") == "none"
    expect(page.locator("body[data-asks]")).to_have_count(0)
    assert not page.locator(".receipt:not(:empty)").count()


def test_without_the_server_it_says_the_reason_that_the_page_has(
    page: Page, servers: Callable[[Server], Server], tmp_path: Path
) -> None:
    mine = servers(lock_server(tmp_path))
    sheet = opens(mine, page).locator("#whole")
    page.locator("[data-widget=start]").click()
    expect(sheet.locator("ol")).to_be_visible()
    mine.process.send(signal.SIGSTOP)
    try:
        expect(sheet.locator("> p")).to_have_text("No connection to the panel server.")
        expect(sheet.locator("ol")).to_have_count(0)
        page.locator("#whole .close").click()
        expect(page.locator("body[data-asks]")).to_have_count(0)
        page.locator("[data-widget=start]").click()
        expect(sheet.locator("> p")).to_have_text("No connection to the panel server.")
    finally:
        mine.process.send(signal.SIGCONT)
    expect(sheet.locator("ol > li")).to_have_text(["Look at the order.", "Touch Go."])


def test_a_keyboard_opens_reads_and_leaves_it_and_sends_nothing(cell: Server, page: Page) -> None:
    sheet = opens(cell, page).locator("#whole")
    start = page.locator("[data-widget=start]")
    sent: list[str] = []
    page.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    page.locator("[data-widget=halt] > button:not(.more)").focus()
    page.keyboard.press("Shift+Tab")
    more = start.locator(".more")
    expect(more).to_be_focused()
    described = (more.get_attribute("aria-describedby") or "").split()
    assert "why-start" in described
    for key in ("Enter", " "):
        page.keyboard.press(key)
        expect(sheet).to_be_visible()
        expect(sheet.locator(".close")).to_be_focused()
        page.keyboard.press("Escape")
        expect(sheet).to_be_hidden()
        expect(more).to_be_focused()
    assert sent == []


def test_the_focus_of_a_button_that_locks_stays_at_it_and_presses_nothing(
    cell: Server, page: Page
) -> None:
    says(cell, "go")
    page.goto(cell.url)
    start, more = (
        page.locator("[data-widget=start] > button:not(.more)"),
        page.locator("[data-widget=start] .more"),
    )
    expect(more).to_be_attached()
    start.focus()
    says(cell, "halt")
    expect(more).to_be_focused()
    says(cell, "go")
    expect(start).to_be_enabled()
    page.keyboard.press("Enter")
    assert page.locator("#receipt-start").text_content() == ""
    page.keyboard.press("Shift+Tab")
    expect(more).to_be_hidden()


@pytest.mark.long("detail")
def test_a_screen_reader_reads_it(cell: Server, page: Page) -> None:
    sized(opens(cell, page), 1280, 800)
    page.locator("[data-widget=start]").click()
    expect(page.get_by_role("dialog", name="Start is locked")).to_be_visible()
    page.evaluate(AXE)
    assert page.evaluate(RUN, ALL) == []
