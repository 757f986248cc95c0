"""The reason of a stop is given by a finger: the question on the line, the keys, the figures at each
size."""

from collections.abc import Iterator
from contextlib import closing

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_line import SIZES, started
from tests.support.browser.pages import DRAWN
from tests.support.parts import Server
from tests.support.servers import demo_server
from tests.web.test_oee import PANEL


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        yield server


@pytest.mark.parametrize("size", SIZES)
def test_a_finger_answers_and_the_figures_say_so(
    cell: Server, chromium: Browser, size: tuple[int, int]
) -> None:
    width, height = size
    opened = chromium.new_context(
        viewport={"width": width, "height": height}, has_touch=True, bypass_csp=True
    )
    with closing(opened) as context:
        answer_by_finger(cell, context.new_page(), width)


def answer_by_finger(cell: Server, page: Page, width: int) -> None:
    started(page, cell.url)
    reason = page.locator(".asked-key")
    expect(reason).to_be_visible(timeout=20_000)
    expect(page.locator(".asked b")).to_contain_text("Stood still for")
    assert page.locator(".alarm-line button[type=submit]").is_hidden()
    reason.tap()
    key = page.locator(".reasons button", has_text="Material")
    expect(key).to_be_in_viewport()
    page.evaluate(DRAWN)
    box = key.bounding_box()
    assert box is not None
    assert box["height"] >= 44
    assert violations(page) == []
    key.tap()
    expect(page.locator(".reasons [aria-pressed=true]")).to_contain_text("Material")
    expect(page.locator(".reasons .given")).to_contain_text("Material, by")
    started(page, f"{cell.url}/oee")
    expect(page.locator(".pareto")).to_contain_text("Material")
    page.evaluate(DRAWN)
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert violations(page) == []
    for link in page.locator(".oee-stops a").all():
        place = link.bounding_box()
        assert place is not None
        assert place["height"] >= 44
