"""Fixtures of touched screens."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.support.finger import Finger
from tests.support.parts import Server


@pytest.fixture
def touch_page(chromium: Browser) -> Iterator[Page]:
    """A page on a touched screen, in a browser context of its own."""
    with chromium.new_context(viewport={"width": 1280, "height": 800}, has_touch=True) as context:
        context.set_default_timeout(10_000)
        yield context.new_page()


@pytest.fixture
def finger(touch_page: Page, kiosk: Server) -> Finger:
    """A finger on the page of a kiosk that can be jogged."""
    return Finger(touch_page, kiosk)
