"""The header: brand, titles, date and language, at each size and in each language."""

import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from app.cell.view.clock_status import BANNERS
from app.system.texts.catalogue import sentences
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, settled
from tests.support.parts import ROOT, SHIPPED, Server, until
from tests.support.servers import ready

pytestmark = pytest.mark.long("every screen")

PALLETIZER: Final = ROOT / "docs/examples/palletizer.toml"
SIZES: Final = ((1920, 1080), (1280, 800), (1024, 600), (800, 480))
LOGO: Final = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 4"><path d="M0 0h9v4z"/></svg>'
BRAND: Final = """
[brand]
logo = "acme.svg"
text = "ACME"
colour = "#0b6b57"
"""
SAYS: Final = "(banner, text) => { banner.textContent = text; }"
IS_WHOLE: Final = "(title) => title.scrollWidth <= title.clientWidth"
LINE_PX: Final = 14  # the height of a line of who has control
CONTROL: Final = """
[control]
required = true
"""
# Parts of the header that are beyond it or over one another.
CROWDED: Final = """() => {
  const all = document.querySelectorAll("header > :not(.control), .control > *");
  const isSeen = (part) => part.checkVisibility() && getComputedStyle(part).clipPath === "none";
  const parts = [...all].filter(isSeen);
  const boxes = parts.map((part) => [part.className || part.tagName, part.getBoundingClientRect()]);
  return boxes.flatMap(([name, { left, right }], number) => {
    const before = number ? boxes[number - 1][1].right : 0;
    return left < before - 1 || right > innerWidth ? [`${name}: ${left} to ${right}`] : [];
  });
}"""


@pytest.fixture(scope="module")
def branded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("branded")
    (folder / "pictures").mkdir()
    (folder / "pictures/acme.svg").write_text(LOGO)
    panel = SHIPPED.read_text().replace("distro", 'pictures = "pictures"\ndistro', 1) + BRAND
    with ready(Server(ROOT, KIOSK_PANEL=str(written(folder, panel)))) as mine:
        yield mine


@pytest.fixture(scope="module")
def controlled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    panel = PALLETIZER.read_text() + CONTROL
    path = written(tmp_path_factory.mktemp("controlled"), panel)
    with ready(Server(ROOT, KIOSK_PANEL=str(path))) as mine:
        yield mine


@pytest.fixture(scope="module")
def plain() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(PALLETIZER))) as mine:
        yield mine


@pytest.fixture
def story(tmp_path: Path) -> Iterator[Server]:
    """All that a header may have: brand, state with details, who has control. No browser has it yet."""
    folder = tmp_path
    (folder / "pictures").mkdir()
    (folder / "pictures/acme.svg").write_text(LOGO)
    panel = SHIPPED.read_text().replace("distro", 'pictures = "pictures"\ndistro', 1) + BRAND + CONTROL
    with ready(Server(ROOT, KIOSK_PANEL=str(written(folder, panel)))) as mine:
        yield mine


def written(folder: Path, panel: str) -> Path:
    path = folder / "panel.toml"
    path.write_text(panel)
    return path


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_parts_of_the_header_have_room(
    branded: Server, controlled: Server, page: Page, language: str
) -> None:
    for server in (branded, controlled):
        page.context.add_cookies([{"name": "kiosk_language", "value": language, "url": server.url}])
        page.goto(server.url)
        expect(page.locator("html[data-floor]")).to_be_attached()
        for width, height in SIZES:
            sized(page, width, height).evaluate(DRAWN)
            assert settled(page, CROWDED) == [], (server is branded, width)
            expect(page.locator("#clock")).to_be_visible()
            expect(page.locator("#day")).to_be_visible(visible=width >= 900)


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_no_banner_of_a_simulated_robot_cuts_the_title(
    plain: Server, page: Page, language: str
) -> None:
    page.context.add_cookies([{"name": "kiosk_language", "value": language, "url": plain.url}])
    page.goto(plain.url)
    expect(page.locator("html[data-floor]")).to_be_attached()
    for width, height in SIZES:
        for code in BANNERS.values():
            page.locator("#banner").evaluate(SAYS, sentences(language)[code])
            sized(page, width, height).evaluate(DRAWN)
            assert settled(page, CROWDED) == [], (code, width)
            assert page.locator("h1 span").evaluate(IS_WHOLE), (code, width)


def test_a_header_without_a_robot_has_room_for_the_menu(chromium: Browser) -> None:
    with Server(ROOT, KIOSK_PANEL=str(SHIPPED), KIOSK_MODE="live") as server:
        until(server.answers, "it serves")
        for language in ("en", "ja", "de"):
            with closing(chromium.new_context(locale=language)) as context:
                page = context.new_page()
                page.goto(server.url)
                expect(page.locator(".robot-state[data-state=lost]")).to_be_visible()
                for width, height in SIZES:
                    sized(page, width, height).evaluate(DRAWN)
                    assert settled(page, CROWDED) == [], (language, width)
                    expect(page.locator(".menu-key")).to_be_in_viewport(ratio=1)


