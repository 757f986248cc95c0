"""A sign-in that is ended from afar, seen in two browsers."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_sign_in import signed_in_by_pad
from tests.browser.test_users_page import SECOND_TAP_MS
from tests.support.parts import ROOT, Server
from tests.support.servers import ready
from tests.support.users import add_user

pytestmark = pytest.mark.promise("users")


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
        engineer.wait_for_timeout(SECOND_TAP_MS)
        engineer.locator(".account form button").click()
        expect(engineer.locator(".people li")).to_have_count(1)
        expect(engineer.locator(".said").first).to_contain_text("M. Sato is signed out")
    operator.wait_for_url("**/signin*")
    expect(operator.locator("p.said")).to_have_text("You were signed out by J. Brandt.")
    expect(operator.locator("a.user")).to_have_attribute("data-user", "")
