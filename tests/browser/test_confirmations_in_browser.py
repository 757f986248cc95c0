"""A press that asks first and is then confirmed, in every browser."""

from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.cell.commands.test_confirmations import TYPED, panel_file
from tests.support.browser.pages import asked, place
from tests.support.parts import ROOT, TAP_AGAIN_MS, Server
from tests.support.servers import ready


@pytest.fixture
def asking(tmp_path: Path, servers: Callable[[Server], Server]) -> Server:
    path = panel_file(tmp_path, f"confirm_press = true\n{TYPED}")
    return servers(ready(Server(ROOT, KIOSK_PANEL=str(path))))


def test_a_press_is_confirmed_by_the_robot_in_every_browser(
    asking: Server, page: Page, chromium: Browser
) -> None:
    other_context = chromium.new_context()
    other = other_context.new_page()
    other.goto(asking.url)
    page.goto(asking.url)
    page.get_by_label("Message").fill("a <b>part</b>")
    dialog = asked(page.get_by_role("button", name="Start"))
    expect(dialog).to_contain_text("Start?")
    expect(dialog).to_contain_text("a <b>part</b>")
    for width, height in ((1280, 800), (1024, 600)):
        page.set_viewport_size({"width": width, "height": height})
        for name in ("Back", "Start"):
            box = place(dialog.get_by_role("button", name=name))
            assert min(box["width"], box["height"]) >= 90  # 20 mm
    dialog.get_by_role("button", name="Back").click()
    expect(dialog).to_be_hidden()
    assert asking.widget("go")["outcome"] == ""
    page.get_by_role("button", name="Start").click()
    dialog.get_by_role("button", name="Start").click()
    expect(dialog).to_be_hidden()
    for browser_page in (page, other):
        expect(browser_page.locator('[data-widget="go"] .result')).to_contain_text(
            "Confirmed by the robot"
        )
    expect(page.locator('[data-widget="go"] .receipt')).to_be_empty()
    other_context.close()


@pytest.mark.long("detail")
def test_without_scripts_the_server_asks(asking: Server, without_scripts: Page) -> None:
    page = without_scripts
    page.goto(asking.url)
    page.get_by_label("Message").fill("by form")
    page.get_by_role("button", name="Start").click()
    expect(page.locator("h2")).to_have_text("Start?")
    expect(page.locator("dd")).to_have_text("by form")
    page.get_by_role("link", name="Back").click()
    expect(page.get_by_label("Message")).to_be_visible()
    assert asking.widget("go")["outcome"] == ""
    page.get_by_label("Message").fill("by form")
    page.get_by_role("button", name="Start").click()
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Start").click()
    expect(page.locator('[data-widget="go"] .result')).to_contain_text("Confirmed by the robot")


def test_a_lock_takes_the_question_away(
    tmp_path: Path, servers: Callable[[Server], Server], page: Page
) -> None:
    path = panel_file(tmp_path, "confirm_press = true")
    mine = servers(ready(Server(ROOT, KIOSK_PANEL=str(path))))
    page.goto(mine.url)
    asked(page.get_by_role("button", name="Start"))
    mine.process.kill()
    expect(page.get_by_role("dialog")).to_be_hidden()
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
