"""Stop of the frame stops every robot of a page: eight by a click on the overview, two by a finger."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.browsers import sized
from tests.support.browser.finger import Touch
from tests.support.browser.pages import middle
from tests.support.browser.touch import loaded
from tests.support.parts import Server, until
from tests.support.servers import demo_server

EIGHT: Final = [f"Cell {n}" for n in range(1, 9)]
STOP: Final = "[data-widget=stop] > button"
PANEL: Final = (
    """
title = "Palletizing"
mode = "demo"
languages = ["en", "de", "ja"]

[[frame.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = { en = "Stop", de = "Stopp", ja = "停止" }
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "stop" }

[[page]]
id = "robots"
title = "Robots"
overview = true

[[page]]
id = "two"
title = "Two"
"""
    + "".join(
        f"""
[[robot]]
id = "cell{n}"
name = "Cell {n}"
namespace = "/cell{n}"
"""
        for n in range(1, 9)
    )
    + "".join(
        f"""
[[page.widget]]
id = "heard{n}"
kind = "readout"
label = "Cell {n}"
robot = "cell{n}"
topic = "/last_heard"
type = "std_msgs/msg/String"
"""
        for n in (1, 2)
    )
)


@pytest.fixture(scope="module")
def cells(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cells"), PANEL) as server:
        yield server


def stopped(server: Server) -> list[str]:
    """The robots that were sent a stop, in the order of the file, each as often as it was."""
    lines = [line for line in server.process.text.splitlines() if " of stop by " in line]
    return sorted(name for line in lines for name in EIGHT if f"{name}:" in line)


def sent(server: Server, before: list[str], names: list[str]) -> None:
    until(lambda: len(stopped(server)) >= len(before) + len(names), "each robot is sent it")
    assert stopped(server) == sorted([*before, *names])


@pytest.mark.parametrize("size", [(1280, 800), (800, 480)], ids=["1280", "800"])
def test_a_click_on_the_overview_stops_eight(page: Page, cells: Server, size: tuple[int, int]) -> None:
    loaded(sized(page, *size), cells, "/robots/cell3/pages/robots")
    stop, before = page.get_by_role("button", name="Stop All 8 robots"), stopped(cells)
    stop.click()
    sent(cells, before, EIGHT)
    receipt = page.locator("[data-widget=stop] .receipt")
    expect(receipt).to_contain_text("Sent to all")
    assert receipt.evaluate("(text) => text.scrollHeight <= text.clientHeight + 1")
    expect(page.locator(".stop-report")).to_be_hidden()
    expect(page.locator("#whole")).to_be_hidden()


def test_a_finger_on_a_page_of_two_stops_both(touchscreen: Page, cells: Server) -> None:
    page = loaded(sized(touchscreen, 1280, 800), cells, "/robots/cell2/pages/two")
    touch, stop, before = Touch(page), page.locator(STOP), stopped(cells)
    expect(stop).to_have_accessible_name("Stop Cell 1, Cell 2")
    touch.send("touchStart", middle(stop))
    touch.send("touchEnd")
    sent(cells, before, ["Cell 1", "Cell 2"])


def test_a_page_without_scripts_stops_eight(own_page: Page, cells: Server) -> None:
    context = own_page.context.browser
    assert context is not None
    plain = context.new_page(java_script_enabled=False)
    before = stopped(cells)
    plain.goto(f"{cells.url}/robots/cell1/pages/robots")
    plain.get_by_role("button", name="Stop All 8 robots").click()
    expect(plain.locator("[data-widget=stop] .receipt")).to_contain_text("Sent to all")
    sent(cells, before, EIGHT)
    plain.context.close()
