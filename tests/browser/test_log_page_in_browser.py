"""The operator's log stands inside the frame, in an operator's words, and nothing on a page moves while
it loads."""

import re
from collections.abc import Iterator
from functools import partial
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.panel import load_panel
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, place
from tests.support.parts import ROOT, SHIPPED, Server, until
from tests.support.servers import ready

pytestmark = pytest.mark.long("detail")

SIZES: Final = ((1920, 1080), (1280, 800), (1024, 600), (800, 480), (390, 844))
STOP: Final = "[data-widget=stop] > button:not(.more)"
# A button's own face, a unit that stands after its number, and the lines below a new line may move.
SHIFTS: Final = """globalThis.shifts = [];
new PerformanceObserver((list) => {
  for (const { sources } of list.getEntries()) {
    const moved = sources.filter(({ node }) => !node?.parentElement?.closest(".face, .number, .lines"));
    shifts.push(...moved.map(({ node }) => node?.outerHTML?.slice(0, 90)));
  }
}).observe({ type: "layout-shift", buffered: true });"""


@pytest.fixture(scope="module")
def cell() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(SHIPPED))) as mine:
        yield mine


@pytest.mark.long(None)
def test_stop_is_on_the_log_page_and_works(cell: Server, page: Page) -> None:
    page.goto(f"{cell.url}/log")
    for width, height in SIZES:
        sized(page, width, height).evaluate(DRAWN)
        stop = place(page.locator(STOP))
        assert stop["x"] < 12
        assert stop["y"] + stop["height"] > height - 20
        assert page.locator("main").evaluate("(main) => main.scrollWidth <= main.clientWidth")
    expect(page.locator("html[data-floor]")).to_be_attached()
    sized(page, 1280, 800).locator(STOP).click()
    until(lambda: " of stop by " in cell.process.text, "Stop is sent")
    expect(page.locator("[data-widget=stop] .result")).to_contain_text("Stopped")


def test_on_a_phone_an_answer_is_whole_below_what_was_done(cell: Server, page: Page) -> None:
    cell.http.post("/widgets/operation", json={"inputs": {"message": "for a phone"}})
    page.goto(f"{cell.url}/log?text=for a phone")
    sized(page, 390, 844).evaluate(DRAWN)
    row = page.locator("tr[data-kind]").first
    time, _, done, answer = (place(cell) for cell in row.locator("td").all())
    assert time["y"] < done["y"] < answer["y"]
    assert answer["x"] + answer["width"] <= 390
    assert page.locator(".entries").evaluate("(part) => part.scrollWidth <= part.clientWidth")
    sized(page, 1280, 800)


@pytest.mark.parametrize("size", SIZES)
def test_buttons_show_today_yesterday_this_shift_and_the_start(
    cell: Server, page: Page, size: tuple[int, int]
) -> None:
    cell.http.post("/widgets/operation", json={"inputs": {"message": "today"}})
    page.goto(f"{cell.url}/log?text=today")
    sized(page, *size).evaluate(DRAWN)
    for number, entries in ((0, 1), (1, 0), (2, 1)):
        page.locator(".quick a").nth(number).click()
        expect(page.locator(".quick [aria-current]")).to_have_count(1)
        expect(page.locator(".quick a").nth(number)).to_have_attribute("aria-current", "true")
        assert bool(page.locator("tr[data-kind]").count()) is bool(entries)
        box = place(page.locator(".quick a").nth(number))
        assert min(box["width"], box["height"]) >= 44
    page.locator(".quick a").last.click()
    expect(page).to_have_url(f"{cell.url}/log?")
    sized(page, 1280, 800)


def test_the_log_is_printed_by_its_button_without_the_frame(cell: Server, own_page: Page) -> None:
    page = own_page
    page.add_init_script("window.print = () => (document.body.dataset.printed = '')")
    page.goto(f"{cell.url}/log")
    page.locator("#print").click()
    expect(page.locator("body[data-printed]")).to_be_attached()
    page.emulate_media(media="print")
    expect(page.locator("tr[data-kind]").first).to_be_visible()
    for part in ("header", ".quick", ".filter", ".pager", STOP):
        expect(page.locator(part).first).to_be_hidden()


def test_the_log_has_days_and_the_words_of_an_operator(cell: Server, page: Page) -> None:
    cell.http.post("/widgets/operation", json={"inputs": {"message": "for the log"}})
    page.goto(f"{cell.url}/log?text=for the log")
    expect(page.locator(".day")).to_have_text(re.compile(r"Today, \w+day \d+ \w+ \d{4}"))
    row = page.locator("tr[data-kind]").first
    expect(row).to_contain_text("Publish")
    expect(row).to_contain_text("for the log")
    assert re.search("[0-9a-f]{32}", page.locator("body").inner_text()) is None
    page.goto(f"{cell.url}/log?text=nothing has this")
    expect(page.locator(".empty")).to_be_visible()
    page.goto(cell.url)
    page.get_by_role("link", name="Log").click()
    expect(page.locator(".pages [aria-current]")).to_have_text("Log")


def test_all_pages_have_one_right_edge(cell: Server, page: Page) -> None:
    paths = [f"/pages/{described.id}" for described in load_panel(SHIPPED).pages]
    for width, height in SIZES[:4]:
        sized(page, width, height)
        edges = set()
        for path in (*paths, "/log"):
            page.goto(cell.url + path)
            ends = page.locator(".group").evaluate_all(
                "(groups) => groups.map((group) => group.getBoundingClientRect().right)"
            )
            edges.add(round(max(ends)))
            edges.add(
                round(page.locator(".menu-key").evaluate("(e) => e.getBoundingClientRect().right"))
            )
        assert len(edges) == 1, (width, edges)


@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_nothing_moves_while_a_page_loads(cell: Server, own_page: Page, size: tuple[int, int]) -> None:
    own_page.add_init_script(SHIFTS)
    sized(own_page, *size)
    paths = [f"/pages/{described.id}" for described in load_panel(SHIPPED).pages]

    def loads_still(path: str) -> bool:
        own_page.goto(cell.url + path)
        expect(own_page.locator("html[data-floor]")).to_be_attached()
        own_page.evaluate(DRAWN)
        return bool(own_page.evaluate("shifts") == [])

    for path in (*paths, "/log"):  # what loading moves, it moves each time; a value only now and then
        until(partial(loads_still, path), f"nothing moves on {path}")
