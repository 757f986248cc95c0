"""All reasons of a control with several interlocks, read by an operator."""

import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_pages import SIZES as LARGE
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("every screen")

SIZES: Final = [*LARGE, (800, 480)]
PANEL: Final = """
title = "Cell"
[[interlock]]
id = "doors"
label = "open doors"
topic = "/doors_closed"
[[interlock]]
id = "air"
topic = "/air"
type = "std_msgs/msg/Float64"
min = 5
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "several"
kind = "publish"
label = "Several"
topic = "/several"
type = "std_msgs/msg/Empty"
message = {}
interlock = ["doors", "air"]
[[page.widget]]
id = "single"
kind = "publish"
label = "Single"
topic = "/single"
type = "std_msgs/msg/Empty"
message = {}
[[page.widget]]
id = "below"
kind = "publish"
label = "Below"
topic = "/below"
type = "std_msgs/msg/Empty"
message = {}
span = 12
[demo]
"/doors_closed" = { silent = true }
"/air" = { silent = true }
"""
NO_AIR: Final = "Locked: /air is not known yet."


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """On the robot that it simulates, which says nothing of doors and air."""
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL) as mine:
        until(lambda: mine.widget("single")["enabled"], "the robot is there")
        yield mine


@pytest.mark.parametrize("scripts", [True, False])
@pytest.mark.parametrize("size", SIZES)
def test_an_operator_with_gloves_reads_all_reasons(
    kiosk: Server, chromium: Browser, size: tuple[int, int], scripts: bool
) -> None:
    width, height = size
    context = chromium.new_context(
        viewport={"width": width, "height": height}, java_script_enabled=scripts, has_touch=True
    )
    page = context.new_page()
    page.goto(kiosk.url)
    button = page.get_by_role("button", name="Several", exact=True)
    why, whole = page.locator("#why-several"), page.locator("#whole")
    expect(button).to_be_disabled()
    expect(why).to_contain_text("Locked: open doors is not known yet.")
    expect(why).to_contain_text("+1 more")
    expect(why).to_be_visible(visible=scripts)
    expect(whole).to_be_hidden()
    described = (button.get_attribute("aria-describedby") or "").split()
    assert {"why-several", "reasons-several"} <= set(described)
    below = page.locator('[data-widget="below"]').bounding_box()
    reasons = f"Locked: open doors is not known yet.\n{NO_AIR}"
    if scripts:
        expect(page.locator('[data-widget="several"] .more')).to_be_attached()
        page.locator('[data-widget="several"]').tap()
        expect(whole.get_by_role("heading")).to_have_text("Several is locked")
        expect(whole.locator(".reason")).to_have_text(reasons.splitlines())
        expect(whole).to_be_in_viewport()
        assert page.locator('[data-widget="below"]').bounding_box() == below  # it moves nothing
        page.locator("header h1").tap()
        expect(whole).to_be_hidden()
    else:
        expect(page.locator("#reasons-several")).to_be_visible()
        expect(page.locator("#reasons-several")).to_have_text(reasons, use_inner_text=True)
    context.close()


def test_a_page_without_its_server_shows_that_alone(
    page: Page, servers: Callable[[Server], Server], tmp_path: Path
) -> None:
    mine = servers(demo_server(tmp_path, PANEL))
    until(lambda: mine.widget("single")["enabled"], "the robot is there")
    page.goto(mine.url)
    why = page.locator("#why-several")
    expect(why).to_contain_text("+1 more")
    expect(page.locator('[data-widget="several"] .more')).to_be_attached()  # its script is there
    page.locator('[data-widget="several"]').click()
    expect(page.locator("#whole .reason").last).to_have_text(NO_AIR)
    mine.process.send(signal.SIGSTOP)
    try:
        lost = "No connection to the panel server."
        expect(why).to_contain_text(lost)
        expect(why.locator("b")).to_have_text("")
        expect(page.locator("#reasons-several")).to_have_text(lost)
        expect(page.locator("#whole > p")).to_have_text(lost)
    finally:
        mine.process.send(signal.SIGCONT)
    expect(why).to_contain_text("+1 more")
