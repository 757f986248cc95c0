"""The panel's own fonts: the same letters on every kiosk, whatever is installed there."""

from collections.abc import Iterator
from functools import partial
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, CDPSession, Error, Page

from app.web.pages.display_choice import FONTS
from deploy.font_characters import characters
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready

pytestmark = pytest.mark.long("detail")

LATIN: Final = "Start Öffnen Schließen für 0123456789 −71 °C µm ±½ × ÷ – … „Halt“ ‘x’ •"


@pytest.fixture(scope="module")
def shipped() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL="app/panel.toml", KIOSK_MODE="demo")) as mine:
        yield mine


def fonts_of(session: CDPSession, selector: str) -> list[dict[str, Any]]:
    """The fonts that draw the text of the first such element; none while the page changes."""
    try:
        root = session.send("DOM.getDocument")["root"]["nodeId"]
        node = session.send("DOM.querySelector", {"nodeId": root, "selector": selector})["nodeId"]
        fonts: list[dict[str, Any]] = session.send("CSS.getPlatformFontsForNode", {"nodeId": node})[
            "fonts"
        ]
    except Error:
        return []
    return fonts


def session_of(page: Page) -> CDPSession:
    session = page.context.new_cdp_session(page)
    session.send("DOM.enable")
    session.send("CSS.enable")
    return session


@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_texts_are_drawn_with_the_panels_own_fonts(
    shipped: Server, chromium: Browser, language: str
) -> None:
    context = chromium.new_context(locale=language)
    selectors = ("h1 > span", ".group h2", "[data-widget=start] .label")

    def are_own() -> bool:
        page = context.new_page()  # a font that comes late is not shown before the next visit
        page.goto(shipped.url)
        session = session_of(page)
        drawn = [until(partial(fonts_of, session, each), "it is drawn") for each in selectors]
        page.close()
        return all(font["isCustomFont"] for fonts in drawn for font in fonts)

    until(are_own, "texts have them", every_s=0.3)
    context.close()


@pytest.mark.parametrize(
    ("text", "language"), [(characters(), "ja"), (LATIN, "en")], ids=["japanese", "latin"]
)
@pytest.mark.parametrize("weight", [400, 700])
def test_the_fonts_have_each_character_of_the_catalogue_and_of_the_shipped_panels(
    shipped: Server, chromium: Browser, text: str, language: str, weight: int
) -> None:
    page = chromium.new_page(locale=language)
    show = """async ([text, weight]) => {
      const element = document.createElement("p");
      element.id = "sample";
      element.style.fontWeight = weight;
      element.textContent = text;
      document.querySelector("header").before(element);
      const family = getComputedStyle(document.body).fontFamily;
      await document.fonts.load(`${weight} 17px ${family}`, text);
    }"""
    session = session_of(page)

    def is_own() -> bool:
        page.goto(shipped.url)  # a font that came late is used by the next visit
        page.evaluate(show, [text, str(weight)])
        fonts = fonts_of(session, "#sample")
        return bool(fonts) and all(font["isCustomFont"] for font in fonts)

    until(is_own, "no other font is needed", every_s=0.5)
    page.close()


def test_without_them_a_page_is_shown_with_the_systems_fonts(
    shipped: Server, chromium: Browser
) -> None:
    page = chromium.new_page()
    page.route("**/fonts/**", lambda route: route.abort())
    page.goto(shipped.url)
    session = session_of(page)
    fonts = until(lambda: fonts_of(session, "h1 > span"), "it is drawn")
    assert not any(font["isCustomFont"] for font in fonts)
    page.close()


def test_a_browser_gets_them_once(shipped: Server) -> None:
    """Those of its language, with each page from the second on."""
    japanese = {"accept-language": "ja"}
    assert 'rel="preload"' not in shipped.http.get("/", headers=japanese).text
    html = shipped.http.get("/", headers={**japanese, "cookie": "=".join(FONTS)}).text
    assert html.count('rel="preload"') == 4
    path = html.split('rel="preload" href="')[1].split('"')[0]
    answer = shipped.http.get(path)
    assert answer.headers["content-type"] == "font/woff2"
    assert "immutable" in answer.headers["cache-control"]
    assert len(answer.content) < 100_000
