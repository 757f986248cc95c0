"""The page of a stop in the browser: its keys, and that it fits each screen in each language."""

import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_line import SIZES
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_stops import PANEL, keys


def told(server: Server) -> list[str]:
    """The stops whose first cause is told."""
    return [key for key in keys(server) if "data-first" in server.http.get(f"/stops/{key}").text]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        until(lambda: told(server), "the machine has stopped", within_s=40)
        yield server


def test_the_fault_parcel_is_downloaded(cell: Server, page: Page, tmp_path: Path) -> None:
    key = keys(cell)[0]
    page.goto(f"{cell.url}/stops/{key}")
    with page.expect_download(timeout=120_000) as download:
        page.get_by_role("link", name="Fault parcel").click()
    assert download.value.suggested_filename.startswith("fault-")
    file = tmp_path / "fault.zip"
    download.value.save_as(file)
    with zipfile.ZipFile(file) as packed:
        assert packed.testzip() is None
        assert {"README.txt", "story.html", "pages/main.html"} <= set(packed.namelist())
        packed.extractall(tmp_path)
    page.goto((tmp_path / "story.html").as_uri())
    expect(page.locator(".sentence")).to_contain_text("Fault")
    requests: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    shown = (tmp_path / "pages/main.html").as_uri()
    page.goto(shown)
    expect(page.locator(".shown-at")).to_contain_text("when the machine stopped")
    expect(page.locator('[data-kind="state"]')).to_contain_text("Fault")
    page.locator('[data-widget="start"] button').first.click(force=True)
    assert requests == [shown]


@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_it_fits_each_screen_and_readers_can_use_it(
    cell: Server, chromium: Browser, language: str
) -> None:
    context = chromium.new_context(locale=language)
    page = context.new_page()
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.goto(f"{cell.url}/stops/{keys(cell)[0]}")
        tabs = page.locator(".story-tabs a[href^='#']")
        for tab in tabs.all() if tabs.first.is_visible() else [None]:
            if tab is not None:
                tab.click()
            wide = page.evaluate(
                "[...document.querySelectorAll('main.story *')].filter(e => e.clientWidth && "
                "e.scrollWidth > e.clientWidth + 1 && getComputedStyle(e).display !== 'inline')"
                ".map(e => e.outerHTML)"
            )
            assert wide == [], (width, height)
            assert violations(page) == []
    context.close()


def test_a_small_screen_has_a_part_at_a_time(cell: Server, page: Page) -> None:
    key = keys(cell)[0]
    page.set_viewport_size({"width": 800, "height": 480})
    page.goto(f"{cell.url}/stops/{key}")
    lines, to_do = page.locator(".story-lines"), page.locator(".story-to-do")
    expect(lines).to_be_visible()
    expect(to_do).to_be_hidden()
    page.get_by_role("link", name="What to do now").click()
    expect(lines).to_be_hidden()
    expect(to_do.get_by_role("link", name="As JSON")).to_be_visible()
    page.goto(f"{cell.url}/stops/{key}#to-do")  # as the question about a reason leads to its keys
    expect(to_do).to_be_visible()
    page.set_viewport_size({"width": 1280, "height": 800})
    expect(lines).to_be_visible()
    expect(page.locator(".story-tabs")).to_be_hidden()


def test_the_first_cause_is_in_view(cell: Server, page: Page) -> None:
    page.set_viewport_size({"width": 800, "height": 480})
    page.goto(f"{cell.url}/stops/{told(cell)[0]}?all=1")
    expect(page.locator(".story li[data-first]").first).to_be_in_viewport(ratio=0.9)
