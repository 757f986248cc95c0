"""`make screenshots`: the examples, the shipped panel and the gallery at all sizes, in all themes and
languages, into build/screenshots; the pictures of README and documentation into docs/images. All of the
demo robot. `--editor`: only those of the editor."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory
from typing import Final

from PIL import Image
from playwright.sync_api import Browser, Page, ViewportSize, expect, sync_playwright

from app.panel import load_panel
from app.web.pages.display_choice import CHOICES, COOKIE
from tests.support.editor import EditorServer, box_of, middle, preview
from tests.support.parts import CHROMIUM_FLAGS, HEADLESS, ROOT, SHIPPED, Server, until

EXAMPLE: Final = ROOT / "docs/examples/palletizer.toml"
PANELS: Final = {
    "example": EXAMPLE,
    "shipped": SHIPPED,
    "plan": ROOT / "docs/examples/plan/panel.toml",
    "lab-gripper": ROOT / "docs/examples/lab-gripper/panel.toml",
    "mobile-robot": ROOT / "docs/examples/mobile-robot/panel.toml",
    "welding-cell": ROOT / "docs/examples/welding-cell/panel.toml",
}
PICTURED: Final = ("lab-gripper", "mobile-robot", "welding-cell")  # of the guide to panel files
# What is pressed before the picture of an example, and for how long it goes on then.
PRESSED: Final = {"mobile-robot": ("[data-place=wrapper]", "[data-widget=send] button[type=submit]")}
PRESSED_S: Final = 6.0
SIZES: Final = ((1920, 1080), (1280, 800), (1024, 600), (800, 480), (800, 1280), (390, 844))
ALL: Final = ROOT / "build/screenshots"
IMAGES: Final = ROOT / "docs/images"
CYCLE_MS: Final = 60_000  # a state of the demo robot comes within this time
CURVE_S: Final = 70.0  # of the curve of an alarm
LOADED_MS: Final = 200  # scripts and values are there
RECEIPTS_S: Final = 12.0  # the cell has placed a box
COLOURS: Final = 96
EDITOR_SIZE: Final[ViewportSize] = {"width": 1440, "height": 900}
DRAWN_S: Final = 4.0  # the editor has its preview's sessions again after an edit
SETTLED_S: Final = 0.8  # a press is acknowledged and its highlight gone


def main() -> None:
    ALL.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=HEADLESS, args=CHROMIUM_FLAGS)
        take_for_editor(browser)
        if "--editor" in sys.argv:
            browser.close()
            return
        for name, panel in PANELS.items():
            with running(panel) as server:
                loaded = load_panel(panel)
                paths = {page.id: f"/pages/{page.id}" for page in loaded.pages}
                looks = [("theme", theme) for theme in CHOICES["theme"]]
                others = [
                    language for language in loaded.readers_languages if language != loaded.language
                ]
                looks += [("language", language) for language in others]
                if name in PICTURED:
                    take_for_guide(browser, f"{server.url}/pages/{loaded.pages[0].id}", name)
                take_all(browser, server.url, name, paths, looks)
                if panel == EXAMPLE:
                    take_all(browser, server.url, "gallery", {"": "/gallery"}, looks)
                if panel == SHIPPED:
                    take_for_readme(browser, server.url)
        browser.close()


@contextmanager
def running(panel: Path) -> Iterator[Server]:
    """A demo of a panel, with the gallery."""
    server = Server(ROOT, KIOSK_PANEL=str(panel), KIOSK_MODE="demo", KIOSK_DEV="1")
    try:
        until(server.ready, "ready")
        yield server
    finally:
        server.end()


def take_all(
    browser: Browser, url: str, name: str, paths: dict[str, str], looks: list[tuple[str, str]]
) -> None:
    """Every page at every size in every theme and language: example-cell-dark-1280x800.png."""
    for choice, look in looks:
        context = browser.new_context()
        context.add_cookies([{"name": COOKIE.format(choice), "value": look, "url": url}])
        page = context.new_page()
        for width, height in SIZES:
            page.set_viewport_size({"width": width, "height": height})
            for part, path in paths.items():
                page.goto(url + path)
                page.wait_for_timeout(LOADED_MS)
                file = f"{'-'.join(filter(None, (name, part)))}-{look}-{width}x{height}"
                page.screenshot(path=ALL / f"{file}.png", full_page=name == "gallery" or width < 600)
                take_tabs(page, file)
        context.close()


def take_tabs(page: Page, file: str) -> None:
    """The groups that take turns."""
    for number, tab in enumerate(page.locator(".group-tab:visible").all()):
        tab.click()
        page.screenshot(path=ALL / f"{file}-tab{number}.png")


def take_for_guide(browser: Browser, url: str, name: str) -> None:
    """The first page of an example."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(url)
    page.wait_for_timeout(1000 * SETTLED_S)
    for selector in PRESSED.get(name, ()):
        page.locator(selector).first.click()
        page.wait_for_timeout(1000 * SETTLED_S)
    if name in PRESSED:
        page.wait_for_timeout(1000 * PRESSED_S)
    picture(page, f"{name}.png")
    page.close()


