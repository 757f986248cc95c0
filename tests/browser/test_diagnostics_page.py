"""The page of diagnostics: it is updated in place, fits its screens, and a browser that goes releases
what it looked at."""

import os
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from urllib.parse import parse_qs, urlsplit

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from app.cell.session.looks import LINGER_S
from tests.browser.test_accessibility import violations
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN
from tests.support.parts import CHROMIUM_FLAGS, HEADLESS, ROOT, SHIPPED, Server, until
from tests.support.servers import demo_server, ready
from tests.web.test_recordings import PANEL, RECORD

pytestmark = pytest.mark.long("detail")

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
VIEWS: Final = ("links", "topics", "servers", "graph", "nodes")
AIR: Final = '[data-row="subscribed air_pressure"]'
FITS: Final = """() => [
    ...document.querySelectorAll("main, .list-tabs, .list-tabs a, .acts, main .bar")
].every((e) => e.scrollWidth <= e.clientWidth + 1)
    && document.documentElement.scrollHeight <= innerHeight"""


@pytest.fixture(scope="module")
def cell() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(SHIPPED))) as mine:
        yield mine


def looks(server: Server) -> list[str]:
    keys: list[str] = server.http.get("/diagnostics").json()["looks"]
    return keys


def test_the_menu_leads_to_a_page_that_is_updated_in_place(cell: Server, page: Page) -> None:
    page.goto(cell.url)
    page.locator(".menu-key").click()
    page.get_by_role("link", name="Diagnostics").click()
    row = page.locator(AIR)
    expect(row).to_contain_text("FluidPressure")
    row.evaluate("(element) => { element.mine = true; }")
    until(lambda: "ms" in page.locator(".hops .number").first.inner_text(), "a round trip is shown")
    age = row.locator("td").last
    shown = age.inner_text()
    expect(age).not_to_have_text(shown)
    assert row.evaluate("(element) => element.mine")


def test_a_live_look_follows_the_topic_and_pauses(cell: Server, page: Page) -> None:
    page.goto(f"{cell.url}/diagnostics")
    page.locator(AIR).get_by_role("link").click()
    messages = page.locator(".messages")
    expect(messages).to_contain_text("fluid_pressure:")
    shown = messages.inner_text()
    expect(messages).not_to_have_text(shown, use_inner_text=True)
    page.get_by_role("button", name="Pause").click()
    until(lambda: "air_pressure" not in looks(cell), "a pause releases it", within_s=LINGER_S + 60)
    page.get_by_role("button", name="Pause").click()
    until(lambda: "air_pressure" in looks(cell), "it is looked at again")
    page.get_by_role("link", name="Hex", exact=True).click()
    expect(page.locator(".messages")).to_contain_text("0000  00 01 00 00")
    page.get_by_role("link", name="Close").click()
    expect(page.locator(".look")).to_have_count(0)


def test_a_killed_browser_releases_what_it_looked_at(cell: Server, tmp_path: Path) -> None:
    url = f"{cell.url}/diagnostics?look=cell/state"
    profile = f"--user-data-dir={tmp_path}"
    command = [HEADLESS, *CHROMIUM_FLAGS, profile, "--remote-debugging-port=0", url]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        until(lambda: "cell/state" in looks(cell), "it is looked at")
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    until(lambda: "cell/state" not in looks(cell), "it is released", within_s=LINGER_S + 60)


def test_a_check_shows_its_findings(cell: Server, page: Page) -> None:
    page.goto(f"{cell.url}/diagnostics")
    page.get_by_role("button", name="Check").click()
    expect(page.locator(".found")).to_contain_text("simulated robot", timeout=120_000)
    with page.expect_download(timeout=120_000) as download:
        page.get_by_role("button", name="Bundle").click()
    assert download.value.suggested_filename.startswith("operator-panel-support-")


@pytest.mark.parametrize("view", VIEWS)
def test_each_list_fits_each_screen_in_each_language(
    cell: Server, chromium: Browser, view: str
) -> None:
    for language in ("en", "ja", "de"):
        context: BrowserContext = chromium.new_context(locale=language)
        page = context.new_page()
        for width, height in SIZES:
            sized(page, width, height)
            for look in ("", "&look=cell/state"):
                page.goto(f"{cell.url}/diagnostics?view={view}{look}")
                page.evaluate(DRAWN)
                assert page.evaluate(FITS), (language, width, height, look)
                small = page.locator("main :is(button, a):visible").evaluate_all(
                    "(all) => all.filter((e) => e.getBoundingClientRect().height < 43.5)"
                    ".map((e) => e.outerHTML.slice(0, 90))"
                )
                assert small == [], (language, width, height)
        context.close()


def test_axe_finds_nothing(cell: Server, axe_page: Page) -> None:
    for view in VIEWS:
        for width, height in (SIZES[0], SIZES[2]):
            sized(axe_page, width, height)
            axe_page.goto(f"{cell.url}/diagnostics?view={view}&look=cell/state")
            axe_page.evaluate(DRAWN)
            assert violations(axe_page) == []


def test_open_in_foxglove_shows_links_to_a_file_that_can_be_read(tmp_path: Path, page: Page) -> None:
    with demo_server(tmp_path, PANEL + RECORD) as server:
        page.goto(f"{server.url}/diagnostics")
        page.get_by_role("button", name="Open in Foxglove").click()
        links = page.locator(".shared a")
        expect(links).to_have_count(2)
        in_browser, in_app = (links.nth(at).get_attribute("href") or "" for at in range(2))
        address = parse_qs(urlsplit(in_browser).query)["ds.url"][0]
        assert in_browser.startswith("https://app.foxglove.dev/~/view?ds=remote-file&ds.url=http%3A")
        assert in_app == f"foxglove://open?{urlsplit(in_browser).query}"
        assert server.http.get(address).content[:5] == b"\x89MCAP"
        assert address.rpartition("/")[2] not in page.url
        text = page.locator(".shared").inner_text()
        page.wait_for_timeout(2500)  # the page is fetched again
        assert page.locator(".shared").inner_text() == text
