"""The page of users: by finger with the keyboard on the screen, without scripts, at every size."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from app.cell.people.secrets_hash import matches
from app.cell.people.users_file import UsersFile
from app.web.language import COOKIE as LANGUAGE
from tests.browser.test_accessibility import violations
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, settled
from tests.support.parts import ROOT, TAP_AGAIN_MS, Server, until
from tests.support.servers import ready
from tests.support.users import add_user, token_of

pytestmark = pytest.mark.long("detail")

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
ENGINEER: Final = {"user": "J. Brandt", "password": "long enough"}
SHOWN: Final = (
    "", "?name=M.+Sato", "?mode=add", "?name=M.+Sato&mode=role", "?name=M.+Sato&mode=pin",
    "?name=M.+Sato&mode=remove", "?tokens=true&name=line",
)  # fmt: skip
# Texts and buttons that leave their place.
CUT: Final = """() => [...document.querySelectorAll("main :is(.act, .act *, em, dd, h2, .tiles span)")]
  .filter((e) => e.checkVisibility() && e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0)
  .map((e) => e.className + ":" + e.textContent.trim())"""
SMALL: Final = """() => [...document.querySelectorAll("main :is(a, button, input:not([type=hidden]))")]
  .filter((e) => e.checkVisibility())
  .map((e) => (e.closest(".tiles label") ?? e).getBoundingClientRect())
  .filter((box) => box.height < 44 || box.width < 44).length"""


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_user(data, "J. Brandt", "engineer", password="long enough")
    add_user(data, "M. Sato", "operator", pin="2580", groups=("quality",))
    token_of(data, "line", "operator")
    panel = tmp_path_factory.mktemp("panel") / "panel.toml"
    groups = '\n[access]\ngroups = ["quality", "tooling"]\n'
    panel.write_text((ROOT / "tests/reference.toml").read_text() + groups)
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo", KIOSK_PANEL=str(panel))) as mine:
        yield mine


def signed_in(page: Page, kiosk: Server) -> None:
    page.goto(kiosk.url)
    assert page.request.post(f"{kiosk.url}/session", data=ENGINEER).ok


def users_page(page: Page, kiosk: Server, query: str = "") -> None:
    page.goto(f"{kiosk.url}/users{query}")
    expect(page.locator("html[data-floor]")).to_be_attached()


def save(page: Page) -> None:
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Save").click()


@pytest.mark.long(None)
def test_an_engineer_adds_and_changes_a_user_by_finger(chromium: Browser, kiosk: Server) -> None:
    with chromium.new_context(has_touch=True, viewport={"width": 800, "height": 480}) as context:
        page = context.new_page()
        signed_in(page, kiosk)
        page.goto(kiosk.url)
        page.locator(".menu-key").tap()
        page.locator("#menu a[href='/users']").tap()
        page.get_by_role("link", name="Add user").tap()
        expect(page.locator("html[data-floor]")).to_be_attached()
        for place, text in (("#name", "kim"), ("#entered", "1470")):
            page.locator(place).tap()
            for letter in text:
                page.locator(f".sheet.keyboard button[data-key='{letter}']").tap()
            page.locator(".sheet .set-entry").tap()
            expect(page.locator(".sheet")).to_have_count(0)
            expect(page.locator(place)).to_have_value(text)
        expect(page.locator("#entered")).to_have_attribute("type", "password")
        page.wait_for_timeout(TAP_AGAIN_MS)
        page.get_by_text("Maintenance").tap()
        page.get_by_role("button", name="Save").tap()
        expect(page.locator(".said")).to_have_text('"kim" can sign in.')
        expect(page.locator("dd").first).to_have_text("Maintenance")
        page.wait_for_timeout(TAP_AGAIN_MS)
        page.get_by_role("button", name="Disable").tap()
        expect(page.locator(".account .head p")).to_have_text("Disabled")
    kim = UsersFile(kiosk.data).read().user("kim")
    assert kim is not None
    assert (kim.role, kim.disabled, matches(kim.pin, "1470")) == ("maintenance", True, True)


def test_enter_saves_a_new_pin_and_does_not_remove_it(own_page: Page, kiosk: Server) -> None:
    page = own_page
    signed_in(page, kiosk)
    users_page(page, kiosk, "?name=M.+Sato&mode=pin")
    page.locator("#entered").fill("9753")
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.keyboard.press("Enter")
    expect(page.locator(".said")).to_contain_text("The PIN of")
    sato = UsersFile(kiosk.data).read().user("M. Sato")
    assert sato is not None
    assert matches(sato.pin, "9753")


def test_a_page_without_scripts_makes_and_revokes_a_token(without_scripts: Page, kiosk: Server) -> None:
    page = without_scripts
    signed_in(page, kiosk)
    page.goto(f"{kiosk.url}/users?tokens=true&mode=token")
    page.locator("#name").fill("robot cell 2")
    page.get_by_text("Viewer").click()
    save(page)
    expect(page.locator("#made")).to_have_value("opt_" + page.locator("#made").input_value()[4:])
    assert "opt_" not in page.url
    page.get_by_role("link", name="Revoke").click()
    expect(page.locator("#made")).to_have_count(0)
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_role("button", name="Revoke").click()
    expect(page.locator(".said")).to_contain_text("is revoked")
    names = {token.name for token in UsersFile(kiosk.data).read().tokens}
    until(lambda: names == {"line"}, "the other token stays")


def test_axe_finds_nothing_and_nothing_is_cut_at_any_size(axe_page: Page, kiosk: Server) -> None:
    signed_in(axe_page, kiosk)
    for language in ("en", "ja", "de"):
        axe_page.context.add_cookies([{"name": LANGUAGE, "value": language, "url": kiosk.url}])
        for query in SHOWN:
            users_page(axe_page, kiosk, query)
            for width, height in SIZES:
                sized(axe_page, width, height).evaluate(DRAWN)
                about = (language, query, width)
                assert axe_page.evaluate("document.documentElement.scrollWidth") == width, about
                assert settled(axe_page, CUT) == [], about
                assert axe_page.evaluate(SMALL) == 0, about
                if language == "en":
                    assert violations(axe_page) == [], about
