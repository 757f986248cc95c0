"""Firefox and WebKitGTK show the pages, follow the robot, press, hold, enter numbers and lock."""

import csv
import io
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
from selenium.webdriver import ActionChains, Remote
from selenium.webdriver.common.actions.action_builder import ActionBuilder
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement

from app.system.texts import render, say
from tests.support.browser.webdriver import firefox, webkit
from tests.support.parts import ROOT, SHIPPED, Server, until
from tests.support.servers import demo_server, kept_running

PANEL: Final = """
title = "Cell"
mode = "demo"
interlock = [{ id = "ready", topic = "/ready" }]
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "message"
kind = "text"
label = "Message"
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = -10
max = 10
step = 0.5
[[page.widget]]
id = "operation"
kind = "publish"
label = "Publish"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "{message}" }
[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/speed"
type = "std_msgs/msg/Float64"
message = { data = "{speed}" }
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "std_msgs/msg/Bool"
message = { data = true }
release = { data = false }
interlock = "ready"
[[page.widget]]
id = "count"
kind = "readout"
label = "Count"
topic = "/count"
type = "std_msgs/msg/Int32"
[[page]]
id = "pressure"
title = "Pressure"
fit = true
[[page.group]]
title = "Pressure"
columns = 2
[[page.group.widget]]
id = "vacuum"
kind = "gauge"
label = "Vacuum"
topic = "/vacuum"
type = "std_msgs/msg/Float32"
min = -90
max = 0
[[page.group.widget]]
id = "reset"
kind = "publish"
label = "Reset"
topic = "/reset"
type = "std_msgs/msg/Bool"
message = { data = true }
"""
BROWSERS: Final[dict[str, Callable[[Path], AbstractContextManager[Remote]]]] = {
    "firefox": firefox,
    "webkit": partial(webkit, language="en_US.UTF-8"),
    "webkit in the language C": partial(webkit, language="C"),
}
PAGES: Final = ("operation", "cell", "recipe", "robot", "watch")  # of the shipped panel
STARTED: Final = "return document.documentElement.dataset.floor === ''"
LEFT_OUT: Final = "return document.querySelectorAll('[data-locked], [data-failed], .too-old').length"
# The ends of the gauge's parts, and of the group around them, in px.
ENDS: Final = """
    const end = (selector) => document.querySelector(selector).getBoundingClientRect().bottom;
    return [end(".vertical > .dial"), end(".vertical"), end(".group")]"""

DRAGGED: Final = ("operation", "drive")
# Locks a button; its middle.
LOCK: Final = """
    arguments[0].disabled = true;
    const { left, top, width, height } = arguments[0].getBoundingClientRect();
    return [Math.round(left + width / 2), Math.round(top + height / 2)]"""


@pytest.fixture(scope="module", params=BROWSERS)
def other_browser(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Remote]:
    with BROWSERS[request.param](tmp_path_factory.mktemp("browser")) as remote:
        yield remote


@pytest.fixture(scope="module")
def start(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[], Server]]:
    """Returns a running server; a test may kill it."""
    folder = tmp_path_factory.mktemp("panel")
    with kept_running(lambda: demo_server(folder, PANEL)) as running:
        yield running


def opened(remote: Remote, url: str) -> None:
    remote.get(url)
    until(lambda: remote.execute_script(STARTED), "its scripts run")


def element(remote: Remote, selector: str) -> WebElement:
    return remote.find_element(By.CSS_SELECTOR, selector)


def button(remote: Remote, widget: str) -> WebElement:
    return element(remote, f'[data-widget="{widget}"] button')


def text(remote: Remote, selector: str) -> str:
    return str(element(remote, selector).get_property("textContent"))


def press(remote: Remote, widget: str) -> None:
    """Presses, and waits for the receipt."""
    until(button(remote, widget).is_enabled, "it can be pressed")
    button(remote, widget).click()
    receipt = f"#receipt-{widget}"
    until(lambda: text(remote, receipt), "it has a receipt")
    assert element(remote, receipt).get_attribute("data-outcome") == "published", text(remote, receipt)


