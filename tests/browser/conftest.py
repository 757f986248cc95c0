"""Fixtures of touched screens."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.support.finger import Finger
from tests.support.parts import Server
from tests.support.touch import permit, touched, touched_server


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A kiosk with every input; a module with another panel has a kiosk of its own."""
    with touched_server(tmp_path_factory.mktemp("panel")) as mine:
        yield mine


@pytest.fixture
def screen(chromium: Browser, kiosk: Server) -> Iterator[Page]:
    """A page of it on a touched screen, whose interlock permits."""
    permit(kiosk)
    with touched(chromium, kiosk) as page:
        yield page


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
