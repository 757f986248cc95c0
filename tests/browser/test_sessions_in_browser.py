"""A sign-in that is ended from afar, seen in two browsers; one's own by a finger at each size."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_sign_in import signed_in_by_pad
from tests.browser.test_users_page import CUT, SIZES, SMALL
from tests.support.browser.browsers import sized
from tests.support.browser.pages import without_its_time
from tests.support.parts import ROOT, TAP_AGAIN_MS, Server
from tests.support.servers import ready
from tests.support.users import add_user

pytestmark = pytest.mark.promise("users")

# In each language: the page's title, and the mark of the sign-in at this browser.
WORDS: Final = {
    "en": ("My sign-ins", "This browser"),
    "ja": ("自分のサインイン", "このブラウザー"),
    "de": ("Meine Sitzungen", "Dieser Browser"),
}


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580")
    add_user(data, "J. Brandt", "engineer", pin="8642")
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo")) as mine:
        yield mine


def test_the_ended_browser_locks_and_says_who_ended_it(
    own_page: Page, chromium: Browser, kiosk: Server
) -> None:
    operator = own_page
    operator.goto(kiosk.url)
    signed_in_by_pad(operator, kiosk, "M. Sato", "2580")
    expect(operator.locator("a.user")).to_have_attribute("data-user", "M. Sato")
    with chromium.new_context(viewport={"width": 1280, "height": 800}) as context:
        engineer = context.new_page()
        engineer.goto(kiosk.url)
        signed_in_by_pad(engineer, kiosk, "J. Brandt", "8642")
        expect(engineer.locator("a.user")).to_have_attribute("data-user", "J. Brandt")
        engineer.goto(f"{kiosk.url}/users?sessions=true")
        expect(engineer.locator(".people li")).to_have_count(2)
        engineer.locator(".people a", has_text="M. Sato").click()
        expect(engineer.locator("#user-title")).to_have_text("M. Sato")
        engineer.wait_for_timeout(TAP_AGAIN_MS)
        engineer.locator(".account form button").click()
        expect(engineer.locator(".people li")).to_have_count(1)
        expect(engineer.locator(".said").first).to_contain_text("M. Sato is signed out")
    operator.wait_for_url("**/signin*")
    expect(operator.locator("p.said")).to_have_text("You were signed out by J. Brandt.")
    expect(operator.locator("a.user")).to_have_attribute("data-user", "")


@pytest.mark.parametrize("language", WORDS)
def test_a_user_ends_another_sign_in_of_the_own_by_a_finger(
    chromium: Browser, kiosk: Server, language: str
) -> None:
    title, mark = WORDS[language]
    with (
        chromium.new_context(locale=language) as other,
        chromium.new_context(locale=language, has_touch=True, bypass_csp=True) as context,
    ):
        ended, page = other.new_page(), context.new_page()
        for each in (ended, page):
            each.goto(kiosk.url)
            signed_in_by_pad(each, kiosk, "M. Sato", "2580")
            expect(each.locator("a.user")).to_have_attribute("data-user", "M. Sato")
        for width, height in SIZES:
            page.goto(f"{kiosk.url}/signin")
            sized(page, width, height)
            expect(page.locator(".own")).to_have_text(title)
            expect(page.locator(".own")).to_be_in_viewport(ratio=1)
            expect(page.locator(".sign-in .small-key")).to_be_in_viewport(ratio=1)
            page.locator(".own").tap()
            expect(page.locator("#users-title")).to_have_text(title)
            expect(page.locator(".people em")).to_have_text([mark])
            for query in ("", f"?name={handle_of_other(page)}"):
                page.goto(f"{kiosk.url}/sessions{query}")
                expect(page.locator("html[data-floor]")).to_be_attached()
                assert page.evaluate(CUT) == []
                assert page.evaluate(SMALL) == 0
                assert page.evaluate("document.documentElement.scrollWidth") == width
        assert violations(page) == []
        without_its_time(page)
        page.locator(".account form button").tap()
        expect(page.locator(".people li")).to_have_count(1)
        ended.wait_for_url("**/signin*")
        expect(ended.locator("a.user")).to_have_attribute("data-user", "")
        expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")
        page.request.delete(f"{kiosk.url}/session")


def handle_of_other(page: Page) -> str:
    """The id of the sign-in that is not that of the page's browser."""
    other = page.locator(".people li").filter(has_not=page.locator("em"))
    handle = other.get_attribute("data-row")
    assert handle
    return handle
