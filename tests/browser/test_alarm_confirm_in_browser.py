"""An act on an alarm that a person confirms, on a touched screen: the pad, with Stop in view."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, ViewportSize, expect

from tests.browser.test_alarm_line import started
from tests.support.confirmed import ALARMS, PANEL, add_users
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("detail")

SIZES = ((1280, 800), (800, 480))


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_users(data)
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL + ALARMS, KIOSK_DATA=str(data)) as mine:
        until(lambda: len(mine.http.get("/alarms").json()["alarms"]) == 3, "the alarms are raised")
        yield mine


@pytest.fixture(params=[(size, language) for size in SIZES for language in ("en", "de", "ja")], ids=str)
def screen(
    request: pytest.FixtureRequest, chromium: Browser, kiosk: Server
) -> Iterator[tuple[Page, tuple[int, int]]]:
    size, language = request.param
    viewport = ViewportSize(width=size[0], height=size[1])
    with chromium.new_context(
        viewport=viewport, locale=language, has_touch=True, base_url=kiosk.url
    ) as context:
        page = context.new_page()
        page.goto("/")
        page.request.post("/session", data={"user": "K. Novak", "pin": "1470"})
        yield page, size


def sheet_opens(page: Page, kiosk: Server) -> bool:
    """Whether a touch opens the sheet of the row; before the first event a form opens it."""
    started(page, f"{kiosk.url}/alarms")
    page.locator("li.alarm[data-alarm='hot'] button.more-acts").tap()
    return page.locator("#alarm-sheet:popover-open").count() == 1


def test_the_row_asks_for_the_pin_on_a_page_with_stop(
    screen: tuple[Page, tuple[int, int]], kiosk: Server
) -> None:
    page, size = screen
    until(lambda: sheet_opens(page, kiosk), "the sheet opens by its script")
    page.locator("#alarm-sheet button[data-act-of-row='shelve']").tap()
    page.wait_for_url("**/alarms/hot/shelve/confirm?**")
    stop = page.locator("[data-widget='halt'] button").first
    for part in (*page.locator(".pad button, button.yes, a.no").all(), stop):
        box = part.bounding_box()
        assert box is not None
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= size[0]
        assert box["y"] + box["height"] <= size[1]
        assert min(box["width"], box["height"]) >= 40
    expect(stop).to_be_enabled()
    for digit in "1471":
        page.locator(f".pad button[value='{digit}']").tap()
    page.locator("button.yes").tap()
    expect(page.locator("p.said")).not_to_be_empty()
    for digit in "1470":
        page.locator(f".pad button[value='{digit}']").tap()
    page.locator("button.yes").tap()
    page.wait_for_url("**/alarms?act=**")
    expect(page.locator("li.alarm[data-alarm='hot'][data-state='shelved']")).to_be_attached()
    back = page.request.post("/alarms/hot/unshelve", data={})
    assert back.json()["done"] is True
