"""Sign-in with a finger on the pad, with a badge, hand-over, and the sign-out after idle time."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from tests.support.browser.pages import CUT_TILES
from tests.support.browser.touch import READER_S, Keys
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready
from tests.support.users import add_user, says
from tests.web.test_alarms import listed, server_with

pytestmark = pytest.mark.promise("users")

SIZES = ((1280, 800), (1024, 600), (800, 480))
PIN_IS = {"M. Sato": "2580", "K. Novak": "1470"}


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_user(data, "M. Sato", "operator", pin="2580", badge="04A2B3")
    add_user(data, "K. Novak", "maintenance", pin="1470")
    add_user(data, "J. Brandt", "engineer", password="long enough")
    panel = tmp_path_factory.mktemp("panel") / "panel.toml"
    panel.write_text((ROOT / "tests/reference.toml").read_text() + "\n[access]\nidle_s = 36\n")
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo", KIOSK_PANEL=str(panel))) as mine:
        yield mine


def signed_in_by_pad(page: Page, server: Server, user: str, pin: str) -> None:
    """From the header, with two touches and the digits."""
    page.locator("a.user").click()
    page.locator(".tile", has_text=user).click()
    for digit in pin:
        page.locator(f".pad button[value='{digit}']").click()
    page.locator(".sign-in-key").click()


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES)
def test_a_user_signs_in_on_the_pad_and_hands_over(
    own_page: Page, kiosk: Server, size: tuple[int, int]
) -> None:
    page = own_page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(kiosk.url)
    expect(page.locator("a.user")).to_have_attribute("data-user", "")
    for user, pin in PIN_IS.items():
        signed_in_by_pad(page, kiosk, user, pin)
        expect(page.locator("a.user")).to_have_attribute("data-user", user)
    page.locator("a.user").click()
    page.locator("form[action$='/session/end'] button").click()
    expect(page.locator("a.user")).to_have_attribute("data-user", "")


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_everything_of_the_page_is_within_the_screen(
    own_page: Page, kiosk: Server, size: tuple[int, int], language: str
) -> None:
    page = own_page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.set_extra_http_headers({"accept-language": language})
    page.goto(f"{kiosk.url}/signin?user=M.+Sato")
    for selector in (".tile", ".pad button", ".sign-in-key", ".badge-form", "a.user"):
        for part in page.locator(selector).all():
            box = part.bounding_box()
            assert box is not None, selector
            assert box["x"] >= 0, selector
            assert box["y"] >= 0, selector
            assert box["x"] + box["width"] <= size[0], selector
            assert box["y"] + box["height"] <= size[1], selector
            assert min(box["width"], box["height"]) >= 40, selector


@pytest.mark.long("detail")
def test_a_sign_in_reaches_the_other_tabs_of_the_browser(own_page: Page, kiosk: Server) -> None:
    page = own_page
    other = page.context.new_page()
    other.goto(kiosk.url)
    page.goto(kiosk.url)
    signed_in_by_pad(page, kiosk, "M. Sato", "2580")
    expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")
    expect(other.locator("a.user")).to_have_attribute("data-user", "M. Sato")
    button = other.locator('[data-widget="operation1"] button:not(.more)')
    expect(button).to_be_enabled()
    page.locator("a.user").click()
    page.locator("form[action$='/session/end'] button").click()
    expect(button).to_be_disabled()


def test_a_wrong_pin_says_so_and_is_not_kept(own_page: Page, kiosk: Server) -> None:
    page = own_page
    page.goto(kiosk.url)
    signed_in_by_pad(page, kiosk, "K. Novak", "1471")
    expect(page.locator("p.said")).to_contain_text("The user or the PIN is wrong. Tries left:")
    expect(page.locator("input[name=pin]")).to_have_value("")
    assert not says(page.content(), "1471")


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES)
def test_a_wrong_pin_moves_nothing_and_no_tile_is_cut(
    own_page: Page, kiosk: Server, size: tuple[int, int]
) -> None:
    page = own_page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.set_extra_http_headers({"accept-language": "de"})
    page.goto(f"{kiosk.url}/signin?user=M.+Sato")
    assert page.locator(".tiles").evaluate(CUT_TILES) == []
    pad, key = page.locator(".pad"), page.locator(".sign-in-key")
    before = [pad.bounding_box(), key.bounding_box()]
    page.locator(".pad button[value='1']").click()
    key.click()
    said = page.locator("p.said")
    expect(said).to_contain_text("falsch")
    assert [pad.bounding_box(), key.bounding_box()] == before
    inside, field = said.bounding_box(), page.locator(".pin").bounding_box()
    assert inside == field
    page.locator(".pad button[value='1']").click()
    expect(said).to_be_hidden()
    for digit in "clear", *"2580":
        page.locator(f".pad button[value='{digit}']").click()
    key.click()
    expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")


@pytest.mark.long("detail")
def test_a_check_that_takes_long_says_that_it_goes_on(own_page: Page, kiosk: Server) -> None:
    page, held = own_page, list[Route]()
    page.route("**/session", lambda route: held.append(route))
    page.goto(f"{kiosk.url}/signin?user=M.+Sato")
    for digit in "2580":
        page.locator(f".pad button[value='{digit}']").click()
    expect(page.locator("input[name=pin]")).to_have_value("2580")
    page.locator(".sign-in-key").click()
    expect(page.locator("p.said")).to_have_text("Still checking. Please wait.")
    page.locator(".sign-in-key").click()
    assert len(held) == 1
    held[0].continue_()
    expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")


def test_acknowledge_stays_locked_while_nobody_is_signed_in(own_page: Page, tmp_path: Path) -> None:
    """Its script has heard that no control is required."""
    add_user(tmp_path / "data", "M. Sato", "operator", pin="2580")
    page = own_page
    with server_with(tmp_path, data=tmp_path / "data") as server:
        until(lambda: listed(server), "an alarm is raised")
        page.goto(server.url)
        expect(page.locator("html[data-floor]")).to_be_attached()
        button = page.locator(".alarm-line button[type=submit]")
        expect(page.locator(".alarm-line .by-control")).to_be_visible()
        expect(button).to_be_disabled()
        signed_in_by_pad(page, server, "M. Sato", "2580")
        expect(button).to_be_enabled()
        expect(page.locator(".alarm-line .by-control")).to_be_hidden()


def test_a_badge_is_read_without_a_touch_and_never_shown(own_page: Page, kiosk: Server) -> None:
    page = own_page
    page.goto(f"{kiosk.url}/signin")
    expect(page.locator("#badge")).to_be_focused()
    expect(page.locator("#badge")).to_have_attribute("type", "password")
    Keys(page, READER_S).type("04A2B3\n")
    expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")
    assert "04A2B3" not in page.content() + page.url


@pytest.mark.long("detail")
def test_a_password_signs_in(own_page: Page, kiosk: Server) -> None:
    page = own_page
    page.goto(f"{kiosk.url}/signin?user=J.+Brandt")
    page.locator("#password").fill("long enough")
    page.locator(".sign-in-key").click()
    expect(page.locator("a.user")).to_have_attribute("data-user", "J. Brandt")


@pytest.mark.long("detail")
def test_without_a_touch_a_warning_comes_which_a_touch_ends(own_page: Page, kiosk: Server) -> None:
    page = own_page
    page.goto(kiosk.url)
    signed_in_by_pad(page, kiosk, "M. Sato", "2580")
    expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")
    expect(page.locator("#idle")).to_be_visible(timeout=20_000)
    page.locator("#idle").click()
    expect(page.locator("#idle")).to_be_hidden()


@pytest.mark.long("real time")
def test_idle_time_ends_in_the_page_of_sign_in(own_page: Page, kiosk: Server) -> None:
    page = own_page
    page.goto(kiosk.url)
    signed_in_by_pad(page, kiosk, "M. Sato", "2580")
    expect(page.locator("a.user")).to_have_attribute("data-user", "M. Sato")
    page.wait_for_url(f"{kiosk.url}/signin", timeout=60_000)
    expect(page.locator("a.user")).to_have_attribute("data-user", "")
