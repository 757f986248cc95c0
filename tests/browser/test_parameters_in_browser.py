"""Parameters as an operator sets them: Chromium, the real bridge, a robot on Cyclone DDS."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, Route, expect

from tests.bridge.test_parameters_on_bridge import PANEL
from tests.support import cyclone
from tests.support.browser.pages import asked, place, widget
from tests.support.browser.touch import loaded
from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

cyclone_bridge = cyclone.cyclone_bridge
client = cyclone.client
cyclone_robots = cyclone.cyclone_robots
robot = cyclone.robot

MM = 1 / 0.22  # CSS pixels


@pytest.fixture
def kiosk(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        until(lambda: mine.widget("speed")["enabled"], "the parameters are read")
        until(lambda: robot.subscribers(topic="/parameter_events"), "events are heard")
        yield mine


def set_(page: Page, label: str) -> None:
    """A press of its own, not the second tap of the one before."""
    button = page.get_by_role("button", name=f"Set {label}", exact=True)
    expect(button).not_to_have_attribute("aria-busy", "true")
    button.click()


@pytest.mark.long(None)
def test_a_number_is_stepped_and_set_with_gloves(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    page.goto(kiosk.url)
    speed = widget(page, "speed")
    expect(speed.locator(".value")).to_have_text("0.5 m/s")
    entry = speed.get_by_role("textbox")
    expect(entry).to_have_value("0.5")
    expect(page.locator("html[data-inputs]")).to_be_attached()
    for _ in range(3):
        page.get_by_role("button", name="Speed: more").click()
    expect(entry).to_have_value("0.8")
    expect(speed.locator(".value")).to_have_text("0.5 m/s")  # nothing is set before its button
    set_(page, "Speed")
    expect(speed.locator(".value")).to_have_text("0.8 m/s")
    expect(speed.locator(".result")).to_contain_text("Set to 0.8 m/s")
    assert robot.parameters()["speed"] == 0.8


def test_texts_and_switches_are_set(kiosk: Server, robot: CycloneRobot, page: Page) -> None:
    page.goto(kiosk.url)
    widget(page, "name").get_by_role("textbox").fill("grüezi")
    set_(page, "Name")
    expect(widget(page, "name").locator(".value")).to_have_text("grüezi")
    widget(page, "enabled").get_by_role("checkbox").uncheck()
    set_(page, "Enabled")
    expect(widget(page, "enabled").locator(".value")).to_have_text("Off")
    assert (robot.parameters()["name"], robot.parameters()["enabled"]) == ("grüezi", False)


def test_value_reported_before_the_receipt_is_in_the_input_after_it(
    kiosk: Server, robot: CycloneRobot, own_page: Page
) -> None:
    page = own_page
    limit = widget(page, "limit")

    def late(route: Route) -> None:
        answer = route.fetch()
        robot.set_parameter(name="limit", value=44)
        expect(limit.locator(".value")).to_have_text("44")
        route.fulfill(response=answer)

    page.route_web_socket("**/presses", lambda socket: socket.close())
    page.route("**/widgets/limit", late)
    page.goto(kiosk.url)
    limit.get_by_role("textbox").fill("43")
    set_(page, "Limit")
    expect(limit.get_by_role("textbox")).to_have_value("44")


def test_an_input_follows_the_robot_until_it_is_touched(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    page.goto(kiosk.url)
    limit = widget(page, "limit")
    entry = limit.get_by_role("textbox")
    robot.set_parameter(name="limit", value=20)
    expect(entry).to_have_value("20")
    entry.fill("33")
    robot.set_parameter(name="limit", value=21)
    expect(limit.locator(".value")).to_have_text("21")
    expect(entry).to_have_value("33")
    set_(page, "Limit")
    expect(limit.locator(".value")).to_have_text("33")
    robot.set_parameter(name="limit", value=22)
    expect(entry).to_have_value("22")


def test_confirmed_value_is_the_value_in_the_dialog(
    cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path, page: Page
) -> None:
    """The input follows the robot behind the dialog; the question stays what it was."""
    confirmed = 'parameter = "limit"\nconfirm_press = true'
    panel = PANEL.replace('parameter = "limit"', confirmed)
    with live_server(cyclone_bridge, tmp_path, panel) as kiosk:
        until(lambda: kiosk.widget("limit")["enabled"], "the parameters are read")
        until(lambda: robot.subscribers(topic="/parameter_events"), "events are heard")
        robot.set_parameter(name="limit", value=20)
        loaded(page, kiosk)
        entry = widget(page, "limit").get_by_role("textbox")
        expect(entry).to_have_value("20")
        dialog = asked(page.get_by_role("button", name="Set Limit", exact=True))
        expect(dialog.locator("dd")).to_have_text("20")
        robot.set_parameter(name="limit", value=21)
        expect(widget(page, "limit").locator(".value")).to_have_text("21")
        expect(dialog.locator("dd")).to_have_text("20")
        dialog.get_by_role("button", name="Limit").click()
        expect(widget(page, "limit").locator(".result")).to_contain_text("Set to 20")
        assert robot.parameters()["limit"] == 20


@pytest.mark.long(None)
def test_value_out_of_range_is_marked_and_refused(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    page.goto(kiosk.url)
    speed = widget(page, "speed")
    entry = speed.get_by_role("textbox")
    limits = [entry.get_attribute(f"data-{name}") for name in ("min", "max", "step-size")]
    assert limits == ["0", "1.5", "0.1"]
    entry.fill("1.7")
    assert entry.evaluate("input => input.matches(':invalid')")
    set_(page, "Speed")
    expect(speed.locator(".receipt")).to_contain_text("Speed is 1.7 m/s: it must be 0 to 1.5 m/s")
    assert robot.parameters()["speed"] == 0.5


def test_whole_numbers_beyond_a_browsers_are_set_exactly(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    robot.declare_parameter(name="count", value=2**53 + 1)
    page.goto(kiosk.url)
    count = widget(page, "count")
    expect(count.get_by_role("textbox")).to_have_value("9007199254740993")
    count.get_by_role("textbox").fill("9007199254740995")
    set_(page, "Count")
    expect(count.locator(".value")).to_have_text("9007199254740995")
    assert robot.parameters()["count"] == 2**53 + 3


def test_read_only_parameter_has_no_button(kiosk: Server, page: Page) -> None:
    page.goto(kiosk.url)
    serial = widget(page, "serial")
    expect(serial.locator(".value")).to_have_text("CR-0001")
    expect(serial.get_by_role("button", name="Set")).to_have_count(0)
    expect(serial.get_by_role("textbox")).to_have_count(0)
    expect(serial.locator(".why")).to_contain_text("Read only")


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1024, 600)])
def test_targets_fit_gloves_and_nothing_moves_when_a_lock_comes(
    kiosk: Server, robot: CycloneRobot, page: Page, width: int, height: int
) -> None:
    page.set_viewport_size({"width": width, "height": height})
    page.goto(kiosk.url)
    expect(page.get_by_role("button", name="Set Speed", exact=True)).to_be_enabled()
    places = """() => [
      ...document.querySelectorAll("[data-widget] button:not(.more), [data-entry]"),
    ].map(e => {
      const { x, y, width, height } = e.getBoundingClientRect(); return [x, y, width, height];
    })"""
    before = page.evaluate(places)
    for name in ("Set Speed", "Speed: more", "Speed: less"):
        box = place(page.get_by_role("button", name=name, exact=True))
        assert min(box["width"], box["height"]) >= 14 * MM - 0.5  # as high as the entry beside it
    pressed = place(page.get_by_role("button", name="Set Speed", exact=True))
    assert pressed["width"] >= 20 * MM - 0.5
    robot.end()
    expect(widget(page, "speed")).to_have_attribute("data-state", "old")
    expect(page.get_by_role("button", name="Set Speed", exact=True)).to_be_disabled()
    assert page.evaluate(places) == before
    assert page.evaluate("document.documentElement.scrollWidth") <= width


def test_a_page_without_its_server_shows_old_values(kiosk: Server, page: Page) -> None:
    page.goto(kiosk.url)
    expect(page.get_by_role("button", name="Set Speed", exact=True)).to_be_enabled()
    kiosk.process.kill()
    expect(page.get_by_role("button", name="Set Speed", exact=True)).to_be_disabled()
    expect(widget(page, "speed")).to_have_attribute("data-state", "old")
