"""The line of alarms below the header: it shows the most urgent, and acknowledges what it shows."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import FloatRect, Page, expect

from app.panel import load_panel
from app.panel.checks.fit import page_height
from app.panel.widgets.tiles import Screen
from tests.browser.test_accessibility import violations
from tests.support.browser.browsers import sized
from tests.support.browser.finger import Touch
from tests.support.browser.pages import DRAWN, HIDE, middle, place, widget
from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server, panel_file
from tests.web.test_alarms import LOW, PANEL, act, listed, server_with

pytestmark = pytest.mark.promise("alarms")

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
LINE: Final = ".alarm-line"
BUTTON: Final = ".alarm-line button"
NOW_AND_THEN: Final = "values = [6.0, 4.5], period_s = 8.0"
TILE: Final = """
[[page.group]]
title = "{id}"
[[page.group.widget]]
id = "{id}"
label = "{id}"
topic = "/{id}"
"""
NUMBER: Final = TILE + 'kind = "readout"\ntype = "std_msgs/msg/Float64"\n'
LAMP: Final = (
    TILE
    + 'kind = "indicator"\ntype = "std_msgs/msg/Bool"\n'
    + 'states = [{{ value = true, text = "On", shape = "circle" }}]\n'
)
WITH_AND_WITHOUT_NOTE: Final = "".join(
    (
        'title = "Cell"\n[[page]]\nid = "main"\ntitle = "Main"\n',
        *(
            tile.format(id=f"{state}_{kind}")
            for tile, kind in ((NUMBER, "number"), (LAMP, "lamp"))
            for state in ("live", "silent")
        ),
        '[demo]\n"/live_number" = { values = [1.0] }\n"/live_lamp" = { values = [true] }\n',
        '"/silent_number" = { silent = true }\n"/silent_lamp" = { silent = true }\n',
    )
)
CONTROL: Final = "\n[control]\nrequired = true\n"


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """Both of its alarms are active: `air_latched` of high priority, and `air_low`."""
    with server_with(tmp_path) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        yield server


def started(page: Page, url: str) -> Page:
    page.goto(url)
    expect(page.locator("html[data-floor]")).to_be_attached()
    return page


def test_the_line_shows_the_most_urgent_alarm_with_what_to_do_first(cell: Server, page: Page) -> None:
    act(cell, "air_latched", "acknowledge", occurrence=1)
    started(page, cell.url)
    line = page.locator(LINE)
    expect(line).to_have_attribute("data-priority", "2")
    expect(line.locator("b[data-text=text]")).to_have_text("Air pressure low")
    expect(line.locator("[data-text=action]")).to_have_text("Open valve V1")
    expect(line.locator(".step-of")).to_be_hidden()
    expect(line.locator("b[data-text=unacknowledged]")).to_have_text("1")
    expect(line.locator("[data-text=active]")).to_have_text("2")
    expect(page.locator(BUTTON)).to_be_enabled()
    started(page, f"{cell.url}/log")
    expect(page.locator(LINE)).to_have_attribute("data-alarm", "air_low")


@pytest.mark.long("detail")
def test_the_line_says_its_robot_and_that_more_steps_follow(tmp_path: Path, page: Page) -> None:
    robots = "".join(
        f'[[robot]]\nid = "{name}"\nnamespace = "/{name}"\n'
        f'name = {{ en = "Cell {name.upper()}", de = "Zelle {name.upper()}" }}\n'
        for name in ("a", "b")
    )
    steps = PANEL.replace('en = "Open valve V1"', 'en = "Open valve V1.\\nCall service."')
    steps = steps.replace("latched = true\n", 'latched = true\naction = "Look.\\nReset."\n')
    panel = steps.replace("[[page]]", f"{robots}[[page]]", 1) % LOW
    with demo_server(tmp_path, panel) as server:
        until(lambda: len(listed(server)) == 4, "the alarms are raised")
        started(page, server.url)
        line = page.locator(LINE)
        for width, height in SIZES:
            sized(page, width, height).evaluate(DRAWN)
            expect(line.locator(".robot")).to_have_text(re.compile("^Cell [AB]$"))
            expect(line.locator(".robot")).to_be_visible()
            expect(line.locator(".step-of")).to_have_text("1/2")
            expect(line.locator(".step-of")).to_be_visible()


def test_an_alarm_that_came_under_the_finger_is_not_acknowledged(
    cell: Server, touch_page: Page
) -> None:
    page = started(touch_page, cell.url)
    expect(page.locator(LINE)).to_have_attribute("data-alarm", "air_latched")
    touch = Touch(page)
    with page.expect_response("**/acknowledge") as answer:
        touch.send("touchStart", middle(page.locator(BUTTON)))
        act(cell, "air_latched", "acknowledge", occurrence=1)
        expect(page.locator(LINE)).to_have_attribute("data-alarm", "air_low")
        touch.send("touchEnd")
    assert answer.value.url == f"{cell.url}/alarms/air_latched/acknowledge"
    assert not listed(cell)["air_low"]["acknowledged"]


def test_a_tap_acknowledges_the_alarm_and_every_browser_shows_the_next(
    cell: Server, touch_page: Page, page: Page
) -> None:
    started(page, cell.url)
    started(touch_page, cell.url)
    for width, height in SIZES:
        sized(touch_page, width, height).evaluate(DRAWN)
        assert place(touch_page.locator(BUTTON))["height"] >= 44
    touch_page.locator(BUTTON).tap()
    for shown in (touch_page, page):
        expect(shown.locator(LINE)).to_have_attribute("data-alarm", "air_low")
    assert listed(cell)["air_latched"]["acknowledged"]
    assert not listed(cell)["air_low"]["acknowledged"]


def test_nothing_moves_when_an_alarm_comes(tmp_path: Path, page: Page) -> None:
    with server_with(tmp_path, NOW_AND_THEN) as server:
        started(page, server.url)
        line, parts = page.locator(LINE), ("main", LINE, ".group", ".menu-key")

        def shown() -> str:
            return line.get_attribute("data-alarm") or ""

        def places() -> list[FloatRect]:
            return [place(page.locator(part).first) for part in parts]

        def places_without_alarm() -> list[FloatRect] | None:
            """None if an alarm was shown before or after they were measured."""
            for alarm, row in listed(server).items():
                if not row["acknowledged"]:
                    act(server, alarm, "acknowledge", occurrence=row["occurrence"])
            measured = None if shown() else places()
            return None if shown() else measured

        before = until(places_without_alarm, "no alarm is shown", every_s=0.5)  # acts have a rate
        until(lambda: bool(shown()), "an alarm comes again", within_s=40)
        assert places() == before


@pytest.mark.parametrize("text_size", ["normal", "large"])
def test_a_note_moves_nothing(tmp_path: Path, page: Page, text_size: str) -> None:
    with demo_server(tmp_path, WITH_AND_WITHOUT_NOTE) as server:
        page.context.add_cookies([{"name": "kiosk_text_size", "value": text_size, "url": server.url}])
        page.goto(server.url)
        for kind in ("number", "lamp"):
            live, silent = (widget(page, f"{state}_{kind}") for state in ("live", "silent"))
            expect(live).to_have_attribute("data-state", "live")
            expect(silent.locator(".note")).not_to_be_empty()
            for width, height in SIZES:
                sized(page, width, height).evaluate(DRAWN)
                assert place(live)["height"] == place(silent)["height"], f"{kind}, {width}"


def test_without_a_connection_alarms_are_not_known_and_acknowledge_is_locked(
    cell: Server, page: Page
) -> None:
    started(page, cell.url)
    expect(page.locator(BUTTON)).to_be_enabled()
    page.evaluate(HIDE)
    expect(page.locator(f"{LINE} .cut")).to_be_visible()
    expect(page.locator(f"{LINE} .by-loss")).to_be_visible()
    expect(page.locator(f"{LINE} b[data-text=text]")).to_be_hidden()
    expect(page.locator(BUTTON)).to_be_disabled()
    page.evaluate(HIDE, False)
    expect(page.locator(f"{LINE} .cut")).to_be_hidden()
    expect(page.locator(BUTTON)).to_be_enabled()


def test_acknowledge_is_locked_without_control(tmp_path: Path, own_page: Page, page: Page) -> None:
    with server_with(tmp_path, more=CONTROL) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        started(own_page, server.url)
        expect(own_page.locator(BUTTON)).to_be_enabled()  # it has control
        started(page, server.url)
        expect(page.locator(BUTTON)).to_be_disabled()
        expect(page.locator(f"{LINE} .by-control")).to_be_visible()


@pytest.mark.long("detail")
def test_without_scripts_a_form_acknowledges_what_it_showed(
    cell: Server, without_scripts: Page
) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/?reloaded=1")
    page.locator(BUTTON).click()
    expect(page.locator(LINE)).to_have_attribute("data-alarm", "air_low")
    assert listed(cell)["air_latched"]["acknowledged"]
    assert not listed(cell)["air_low"]["acknowledged"]


@pytest.mark.long("detail")
def test_axe_finds_nothing_on_the_line(cell: Server, axe_page: Page) -> None:
    started(axe_page, cell.url)
    assert violations(axe_page) == []
    for alarm in ("air_latched", "air_low"):
        act(cell, alarm, "acknowledge", occurrence=1)
    expect(axe_page.locator(f"{LINE} .known")).to_be_visible()
    assert violations(axe_page) == []


@pytest.mark.long("detail")
def test_the_line_takes_its_height_from_the_page_and_none_without_alarms(
    cell: Server, tmp_path: Path, page: Page
) -> None:
    described = load_panel(panel_file(tmp_path, PANEL % LOW))
    started(page, cell.url)
    for width, height in SIZES:
        sized(page, width, height).evaluate(DRAWN)
        screen = Screen.from_size(f"{width}x{height}", described.mm_per_px)
        main = place(page.locator("main"))
        assert main["y"] == 2 * screen.header
        assert main["height"] - 2 * screen.pad_above == page_height(
            described, described.pages[0], screen
        )
    quiet = described.model_copy(update={"alarms": ()})
    for size in SIZES:
        screen = Screen.from_size(f"{size[0]}x{size[1]}", quiet.mm_per_px)
        assert (
            page_height(quiet, quiet.pages[0], screen) == size[1] - screen.header - 2 * screen.pad_above
        )


def test_without_a_robot_the_line_does_not_say_that_there_is_no_alarm(
    tmp_path: Path, page: Page
) -> None:
    panel = str(panel_file(tmp_path, PANEL % LOW))
    with Server(ROOT, KIOSK_MODE="live", KIOSK_PANEL=panel) as server:
        until(server.answers, "the server is there")
        started(page, server.url)
        expect(page.locator(f"{LINE} .unheard")).to_have_text(
            "Alarms are not known: no connection to the robot."
        )
        expect(page.locator(f"{LINE} .unheard")).to_be_visible()
        expect(page.locator(f"{LINE} .none")).to_be_hidden()
