"""The receipt of a press looks old after some seconds, and goes."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("detail")

PANEL: Final = """
title = "Cell"
mode = "demo"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "on"
kind = "publish"
label = "On"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "on" }
"""
SHOW: Final = "([outcome, text]) => showOutcome(document.querySelector('#receipt-on'), outcome, text)"


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL) as mine:
        until(lambda: mine.widget("on")["enabled"], "the robot is there")
        yield mine


def test_a_receipt_ages_and_goes(cell: Server, own_page: Page) -> None:
    page = own_page
    page.goto(cell.url)
    page.locator("[data-widget=on] .more").wait_for(state="attached")
    page.get_by_role("button", name="On", exact=True).click()
    receipt = page.locator("#receipt-on")
    expect(receipt).to_contain_text("Sent at")
    page.evaluate("""() => import(document.querySelector('link[href$="/show.js"]').href)
      .then(({ showOutcome }) => { window.showOutcome = showOutcome; })""")
    page.clock.install()
    page.evaluate(
        "showOutcome(document.querySelector('#receipt-on'), 'published', 'Sent at 14:02:11.')"
    )
    expect(receipt).not_to_have_attribute("data-aged", "")
    page.clock.run_for(10_100)
    expect(receipt).to_have_attribute("data-aged", "")
    expect(receipt).to_have_text("Sent at 14:02:11.")
    page.clock.run_for(50_000)
    expect(receipt).to_have_text("")
    page.evaluate(SHOW, ["refused", "Not sent."])
    page.clock.run_for(599_000)
    expect(receipt).to_have_text("Not sent.")
    page.clock.run_for(2_000)
    expect(receipt).to_have_text("")
