"""Languages in a real browser: chosen in the menu, for this browser alone."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.pages import asked
from tests.support.parts import ROOT, TAP_AGAIN_MS, Server
from tests.support.servers import ready
from tests.web.test_panel_languages import APP, PANEL

pytestmark = pytest.mark.long("detail")


@pytest.fixture(scope="module")
def kiosk() -> Iterator[Server]:
    with ready(Server(ROOT, app=APP, KIOSK_PANEL=str(PANEL))) as mine:
        yield mine


def choose(page: Page, language: str) -> None:
    page.locator(".menu-key").click()
    page.get_by_role("button", name=language, exact=True).click()


@pytest.mark.long(None)
def test_browser_changes_its_own_language_only(chromium: Browser, page: Page, kiosk: Server) -> None:
    other = chromium.new_page()
    for browser_page in (page, other):
        browser_page.goto(kiosk.url)
        expect(browser_page.locator('[data-widget="speed"] .value')).to_have_text("−1,234.5 mm/s")
    choose(page, "Deutsch")
    expect(page.locator("html")).to_have_attribute("lang", "de")
    expect(page.locator('[data-widget="speed"] .value')).to_have_text("−1.234,5 mm/s")
    expect(page.locator('[data-widget="locked"] .why')).to_contain_text("erlaubt die Tür nicht")
    page.locator('[data-widget="set_limit"] button[type=submit]').click()
    expect(page.locator("#receipt-set_limit")).to_contain_text("Gesendet auf /limit um")
    other.locator('[data-widget="set_limit"] button[type=submit]').click()
    expect(other.locator("#receipt-set_limit")).to_contain_text("Sent at")
    choose(page, "日本語")
    expect(page.locator("#label-speed")).to_have_text("速度")
    expect(page.locator("h1")).to_have_text("セル1")
    page.locator('[data-widget="limit"] input').fill("7.5")
    page.locator('[data-widget="set_limit"] button[type=submit]').click()
    expect(page.locator("#receipt-set_limit")).to_contain_text("上限は7.5です")
    expect(other.locator("#label-speed")).to_have_text("Speed")
    other.close()


def test_comma_key_is_shown_for_languages_with_a_decimal_comma(page: Page, kiosk: Server) -> None:
    page.goto(kiosk.url)
    choose(page, "Deutsch")
    expect(page.locator("html[lang=de][data-inputs]")).to_be_attached()
    entry = page.locator('[data-widget="limit"] input')
    entry.fill("")
    entry.press_sequentially("0,5")
    expect(entry).to_have_value("0,5")
    page.locator('[data-widget="asked"] button[type=submit]').click()
    expect(page.locator('dialog [data-value-of="limit"]')).to_have_text("0,5")


def test_a_question_shows_a_negative_number_with_a_true_minus_sign(page: Page, kiosk: Server) -> None:
    page.goto(kiosk.url)
    page.locator('[data-widget="limit"] input').fill("-1.5")
    asked(page.locator('[data-widget="asked"] button[type=submit]'))
    expect(page.locator('dialog [data-value-of="limit"]')).to_have_text("−1.5")


def test_without_scripts_the_language_changes_too(without_scripts: Page, kiosk: Server) -> None:
    page = without_scripts
    page.goto(kiosk.url)
    choose(page, "日本語")
    expect(page.locator("html")).to_have_attribute("lang", "ja")
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.locator('[data-widget="limit"] input').fill("7.5")
    page.locator('[data-widget="set_limit"] button[type=submit]').click()
    expect(page.locator("#receipt-set_limit")).to_contain_text("上限は7.5です")
