"""Sign-in with a typed name, and the pages of tiles of a panel with many users, on a touched screen."""

from collections.abc import Iterator
from typing import Final
from urllib.parse import quote

import pytest
from playwright.sync_api import Browser, Page, ViewportSize, expect

from tests.support.browser.pages import CUT_TILES, DRAWN
from tests.support.parts import ROOT, Server
from tests.support.servers import ready
from tests.support.users import add_user, says

pytestmark = pytest.mark.long("detail")

SIZES = ((1280, 800), (1024, 600), (800, 480))
LANGUAGES = ("en", "de", "ja")
NAMES = [f"{letter}. User" for letter in "ABCDEFGHIJKLM"]
TYPED = "novak"


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    for name in NAMES:
        add_user(data, name, "operator", pin="2580", badge="04A2B3" if name == NAMES[0] else "")
    add_user(data, TYPED, "engineer", pin="1470", password="long enough")
    panel = tmp_path_factory.mktemp("panel") / "panel.toml"
    panel.write_text((ROOT / "tests/reference.toml").read_text())
    with ready(Server(ROOT, KIOSK_DATA=str(data), KIOSK_MODE="demo", KIOSK_PANEL=str(panel))) as mine:
        yield mine


@pytest.fixture(params=[(size, language) for size in SIZES for language in LANGUAGES], ids=str)
def screen(
    request: pytest.FixtureRequest, chromium: Browser, kiosk: Server
) -> Iterator[tuple[Page, tuple[int, int]]]:
    """A touched screen of each size in each language."""
    size, language = request.param
    viewport = ViewportSize(width=size[0], height=size[1])
    with chromium.new_context(
        viewport=viewport, locale=language, has_touch=True, base_url=kiosk.url
    ) as context:
        yield context.new_page(), size


def within(page: Page, size: tuple[int, int], *selectors: str) -> None:
    """All of these are on the screen, large enough for a finger, and cover nothing of each other."""
    boxes = []
    for selector in selectors:
        for part in page.locator(selector).all():
            place = part.bounding_box()
            assert place is not None, selector
            left, top = place["x"], place["y"]
            right, bottom = left + place["width"], top + place["height"]
            assert min(left, top) >= 0, selector
            assert right <= size[0] + 0.5, selector
            assert bottom <= size[1] + 0.5, selector
            assert min(place["width"], place["height"]) >= 40, selector
            boxes.append((left, top, right, bottom))
    for number, box in enumerate(boxes):
        for other in boxes[number + 1 :]:
            apart = box[2] <= other[0] + 0.5 or other[2] <= box[0] + 0.5
            assert apart or box[3] <= other[1] + 0.5 or other[3] <= box[1] + 0.5, (box, other)


def scrolls(page: Page) -> bool:
    script = "(tiles) => tiles.scrollHeight > tiles.clientHeight + 1"
    return bool(page.locator(".tiles").evaluate(script))


def type_name(page: Page, name: str) -> None:
    page.locator("#user").tap()
    expect(page.locator(".sheet.keyboard")).to_be_visible()
    for letter in name:
        page.locator(f'.keyboard [data-key="{letter}"]').tap()
    page.locator(".keyboard .set-entry").tap()
    expect(page.locator(".sheet.keyboard")).to_have_count(0)
    expect(page.locator("body[data-settling]")).to_have_count(0)


def test_other_user_types_the_name_and_the_pin(screen: tuple[Page, tuple[int, int]]) -> None:
    page, size = screen
    page.goto("/signin")
    expect(page.locator("body[data-touch-entry]")).to_be_attached()
    page.locator(".tile[href$='other=1']").tap()
    expect(page.locator("body[data-touch-entry]")).to_be_attached()
    within(page, size, "#user", ".pad button", ".sign-in-key", ".tile", ".badge-form")
    type_name(page, TYPED)
    for digit in "1470":
        page.locator(f".pad button[value='{digit}']").tap()
    page.locator(".sign-in-key").tap()
    expect(page.locator("a.user")).to_have_attribute("data-user", TYPED)


