"""Chromium in tests: started once for many modules, and pages that tests use one after the other.

A page in a new browser context takes 0.5 CPU seconds to load: most of it is the start of its renderer
process. A page that is loaded again takes 0.2.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final
from urllib.parse import urljoin

import pytest
from playwright._impl._api_structures import SetCookieParam
from playwright.sync_api import (
    Browser,
    BrowserContext,
    Error,
    Page,
    Playwright,
    sync_playwright,
)

from app.web.pages.display_choice import FONTS
from tests.support.browser.fonts import WITHOUT_OWN, fonts_file
from tests.support.parts import CHROMIUM_FLAGS, ENOUGH_S, HEADLESS

SIZE: Final = (1280, 800)
EMPTY: Final = "/healthz"  # a page without scripts, events and style sheets
EMPTY_WITHIN_S: Final = 2.0
# A browser that has the shipped fonts: pages come with them.
HAS_FONTS: Final = SetCookieParam(name=FONTS[0], value=FONTS[1], domain="127.0.0.1", path="/")


class Browsers:
    """A Chromium for each set of fonts. While one runs, Playwright's event loop runs in this thread."""

    def __init__(self) -> None:
        self._playwright: Playwright | None = None
        self._running: dict[str, Browser] = {}

    def browser(self, fonts: str, folders: pytest.TempPathFactory) -> Browser:
        if fonts not in self._running:
            without_own = ["--disable-remote-fonts"] if fonts.endswith(WITHOUT_OWN) else []
            file = fonts_file(fonts, folders.mktemp("fonts"))
            self._running[fonts] = self._started(file, without_own)
        return self._running[fonts]

    def _started(self, fonts: Path, more: list[str]) -> Browser:
        if self._playwright is None:
            self._playwright = sync_playwright().start()
        env: dict[str, str | float | bool] = {**os.environ, "FONTCONFIG_FILE": str(fonts)}
        return self._playwright.chromium.launch(
            executable_path=HEADLESS, args=[*CHROMIUM_FLAGS, *more], env=env
        )

    def close(self) -> None:
        for browser in self._running.values():
            browser.close()
        self._running.clear()
        if self._playwright is not None:
            self._playwright.stop()
            self._playwright = None


def sized(page: Page, width: int, height: int) -> Page:
    """The page in a window of this size."""
    if page.viewport_size != {"width": width, "height": height}:
        page.set_viewport_size({"width": width, "height": height})
    return page


class ReusedPage:
    """A page that tests use one after the other. It is reset before each test: a window of 1280x800,
    no cookies but that of the fonts, no storage, no routes, no other page in its context. Changes that
    cannot be reset, such as an init script, need a separate page."""

    def __init__(self, browser: Browser, script: str = "", **options: Any) -> None:
        """`script` runs in each page before its own, `options` are those of the browser context."""
        self._browser = browser
        self._script = script
        self._options = options
        self._free: list[Page] = []
        self._errors: list[str] = []

    @contextmanager
    def taken(self, test: pytest.Item) -> Iterator[Page]:
        """The page for a test, the last one if it fails; an error on the page's console fails it."""
        page = self._free.pop() if self._free else self._opened()
        yield page
        errors, self._errors[:] = list(self._errors), []
        if test.stash.get(FAILED, False) or errors:
            page.context.close()
        elif emptied(page):
            self._free.append(page)
        assert errors == []

    def _opened(self) -> Page:
        context = opened(self._browser, **self._options)
        if self._script:
            context.add_init_script(self._script)
        page = context.new_page()
        page.on("pageerror", lambda error: self._errors.append(str(error)))
        return page

    def close(self) -> None:
        for page in self._free:
            page.context.close()


def opened(browser: Browser, **options: Any) -> BrowserContext:
    """A browser context with this project's timeouts, in a window of 1280x800, which has the shipped
    fonts."""
    width, height = SIZE
    context = browser.new_context(**{"viewport": {"width": width, "height": height}, **options})
    context.set_default_timeout(1000 * ENOUGH_S)
    context.add_cookies([HAS_FONTS])
    return context


def emptied(page: Page) -> bool:
    """Resets the page, except for the memory of its process. Closes it if that fails, as when a server
    has ended."""
    context = page.context
    with suppress(Error):
        for other in context.pages:
            if other is not page:
                other.close()
        page.unroute_all()
        page.goto(urljoin(page.url, EMPTY), timeout=1000 * EMPTY_WITHIN_S)
        page.evaluate("sessionStorage.clear()")
        page.mouse.move(0, 0)
        context.clear_cookies()
        context.add_cookies([HAS_FONTS])
        sized(page, *SIZE)
        return True
    context.close()
    return False


FAILED: Final = pytest.StashKey[bool]()
BROWSERS: Final = Browsers()
