"""The page of a wall in the browser: 48 cells on a large screen, and on a phone."""

import re
from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_accessibility import violations
from tests.support.cells import Cells, alarm
from tests.support.parts import Server, until
from tests.support.rmw import Router, SessionRouter
from tests.web.test_wall import tiles, wall_server

TILE: Final = ".wall-tiles > a"
LINES: Final = ("Line 1", "Line 2", "Line 3")
KINDS: Final = {"1-02": "fault", "1-07": "waiting", "2-04": "manual", "3-03": "waiting"}


@pytest.fixture(scope="module")
def router() -> Iterator[Router]:
    mine = SessionRouter()
    mine.start()
    yield mine
    mine.end()


@pytest.fixture(scope="module")
def cells(router: Router) -> Iterator[Cells]:
    mine = Cells(router.endpoint)
    for line in (1, 2, 3):
        for number in range(1, 17):
            name = f"{line}-{number:02}"
            alarms = [alarm(1, "Guard door 1 opened in motion")] if name == "1-02" else []
            mine.put(f"Line {line}", name, KINDS.get(name, "running"), alarm_list=alarms)
    yield mine
    mine.close()


@pytest.fixture(scope="module")
def wall(router: Router, cells: Cells, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with wall_server(tmp_path_factory.mktemp("wall"), router) as mine:
        heard = {"fault", "running", "waiting", "manual"}
        until(lambda: {kind for kind, _ in tiles(mine.http.get("/").text).values()} == heard, "all")
        yield mine


def test_48_cells_are_seen_at_once_and_change_in_place(page: Page, wall: Server, cells: Cells) -> None:
    page.set_viewport_size({"width": 1920, "height": 1080})
    page.goto(wall.url)
    shown = page.locator(TILE)
    expect(shown).to_have_count(48)
    bottom = page.evaluate(
        "() => [...document.querySelectorAll('.wall-tiles > a')].at(-1).getBoundingClientRect().bottom"
    )
    assert bottom <= 1080
    assert page.locator("#wall_state").inner_text().split() == ["1", "of", "48", "in", "fault"]
    expect(page.locator(".no-stop")).to_contain_text("Stop is at each cell")
    assert page.locator("main button:not([type=submit]), [data-role=stop]").count() == 0

    fifth = page.locator(TILE, has_text="1-05")
    expect(fifth).not_to_have_attribute("data-is", re.compile("."))
    page.evaluate("() => (window.kept = [...document.querySelectorAll('.wall-tiles > a')][4])")
    cells.put("Line 1", "1-05", "fault")
    expect(fifth).to_have_attribute("data-is", "fault")
    expect(page.locator("#wall_state")).to_contain_text("2 of 48")
    assert page.evaluate("() => window.kept.isConnected && window.kept.dataset.is") == "fault"
    cells.put("Line 1", "1-05")
    expect(fifth).not_to_have_attribute("data-is", re.compile("."))
    expect(fifth.locator("i")).to_have_text(re.compile(r"^\d+ s$"))


def test_a_cell_that_comes_and_goes_is_drawn_without_a_reload(
    page: Page, wall: Server, cells: Cells
) -> None:
    page.set_viewport_size({"width": 1920, "height": 1300})
    page.goto(wall.url)
    page.evaluate("() => (window.same = true)")
    cells.put("Line 4", "4-01", "waiting")
    new = page.locator(TILE, has_text="4-01")
    expect(new).to_have_attribute("data-is", "waiting")
    cells.withdraw("Line 4", "4-01")
    expect(new).to_have_attribute("data-is", "lost")
    expect(new).to_have_attribute("title", re.compile("No contact since"))
    assert page.evaluate("() => window.same")


def test_only_what_is_in_view_is_asked_for(page: Page, wall: Server) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    with page.expect_request("**/wall/events**") as first:
        page.goto(wall.url)
    expect(page.locator(TILE, has_text="1-01").locator("i")).to_have_text(re.compile(r"\d s"))
    with page.expect_request("**/wall/events**") as later:
        page.locator(TILE, has_text="3-16").scroll_into_view_if_needed()
    assert later.value.url != first.value.url


def test_a_phone_has_the_counts_the_newest_alarms_and_all_cells(page: Page, wall: Server) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(wall.url)
    expect(page.locator(".only-shows")).to_contain_text("Stop is at each cell")
    wide = page.evaluate("() => document.documentElement.scrollWidth")
    assert wide <= 390
    small = page.evaluate(
        """() => [...document.querySelectorAll("main a[href], main button, main input")]
          .map((each) => each.getBoundingClientRect())
          .filter((box) => box.height < 44 || box.width < 44).length"""
    )
    assert small == 0
    tile_box = page.locator(TILE).first.bounding_box()
    assert tile_box is not None
    assert tile_box["width"] < 100


def test_the_page_without_scripts_has_the_state(wall: Server) -> None:
    html = wall.http.get("/", headers={"accept": "text/html"}).text
    assert '<noscript><meta http-equiv="refresh" content="5">' in html
    assert tiles(html)["1-02"][0] == "fault"


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_axe_finds_nothing(axe_page: Page, wall: Server, language: str) -> None:
    axe_page.context.add_cookies([{"name": "kiosk_language", "value": language, "url": wall.url}])
    axe_page.set_viewport_size({"width": 1920, "height": 1080})
    axe_page.goto(wall.url)
    expect(axe_page.locator(TILE).first).to_be_visible()
    assert violations(axe_page) == []


def test_a_wall_whose_server_is_lost_says_so(
    page: Page, router: Router, cells: Cells, tmp_path_factory: pytest.TempPathFactory
) -> None:
    server = wall_server(tmp_path_factory.mktemp("lost"), router)
    try:
        page.goto(server.url)
        expect(page.locator(TILE).first).to_be_visible()
    finally:
        server.end()
    expect(page.locator("body")).to_have_attribute("data-cut", "")
    expect(page.locator("#state")).to_be_visible()