def test_pages_of_tiles_are_turned_with_large_buttons(screen: tuple[Page, tuple[int, int]]) -> None:
    page, size = screen
    page.goto("/signin")
    seen: list[str] = []
    for number in (1, 2, 3):
        expect(page.locator(".turn p")).to_contain_text(str(number))
        within(page, size, ".tiles .tile", ".turn .tile", ".badge-form")
        assert not scrolls(page)
        assert page.locator(".tiles").evaluate(CUT_TILES) == []
        seen += page.locator(".tiles .tile[href*='user='] b").all_inner_texts()
        more = page.locator(".turn .tile").last
        if number < 3:
            more.tap()
    expect(page.locator(".turn .tile").last).to_have_attribute("aria-disabled", "true")
    assert sorted(seen) == sorted([*NAMES, TYPED])
    page.locator(".tiles .tile[href*='user=M']").tap()
    expect(page.locator(".pad")).to_be_visible()
    expect(page.locator(".tile[aria-current] b")).to_have_text("M. User")
    page.locator(".turn .tile").first.tap()
    expect(page.locator(".turn p")).to_contain_text("2")


CUT_HEADS: Final = """() => [...document.querySelectorAll(".sign-in .head h2")]
  .filter((head) => head.scrollWidth > head.clientWidth + 1
    || getComputedStyle(head).overflow !== "visible"
    || head.getBoundingClientRect().bottom > head.parentElement.getBoundingClientRect().bottom + 1)
  .map((head) => head.textContent)"""


def test_titles_are_whole_also_beside_sign_out(
    screen: tuple[Page, tuple[int, int]],
) -> None:
    page, size = screen
    page.goto(f"/signin?user={TYPED}")
    expect(page.locator("body[data-touch-entry]")).to_be_attached()
    for digit in "1470":
        page.locator(f".pad button[value='{digit}']").tap()
    page.locator(".sign-in-key").tap()
    expect(page.locator("a.user")).to_have_attribute("data-user", TYPED)
    page.goto(f"/signin?user={quote(NAMES[-1])}")
    expect(page.locator(".sign-in .small-key")).to_be_visible()
    expect(page.locator("#secret")).to_contain_text(NAMES[-1])
    page.evaluate(DRAWN)
    assert page.evaluate(CUT_HEADS) == []
    within(page, size, ".small-key", ".pad button", ".sign-in-key", ".tiles .tile", ".turn .tile")
    assert page.evaluate("document.documentElement.scrollWidth") == size[0]


@pytest.fixture
def touched(chromium: Browser, kiosk: Server) -> Iterator[Page]:
    with chromium.new_context(has_touch=True, base_url=kiosk.url) as context:
        yield context.new_page()


def test_a_password_is_typed_after_the_name_and_a_wrong_one_says_so(touched: Page) -> None:
    page = touched
    page.goto("/signin?other=1")
    expect(page.locator("body[data-touch-entry]")).to_be_attached()
    type_name(page, TYPED)
    page.locator("form.secret > a").tap()
    expect(page.locator("#user")).to_have_value(TYPED)
    for entered, user in (("wrong", ""), ("long enough", TYPED)):
        page.locator("#password").tap()
        expect(page.locator(".sheet.keyboard")).to_be_visible()
        for letter in entered:
            page.locator(f'.keyboard [data-key="{letter}"]').tap()
        page.locator(".keyboard .set-entry").tap()
        expect(page.locator("body[data-settling]")).to_have_count(0)
        page.locator(".sign-in-key").tap()
        if not user:
            expect(page.locator("p.said")).to_contain_text("The user or the password is wrong.")
    expect(page.locator("a.user")).to_have_attribute("data-user", TYPED)


def test_without_scripts_the_pin_is_typed_and_no_page_has_it(chromium: Browser, kiosk: Server) -> None:
    with chromium.new_context(java_script_enabled=False, base_url=kiosk.url) as context:
        page = context.new_page()
        page.goto("/signin?other=1")
        page.locator("#user").fill(TYPED)
        said = page.locator(".secret noscript").text_content()
        assert "The number pad needs JavaScript." in str(said)
        page.locator("input[name=pin]").fill("147")
        page.locator(".sign-in-key").click()
        assert not says(page.content() + page.url, "147")
        expect(page.locator("p.said")).to_contain_text("The user or the PIN is wrong.")
        expect(page.locator("#user")).to_have_value(TYPED)
        page.locator("input[name=pin]").fill("1470")
        page.locator(".sign-in-key").click()
        expect(page.locator("a.user")).to_have_attribute("data-user", TYPED)


def test_an_unknown_name_gets_the_same_pages(chromium: Browser, kiosk: Server) -> None:
    with chromium.new_context(java_script_enabled=False, base_url=kiosk.url) as context:
        page = context.new_page()
        shown = []
        for name in (TYPED, "nobody"):
            page.goto(f"/signin?other=1&user={name}")
            entry = page.locator(".entry-of-secret").inner_html()
            shown.append(entry.replace(name, "NAME"))
        assert shown[0] == shown[1]
