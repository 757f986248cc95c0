"""The panel in a frame of another site's page: who may show it, what it shows, and what it may not do.

The panel is at 127.0.0.1, the page around it at localhost: two sites, to a browser.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Frame, Page, expect

from app.system.texts import render, say
from tests.support.browser.pages import press_button
from tests.support.embedding import embedding_page
from tests.support.holds import PANEL
from tests.support.parts import Server, free_port, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("detail")

MORE: Final = """
[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/say"
type = "std_msgs/msg/String"
message = { data = "x" }
[[page]]
id = "two"
title = "Two"
[[page.widget]]
id = "value"
kind = "readout"
label = "Value"
topic = "/value"
type = "std_msgs/msg/Float64"
field = "data"
[[page.widget]]
id = "again"
kind = "publish"
label = "Again"
topic = "/again"
type = "std_msgs/msg/String"
message = { data = "x" }
"""
PATIENT: Final = "tests.support.apps.patient:app"
PRESS: Final = """(path) => fetch(path, {
  method: "POST",
  headers: { "content-type": "application/json" },
  body: '{"inputs": {}}',
}).then((answer) => answer.status)"""
OPEN: Final = """(path) => new Promise((done) => {
  const socket = new WebSocket(new URL(path, location).href.replace(/^http/, "ws"));
  socket.onopen = () => done("open");
  socket.onerror = () => done("refused");
})"""
LOCKED: Final = render(say("page_embedded"))


@contextmanager
def embedded(folder: Path, rules: str, path: str = "/pages/one") -> Iterator[tuple[Server, str]]:
    """A server whose panel file has these `rules`, and the URL of a page that shows the panel."""
    port = free_port()
    table = f"[embed]\n{rules.format(origin=f'http://localhost:{port}')}\n" if rules else ""
    with (
        demo_server(folder, PANEL + MORE + table, app=PATIENT) as server,
        embedding_page(port, server.url + path) as around,
    ):
        yield server, around


def frame_of(page: Page) -> Frame:
    frame = page.frame("panel")
    assert frame is not None
    return frame


ALLOWED: Final = 'origins = ["{origin}"]'


@pytest.mark.long(None)
def test_an_allowed_site_shows_values_and_no_controls(own_page: Page, tmp_path: Path) -> None:
    page = own_page
    page.context.clear_cookies()
    with embedded(tmp_path, ALLOWED) as (server, around):
        page.goto(around)
        frame = frame_of(page)
        frame.wait_for_url(f"{server.url}/pages/one?embed=1")  # by the browser's own word
        say_it = frame.locator('[data-widget="say"]')
        expect(press_button(frame, "say")).to_be_disabled()
        expect(say_it.locator('[data-text="reason"]')).to_have_text(LOCKED)
        expect(press_button(frame, "jog")).to_be_disabled()
        expect(frame.locator(".menu-key")).to_be_hidden()
        until(lambda: server.widget("say")["enabled"], "the panel itself may press")
        expect(press_button(frame, "say")).to_be_disabled()  # still, with the events of that
        frame.get_by_role("link", name="Two").click()
        frame.wait_for_url(f"{server.url}/pages/two?embed=1")
        expect(frame.locator('[data-widget="value"] [data-text="text"]')).to_contain_text(
            re.compile("[0-9]")
        )
        expect(press_button(frame, "again")).to_be_disabled()
        assert page.context.cookies(server.url) == []


def test_server_refuses_presses_from_a_frame(own_page: Page, tmp_path: Path) -> None:
    page = own_page
    with embedded(tmp_path, ALLOWED) as (server, around):
        page.goto(around)
        frame = frame_of(page)
        frame.wait_for_url(f"{server.url}/pages/one?embed=1")
        assert frame.evaluate(PRESS, "/widgets/say") == 403
        assert frame.evaluate(PRESS, "/widgets/say/cancel") == 403
        assert frame.evaluate(OPEN, "/presses?embed=1") == "refused"
        assert frame.evaluate(OPEN, "/widgets/jog/hold?embed=1") == "refused"
        assert server.http.get("/log.csv?every=true").text.count("say") == 0
        page.goto(f"{server.url}/pages/one")  # by itself it presses
        assert page.evaluate(PRESS, "/widgets/say") == 200


@pytest.mark.parametrize(
    "rules", ["", 'origins = ["https://dashboard.example"]'], ids=["none", "another"]
)
def test_frame_on_any_other_site_stays_empty(own_page: Page, tmp_path: Path, rules: str) -> None:
    page = own_page
    with embedded(tmp_path, rules) as (_, around):
        with page.expect_console_message(lambda said: "frame-ancestors" in said.text):
            page.goto(around)
        assert frame_of(page).locator("[data-widget]").count() == 0


def test_with_controls_a_frame_presses(own_page: Page, tmp_path: Path) -> None:
    page = own_page
    with embedded(tmp_path, f"{ALLOWED}\ncontrols = true") as (_, around):
        page.goto(around)
        frame = frame_of(page)
        expect(press_button(frame, "say")).to_be_enabled()
        press_button(frame, "say").click()
        expect(frame.locator("#receipt-say")).to_have_attribute("data-outcome", "published")