def logged(server: Server, widget: str) -> list[dict[str, Any]]:
    """The entries of a widget in the operator's log, the newest first."""
    rows = server.http.get("/log.csv?every=true").text.removeprefix("\ufeff")
    return [row for row in csv.DictReader(io.StringIO(rows)) if row["widget"] == widget]


@pytest.fixture
def shipped(servers: Callable[[Server], Server]) -> Server:
    mine = servers(Server(ROOT, KIOSK_PANEL=str(SHIPPED)))
    until(mine.ready, "ready")
    return mine


@pytest.mark.long("every screen")
def test_each_page_of_the_shipped_panel_starts_whole(shipped: Server, other_browser: Remote) -> None:
    for page in PAGES:
        opened(other_browser, f"{shipped.url}/pages/{page}")
        assert other_browser.execute_script(LEFT_OUT) == 0, page


@pytest.mark.long("every screen")
def test_values_follow_the_robot(start: Callable[[], Server], other_browser: Remote) -> None:
    opened(other_browser, start().url)
    value = '[data-widget="count"] .value'
    until(lambda: text(other_browser, value).strip().isdecimal(), "a value is shown")
    before = text(other_browser, value)
    until(lambda: text(other_browser, value) != before, "another value is shown")


def test_a_press_has_its_receipt(start: Callable[[], Server], other_browser: Remote) -> None:
    server = start()
    opened(other_browser, server.url)
    element(other_browser, '[data-widget="message"] input').send_keys("Grüße 電")
    press(other_browser, "operation")
    assert "Grüße 電" in str(logged(server, "operation"))


@pytest.mark.long("every screen")
@pytest.mark.parametrize(("typed", "value"), [("2.5", "2.5"), ("-7", "-7")])
def test_a_number_that_is_typed_is_sent(
    start: Callable[[], Server], other_browser: Remote, typed: str, value: str
) -> None:
    server = start()
    opened(other_browser, server.url)
    field = element(other_browser, '[data-widget="speed"] input')
    field.clear()
    field.send_keys(typed)
    press(other_browser, "drive")
    assert f'"speed":{value}' in str(logged(server, "drive")).replace(" ", "")


def test_a_hold_lasts_until_it_is_released(start: Callable[[], Server], other_browser: Remote) -> None:
    server = start()
    opened(other_browser, server.url)
    jog = button(other_browser, "jog")
    until(jog.is_enabled, "it can be held")
    ActionChains(other_browser).click_and_hold(jog).perform()
    until(lambda: jog.get_attribute("aria-pressed") == "true", "it is held")
    until(lambda: server.widget("jog")["held"], "the server knows it")
    ActionChains(other_browser).release().perform()
    until(lambda: not server.widget("jog")["held"], "it has ended")
    assert jog.get_attribute("aria-pressed") == "false"
    until(lambda: text(other_browser, "#receipt-jog"), "it has a receipt")


@pytest.mark.long("every screen")
def test_a_vertical_gauge_stays_in_its_group(
    start: Callable[[], Server], other_browser: Remote
) -> None:
    opened(other_browser, start().url + "/pages/pressure")
    dial, gauge, group = other_browser.execute_script(ENDS)
    assert dial <= gauge <= group


@pytest.mark.long("every screen")
def test_dragging_over_locked_buttons_selects_nothing(
    start: Callable[[], Server], other_browser: Remote
) -> None:
    opened(other_browser, start().url)
    first, last = (other_browser.execute_script(LOCK, button(other_browser, name)) for name in DRAGGED)
    actions = ActionBuilder(other_browser)
    actions.pointer_action.move_to_location(*first).pointer_down().move_to_location(*last).pointer_up()
    actions.perform()
    assert other_browser.execute_script("return String(getSelection()).trim()") == ""


def test_a_server_that_is_killed_locks_the_page_until_another_answers(
    start: Callable[[], Server], other_browser: Remote
) -> None:
    server = start()
    opened(other_browser, server.url)
    until(button(other_browser, "operation").is_enabled, "it can be pressed")
    server.process.kill()
    until(lambda: not button(other_browser, "operation").is_enabled(), "it is locked")
    assert render(say("server_lost"), "en") in text(other_browser, "#why-operation")
