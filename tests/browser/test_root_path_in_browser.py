"""The panel below a path behind a proxy, which takes the path off or leaves it: all that a page has."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Page, Request, expect

from tests.support.browser.pages import comes, middle, press_button, widget
from tests.support.holds import PANEL
from tests.support.parts import TAP_AGAIN_MS, free_port, until
from tests.support.proxy import proxied
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("detail")

ROOT: Final = "/plant/cell1"
MORE: Final = """
[[page.widget]]
id = "text"
kind = "text"
label = "Text"
[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/say"
type = "std_msgs/msg/String"
message = { data = "{text}" }
interlock = "operation"
[[page.widget]]
id = "view"
kind = "camera"
label = "View"
topic = "/view"
type = "sensor_msgs/msg/CompressedImage"
[[page.widget]]
id = "value"
kind = "trend"
label = "Value"
[[page.widget.pen]]
label = "Value"
topic = "/value"
type = "std_msgs/msg/Float64"
field = "data"
[[page]]
id = "two"
title = "Two"
[[page.widget]]
id = "number"
kind = "readout"
label = "Number"
topic = "/value"
type = "std_msgs/msg/Float64"
field = "data"
"""
PATIENT: Final = "tests.support.apps.patient:app"


@pytest.fixture(
    scope="module",
    params=[
        pytest.param((True, "setting"), id="taken off, by the setting"),
        pytest.param((False, "setting"), id="left, by the setting"),
        pytest.param((True, "uvicorn"), id="taken off, by uvicorn's option"),
        pytest.param((False, "uvicorn"), id="left, by uvicorn's option"),
    ],
)
def url(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The panel's URL behind the proxy."""
    strip, by = request.param
    folder: Path = tmp_path_factory.mktemp("cell")
    setting = {"KIOSK_ROOT_PATH": ROOT} if by == "setting" else {}
    options = [] if by == "setting" else ["--root-path", ROOT]
    with (
        demo_server(folder, PANEL + MORE, app=PATIENT, options=options, **setting) as server,
        proxied(server.port, free_port(), ROOT, strip) as shown,
    ):
        yield shown


@pytest.fixture
def asked(page: Page) -> Iterator[list[Request]]:
    """All requests of the page."""
    requests: list[Request] = []

    def note(request: Request) -> None:
        requests.append(request)

    page.on("request", note)
    yield requests
    page.remove_listener("request", note)


def below(requests: list[Request]) -> bool:
    """Whether all URLs are below the root path, and were answered."""
    paths = [urlsplit(request.url).path for request in requests if not request.url.startswith("data:")]
    assert [path for path in paths if not path.startswith(f"{ROOT}/")] == []
    return bool(paths)


def test_pages_presses_events_holds_and_pictures_work_below_a_path(
    page: Page, url: str, asked: list[Request]
) -> None:
    page.goto(f"{url}/")
    say = press_button(page, "say")
    expect(say).to_be_enabled()  # by the events
    page.locator("#input-text").fill("below a path")
    say.click()
    expect(page.locator("#receipt-say")).to_have_attribute("data-outcome", "published")
    until(lambda: widget(page, "view").get_attribute("data-frame"), "a picture")
    jog = widget(page, "jog")
    page.mouse.move(*middle(jog))

    def holds() -> bool:
        """A page on a machine that stands still loses its stream: then it is pressed again."""
        page.mouse.up()
        expect(press_button(page, "jog")).to_be_enabled()
        page.mouse.down()
        return comes(page.locator('[data-widget="jog"] button:not(.more)[aria-pressed=true]'))

    until(holds, "the hold begins")
    page.mouse.up()
    expect(press_button(page, "jog")).to_have_attribute("aria-pressed", "false")
    assert below(asked)
    kinds = {request.resource_type for request in asked}
    assert {"document", "stylesheet", "script", "eventsource"} <= kinds


def test_links_forms_and_cookies_stay_below_the_path(
    page: Page, url: str, asked: list[Request]
) -> None:
    page.goto(f"{url}/")
    page.get_by_role("link", name="Two").click()
    expect(page).to_have_url(f"{url}/pages/two")
    page.goto(f"{url}/log")
    page.evaluate("document.querySelector('form.filter').requestSubmit()")
    expect(page).to_have_url(re.compile(f"^{re.escape(url)}/log\\?since=&"))
    page.get_by_role("link", name="Two").click()
    expect(page).to_have_url(f"{url}/pages/two")
    answer = page.request.post(
        f"{url}/display", form={"theme": "dark", "page": f"{ROOT}/pages/two"}, max_redirects=0
    )
    assert (answer.status, answer.headers["location"]) == (303, f"{ROOT}/pages/two")
    assert "Path=/plant/cell1" in answer.headers["set-cookie"]
    error = page.request.get(f"{url}/none", headers={"accept": "text/html"})
    assert f'href="{ROOT}/"' in error.text()
    assert below(asked)


def test_a_form_is_pressed_below_the_path(without_scripts: Page, url: str) -> None:
    without_scripts.goto(f"{url}/pages/one")
    without_scripts.wait_for_timeout(TAP_AGAIN_MS)  # sooner it is a second tap
    without_scripts.get_by_role("button", name="Say").click()
    expect(without_scripts.locator("#receipt-say")).to_have_attribute("data-outcome", "published")
    assert without_scripts.url.startswith(f"{url}/pages/one?receipt=")


def test_the_server_itself_can_be_opened_with_and_without_the_path(
    chromium: Browser, tmp_path: Path
) -> None:
    with demo_server(tmp_path, PANEL, KIOSK_ROOT_PATH=ROOT) as server:
        for path in ("/", f"{ROOT}/", f"{ROOT}/pages/one", "/pages/one"):
            answer = server.http.get(path)
            assert (answer.status_code, f'href="{ROOT}/static/' in answer.text) == (200, True)
        assert server.http.get("/openapi.json").json()["servers"] == [{"url": ROOT}]
        assert server.http.get(f"{ROOT}/pages/one/").headers["location"].endswith(f"{ROOT}/pages/one")
