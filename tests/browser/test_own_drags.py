"""A drag that a widget makes of its own takes no tap away: the next one, on a key, is a press."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.finger import Touch
from tests.support.browser.pages import place, widget
from tests.support.parts import Server
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("fingers")

PANEL: Final = """
title = "Drags"
[[interlock]]
id = "operation"
topic = "/stick_enabled"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "stick"
kind = "joystick"
label = "Drive"
topic = "/stick"
type = "geometry_msgs/msg/Twist"
interlock = "operation"
y_axis = { max = 0.5, unit = "m/s" }
x_axis = { max = -1.0, unit = "rad/s" }
[[page.widget]]
id = "course"
kind = "trend"
label = "Course"
[[page.widget.pen]]
label = "Load"
topic = "/load"
type = "std_msgs/msg/Float64"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = { data = true }
[[page.widget]]
id = "text"
kind = "label"
label = "Nothing here"
"""
COUNT_CLICKS: Final = """() => {
  window.clicks = 0;
  addEventListener("click", ({ target }) => (window.clicks += target.closest("button") ? 1 : 0), true);
}"""
TAPS: Final = 12  # of a trend every third was lost


@pytest.fixture(scope="module")
def dragged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("drags"), PANEL) as server:
        yield server


@pytest.mark.parametrize(
    ("surface", "by"),
    [
        ('[data-widget="course"] .area', (80, 0)),
        ('[data-widget="course"] .area', (0, 50)),
        ('[data-widget="stick"] .pad', (0, -50)),
        ('[data-widget="text"]', (60, 0)),
    ],
)
def test_a_tap_right_after_a_quick_drag_is_a_press(
    dragged: Server, touchscreen: Page, surface: str, by: tuple[int, int]
) -> None:
    page = touchscreen
    page.goto(dragged.url)
    button = widget(page, "go").locator("button[type=submit]")
    expect(button).to_be_enabled()
    page.evaluate(COUNT_CLICKS)
    finger = Touch(page)
    box = place(page.locator(surface))
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    for number in range(TAPS):
        finger.send("touchStart", (x, y))
        finger.send("touchMove", (x + by[0] / 2, y + by[1] / 2))
        finger.send("touchMove", (x + by[0], y + by[1]))
        finger.send("touchEnd")
        key = place(button)
        finger.send("touchStart", (key["x"] + key["width"] / 2, key["y"] + key["height"] / 2))
        finger.send("touchEnd")
        page.wait_for_function("(taps) => window.clicks === taps", arg=number + 1)
        page.wait_for_timeout(300)  # a second tap of the same finger soon is not a press
