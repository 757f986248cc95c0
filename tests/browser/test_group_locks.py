"""A group whose buttons are all locked for one reason says it once; a text that is cut can be read."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_lock_help import says
from tests.support.browser.browsers import sized
from tests.support.parts import Server, until
from tests.support.servers import demo_server

BUTTON: Final = """
[[page.group.widget]]
id = "%s"
kind = "publish"
label = "%s"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "%s" }
"""
GROUP: Final = """
[[page.group]]
title = "%s"
note = "Moves while held"
columns = 2
span = 4
"""
# The demo robot says on /last_heard what it heard: a press sets the interlocks.
PANEL: Final = (
    """
title = "Cell"
mode = "demo"
mm_per_px = 0.22
[[interlock]]
id = "order"
label = "Order"
topic = "/last_heard"
type = "std_msgs/msg/String"
equals = "go (/operation2)"
locked = "%s"
[[interlock]]
id = "fast"
label = "Fast"
topic = "/last_heard"
type = "std_msgs/msg/String"
equals = "fast (/operation2)"
locked = "Not fast"
[[frame.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = "Stop"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "stop" }
interlock = "order"
[[page]]
id = "one"
title = "One"
fit = true
"""
    + GROUP % "Belt"
    + BUTTON % ("back", "Back", "back")
    + 'interlock = "order"\n'
    + BUTTON % ("forward", "Forward", "forward")
    + 'interlock = "order"\n'
    + GROUP % "Arm"
    + BUTTON % ("up", "Up", "up")
    + 'interlock = "order"\n'
    + BUTTON % ("down", "Down", "down")
    + 'interlock = ["fast", "order"]\n'
    + GROUP % "Order"
    + BUTTON.replace("operation1", "operation2") % ("go", "Go", "go")
    + BUTTON.replace("operation1", "operation2") % ("halt", "Halt", "halt")
    + """
[[page.group.widget]]
id = "heard"
kind = "readout"
label = "Heard"
topic = "/last_heard"
type = "std_msgs/msg/String"
"""
)
SHORT: Final = "Release it first"
LONG: Final = (
    "The order is not released yet: ask at the office, then release it at the terminal of the line."
)
SHIFTS: Final = """() => new Promise((resolve) => {
  const show = (list) => resolve(list.getEntries().map(({ value }) => value));
  new PerformanceObserver(show).observe({ type: "layout-shift", buffered: true });
  setTimeout(() => resolve([]), 500);
})"""


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL % SHORT) as mine:
        until(lambda: mine.widget("halt")["enabled"], "the robot is there")
        yield mine


def test_one_reason_of_all_buttons_stands_beside_the_title(cell: Server, page: Page) -> None:
    says(cell, "halt")
    sized(page, 1280, 800).goto(cell.url)
    belt, arm = page.get_by_role("region", name="Belt"), page.get_by_role("region", name="Arm")
    expect(belt.locator(".said")).to_have_text(SHORT)
    expect(belt.locator(".said")).to_be_visible()
    for name in ("back", "forward"):
        expect(page.locator(f"#why-{name}")).to_be_hidden()
        button = page.get_by_role("button", name=name.capitalize(), exact=True)
        expect(button).to_be_disabled()
        expect(button).to_have_accessible_description(SHORT)
    expect(arm.locator(".said")).to_be_hidden()  # its buttons have two reasons
    expect(page.locator("#why-up")).to_be_visible()
    assert page.evaluate(SHIFTS) == []  # nothing moves on a button
    page.locator("[data-widget=back]").click()
    expect(page.get_by_role("dialog", name="Back is locked")).to_be_visible()


@pytest.mark.long("detail")
def test_it_goes_with_the_lock(cell: Server, page: Page) -> None:
    says(cell, "halt")
    sized(page, 1280, 800).goto(cell.url)
    said = page.get_by_role("region", name="Belt").locator(".said")
    expect(said).to_be_visible()
    says(cell, "go")
    expect(said).to_be_hidden()
    expect(page.get_by_text("Moves while held").first).to_be_visible()


@pytest.mark.parametrize(("size", "text"), [((1280, 800), LONG), ((800, 480), SHORT)])
def test_where_it_has_no_room_each_button_says_it(
    page: Page, tmp_path_factory: pytest.TempPathFactory, size: tuple[int, int], text: str
) -> None:
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL % text) as cell:
        until(lambda: cell.widget("halt")["enabled"], "the robot is there")
        says(cell, "halt")
        sized(page, *size).goto(cell.url)
        expect(page.locator("[data-widget=back] .more")).to_be_attached()
        expect(page.locator("#why-back")).to_be_visible()
        expect(page.locator("#why-back")).to_contain_text(text)


def test_a_stop_whose_reason_is_cut_opens_nothing_and_has_it_above_the_page(
    cell: Server, page: Page
) -> None:
    says(cell, "halt")
    sized(page, 1280, 800).goto(cell.url)
    stop = page.locator("[data-widget=stop]")
    assert stop.locator(".why").evaluate("(why) => why.scrollHeight > why.clientHeight + 1")
    expect(stop.locator(".more[data-clipped]")).to_be_visible()
    assert stop.locator(".more").evaluate("(more) => getComputedStyle(more).opacity") == "1"
    stop.click()
    report = page.locator(".stop-report")
    expect(report).to_contain_text("Use E-stop.")
    expect(report).to_contain_text(SHORT)
    expect(page.locator("#whole")).to_be_hidden()