def take_for_readme(browser: Browser, url: str) -> None:
    """The shipped panel's first page, running and with its guard door open."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    for _ in range(2):  # a font that came late is used by the next visit
        page.goto(url)
        page.wait_for_timeout(LOADED_MS)

    def state(word: str) -> None:
        expect(page.locator(".machine-state")).to_contain_text(word, timeout=CYCLE_MS)
        time.sleep(SETTLED_S)

    start = page.locator("[data-widget=start] > button:not(.more)")
    if start.is_enabled():
        start.click()
    state("RUNNING")
    time.sleep(RECEIPTS_S)
    picture(page, "production.png")
    page.locator("[data-widget=door] [data-position=off]").click()
    state("FAULT")
    expect(page.locator("[data-widget=steps]")).to_have_attribute("data-mode", "recovery")
    picture(page, "locked.png")
    page.close()


def take_for_editor(browser: Browser) -> None:
    """The editor with a changed label, with what a topic can be shown as, with an alarm's curve, and
    with a line that another program has changed too."""
    with TemporaryDirectory() as folder:
        file = Path(copy(EXAMPLE, Path(folder) / "cell1.toml"))
        editor = EditorServer(file)
        page = browser.new_page(viewport=EDITOR_SIZE)
        try:
            page.goto(editor.address)
            page.locator("#tab-robot").click()
            expect(page.locator('[data-item*="/vacuum"]').first).to_be_visible(timeout=CYCLE_MS)
            preview(page).locator("[data-widget=boxes]").wait_for()
            page.mouse.click(*middle(box_of(page, "[data-widget=boxes]")))
            label = page.get_by_role("textbox", name="Label").first
            label.fill("Count")
            label.press("Enter")
            expect(page.locator("#diff")).to_contain_text("Count")
            page.mouse.move(0, 0)
            page.wait_for_timeout(1000 * DRAWN_S)
            picture(page, "editor.png")

            page.locator('[data-item*="/air_pressure"]').first.click()
            expect(page.locator("#ask")).to_be_visible()
            page.wait_for_timeout(1000 * SETTLED_S)
            picture(page, "editor-pick.png")
            page.locator(".ways button", has_text="Alarm").click()
            expect(page.locator("#curve .limit-flag")).to_be_visible()
            page.wait_for_timeout(1000 * CURVE_S)
            picture(page, "editor-curve.png")

            file.write_text(file.read_text().replace('en = "Boxes"', 'en = "Cartons"', 1))
            expect(page.locator("#conflict")).to_be_visible(timeout=CYCLE_MS)
            page.locator("#conflict").click()
            expect(page.locator("#merge")).to_be_visible()
            page.wait_for_timeout(1000 * SETTLED_S)
            picture(page, "editor-merge.png")
        finally:
            page.close()
            editor.end()


def picture(page: Page, name: str) -> None:
    """A small file: a page has few colours."""
    taken = Image.open(BytesIO(page.screenshot())).convert("RGB")
    taken.quantize(COLOURS).save(IMAGES / name, optimize=True)


if __name__ == "__main__":
    main()