def test_who_has_control_is_said_in_words_of_their_own_width(controlled: Server, page: Page) -> None:
    page.context.add_cookies([{"name": "kiosk_language", "value": "de", "url": controlled.url}])
    page.goto(controlled.url)
    sized(page, 800, 480).evaluate(DRAWN)
    who = page.locator(".control > div").bounding_box()
    assert who is not None
    assert who["width"] > 100


@pytest.mark.long("detail")
@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_who_has_control_is_beside_the_state_and_not_cut(
    story: Server, chromium: Browser, language: str
) -> None:
    """The first browser has control, the second may take it. A robot that is not simulated leaves room
    for the whole sentence."""
    with closing(chromium.new_context()) as first, closing(chromium.new_context()) as second:
        for context, role in ((first, "holding"), (second, "over")):
            context.add_cookies([{"name": "kiosk_language", "value": language, "url": story.url}])
            page = context.new_page()
            page.goto(story.url)
            expect(page.locator(f".control[data-role={role}]")).to_be_visible()
            for width, height in SIZES:
                sized(page, width, height).evaluate(DRAWN)
                assert settled(page, CROWDED) == [], (role, width)
                expect(page.locator(".menu-key")).to_be_in_viewport(ratio=1)
            page.locator("#banner").evaluate("(banner) => (banner.hidden = true)")
            who = page.locator(".who")
            cut = who.evaluate("(who) => who.scrollHeight - who.clientHeight")
            assert role == "holding" or cut < LINE_PX / 2, who.inner_text()


def test_the_brands_colour_is_in_its_corner_only(branded: Server, page: Page) -> None:
    page.goto(branded.url)
    corner = page.locator(".brand")
    expect(corner).to_have_css("background-color", "rgb(11, 107, 87)")
    assert corner.locator("img").evaluate("(logo) => logo.complete && logo.naturalWidth > 0")
    rail = page.locator("nav.pages").bounding_box()
    box = corner.bounding_box()
    assert rail is not None
    assert box is not None
    assert abs(box["width"] - rail["width"]) < 2
    expect(page.locator("#day")).to_have_text(re.compile(r"\w{3} \d+ \w{3}"))
    expect(page.locator(".machine-state .details")).to_contain_text("Automatic")
    page.locator(".language").click()
    page.locator("#menu").get_by_role("button", name="Deutsch").click()
    expect(page.locator(".language")).to_have_text("Deutsch")
    expect(page.locator(".machine-state .details")).to_contain_text("Automatik")


# The menu's copy after a text of the header has changed, before the next second changes it again.
RENEWED: Final = """async (text) => {
  text.firstChild.data = "renewed " + text.className;
  await new Promise(queueMicrotask);
  return document.querySelector("#menu .of-header").textContent;
}"""


@pytest.mark.long("detail")
@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_the_menu_has_what_the_header_has_no_room_for(
    branded: Server, page: Page, language: str
) -> None:
    page.context.add_cookies([{"name": "kiosk_language", "value": language, "url": branded.url}])
    page.goto(branded.url)
    sized(page, 800, 480).evaluate(DRAWN)
    facts = page.locator("#menu .of-header")
    expect(facts).not_to_be_visible()
    page.locator(".menu-key").click()
    expect(facts).to_be_visible()
    expect(facts).to_contain_text("4711")  # the order
    expect(facts).to_contain_text(page.locator("#day").inner_text())
    mode = page.locator('.machine-state [data-text="detail0"]')
    expect(facts).to_contain_text(mode.text_content() or "none")
    for name in ("#clock", '.machine-state [data-text="detail0"]'):
        assert "renewed" in page.locator(name).evaluate(RENEWED)  # it follows the header
    sized(page, 1280, 800).evaluate(DRAWN)
    expect(facts).not_to_be_visible()


def test_a_phone_has_a_heading(branded: Server, page: Page) -> None:
    page.goto(branded.url)
    sized(page, 390, 844).evaluate(DRAWN)
    expect(page.get_by_role("heading", level=1)).to_have_text("Robot cell 1")
    assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_help_says_what_the_signs_mean_in_each_theme_and_language(branded: Server, page: Page) -> None:
    page.goto(branded.url)
    expect(page.locator("html[data-floor]")).to_be_attached()
    page.locator(".menu-key").click()
    page.locator("#menu").get_by_role("link", name="Help").click()
    expect(page.locator(".signs li")).to_have_count(16)
    expect(page.locator("main > .version").first).to_contain_text("operator-panel")
    expect(page.locator("[data-widget=stop] > button:not(.more)")).to_be_enabled()
    page.locator(".menu-key").click()
    page.locator("#menu").get_by_role("button", name="日本語").click()
    expect(page.locator(".signs h2").first).to_have_text("ボタン")
    assert page.url.endswith("/help")
