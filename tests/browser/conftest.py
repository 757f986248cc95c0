"""Fixtures of touched screens, of pages for axe, and the shipped panel."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page

from tests.support.browser.browsers import ReusedPage
from tests.support.browser.finger import Finger
from tests.support.browser.touch import permit, touched, touched_server
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import ready


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A kiosk with every input; a module with another panel has a kiosk of its own."""
    with touched_server(tmp_path_factory.mktemp("panel")) as mine:
        yield mine


@pytest.fixture(scope="module")
def reused_screen(chromium: Browser) -> Iterator[ReusedPage]:
    mine = ReusedPage(chromium, has_touch=True)
    yield mine
    mine.close()


@pytest.fixture
def touchscreen(reused_screen: ReusedPage, request: pytest.FixtureRequest) -> Iterator[Page]:
    """A page on a screen that is touched, like a new one, which the tests of a module share."""
    with reused_screen.taken(request.node) as page:
        yield page


@pytest.fixture
def screen(kiosk: Server, touchscreen: Page) -> Page:
    """A page of the kiosk on a touched screen, whose interlock permits."""
    permit(kiosk)
    return touched(touchscreen, kiosk)


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


@pytest.fixture
def axe_page(chromium: Browser, request: pytest.FixtureRequest) -> Iterator[Page]:
    """A page to which axe may be added."""
    mine = ReusedPage(chromium, bypass_csp=True)
    with mine.taken(request.node) as page:
        yield page
    mine.close()


@pytest.fixture(scope="module")
def shipped() -> Iterator[Server]:
    """The shipped panel."""
    with ready(Server(ROOT, KIOSK_PANEL=str(SHIPPED), KIOSK_MODE="demo")) as mine:
        yield mine
