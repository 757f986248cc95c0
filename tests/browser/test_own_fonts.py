"""A panel's own fonts come before the shipped ones, which stay where a file does not load."""

from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Page, Response

from app.panel import load_panel
from app.panel.widths.fonts import SHIPPED, Fonts, fonts_of, text_width
from tests.panel.test_fonts import PANEL, wide_font
from tests.support.parts import until
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("detail")

TEXT: Final = "Guard door agW 88"
WIDTHS: Final = """async (text) => {
  const family = getComputedStyle(document.body).fontFamily;
  for (const weight of [400, 700])
    await document.fonts.load(`${weight} 50px ${family}`, text).catch(() => 0);
  return [400, 700].map((weight) => {
    const element = document.createElement("span");
    element.style.cssText = "position: absolute; white-space: nowrap; font-size: 50px";
    element.style.fontWeight = weight;
    element.textContent = text;
    document.body.append(element);
    return [element.getBoundingClientRect().width, element.remove()][0];
  });
}"""


def shown(page: Page, folder: Path, bold: bytes) -> list[Response]:
    """The responses with fonts, when the page has its final ones."""
    (folder / "letters.ttf").write_bytes(wide_font(400))
    (folder / "bold.ttf").write_bytes(bold)
    responses: list[Response] = []
    page.on("response", lambda response: responses.append(response))
    with demo_server(folder, PANEL) as server:
        expected = own_or_shipped(folder / "cell.toml", bold)

        def is_so() -> bool:
            """A font that came late is used by the next visit."""
            page.goto(server.url)
            return bool(page.evaluate(WIDTHS, TEXT) == pytest.approx(expected, abs=1.5))

        until(is_so, f"texts are {expected} px wide", every_s=0.3)
    return [response for response in responses if "/fonts/" in response.url]


def own_or_shipped(path: Path, bold: bytes) -> list[float]:
    """The widths of the text, regular and bold, of what `check` measures."""
    own: Fonts = fonts_of(load_panel(path))
    return [text_width(TEXT, 50, own), text_width(TEXT, 50, own if bold[4:] else SHIPPED, bold=True)]


def test_pages_are_in_the_panels_font(own_page: Page, tmp_path: Path) -> None:
    fonts = shown(own_page, tmp_path, wide_font(700))
    first = next(response for response in fonts if response.url.endswith("/own-0-regular"))
    assert first.headers["content-type"] == "font/ttf"
    assert "immutable" in first.headers["cache-control"]


def test_the_shipped_font_stays_where_a_file_is_not_a_font(own_page: Page, tmp_path: Path) -> None:
    fonts = shown(own_page, tmp_path, b"\0\1\0\0")
    assert {response.status for response in fonts if response.url.endswith("/own-0-bold")} == {200}
