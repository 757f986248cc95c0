"""How a page looks with all that a panel can have, on both screens: several robots, control, every
kind of widget, long labels."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import FloatRect, Page, expect

from tests.browser.test_pages import SIZES
from tests.support.browser.fonts import SETS
from tests.support.browser.pages import asked, place
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = [pytest.mark.long("every screen"), pytest.mark.promise("layout")]

SOFT_HYPHEN: Final = "\u00ad"
LONG: Final = SOFT_HYPHEN.join(("Geschwindigkeits", "begrenzungs", "freigabe"))
ROBOT: Final = "Montageroboter Süd"
PANEL: Final = f"""
title = "Schweißzelle 3 – Roboterarbeitsplatz"
[control]
required = true
[[interlock]]
id = "operation"
topic = "/operation_enabled"
[[robot]]
id = "r1"
name = "{ROBOT}"
namespace = "/robot1"
[[robot]]
id = "r2"
name = "Robot 2"
namespace = "/robot2"
[[page]]
id = "all"
title = "Alles auf einer Seite"
[[page.widget]]
id = "message"
kind = "text"
label = "Meldung an die Robotersteuerung"
[[page.widget]]
id = "n"
kind = "number"
label = "Sollgeschwindigkeit des Zuführbands"
min = 0
max = 100
unit = "mm/s"
[[page.widget]]
id = "speed"
kind = "slider"
label = "Vorschubgeschwindigkeit"
min = -0.5
max = 1.5
step = 0.1
unit = "m/s"
[[page.widget]]
id = "mode"
kind = "select"
label = "Betriebsart"
options = [{{ value = 1, label = "Einzelschrittbetrieb" }}, {{ value = 2, label = "Dauerbetrieb" }}]
[[page.widget]]
id = "light"
kind = "toggle"
label = "Arbeitsraumbeleuchtung"
[[page.widget]]
id = "allow"
kind = "publish"
label = "{LONG}"
topic = "/operation1"
type = "std_msgs/msg/String"
message = {{ data = "{{message}}" }}
confirm_press = true
span = 3
[[page.widget]]
id = "serial"
kind = "parameter"
label = "Seriennummer der Steuerung"
node = "/system_controller"
parameter = "serial"
type = "string"
[[page.widget]]
id = "enabled"
kind = "indicator"
label = "Betriebsfreigabe"
topic = "/operation_enabled"
type = "std_msgs/msg/Bool"
field = "data"
states = [{{ value = true, text = "Frei", shape = "circle" }},
          {{ value = false, text = "Gesperrt", shape = "cross", colour = "red" }}]
[[page.widget]]
id = "feed"
kind = "parameter"
label = "Vorschub"
node = "/system_controller"
parameter = "speed"
type = "double"
"""


@pytest.fixture(scope="module", params=SETS)
def fonts(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL) as mine:
        yield mine


@pytest.fixture(params=SIZES)
def shown(demo: Server, page: Page, request: pytest.FixtureRequest) -> Page:
    width, height = request.param
    page.set_viewport_size({"width": width, "height": height})
    page.goto(demo.url)
    expect(page.locator("#banner")).to_be_visible()
    return page


def box(page: Page, selector: str) -> FloatRect:
    expect(page.locator(selector)).to_be_visible()
    return place(page.locator(selector))


def right(page: Page, selector: str) -> float:
    rect = box(page, selector)
    return float(rect["x"] + rect["width"])


def test_the_header_shows_the_robots_name_whole_and_all_that_can_be_touched(shown: Page) -> None:
    name = shown.locator("header h1 b")
    expect(name).to_have_text(ROBOT)
    assert name.evaluate("(b) => b.scrollWidth - b.clientWidth") == 0
    assert right(shown, "header h1 b") <= box(shown, "#banner")["x"]
    assert right(shown, "#banner") <= box(shown, ".lamps")["x"]
    assert right(shown, ".lamps") <= box(shown, "#control")["x"]
    assert right(shown, "#control") <= box(shown, ".menu-key")["x"]
    assert right(shown, ".menu-key") <= shown.evaluate("innerWidth")
    for each in (".banner", ".lamps", ".menu-key"):
        assert shown.locator(each).evaluate("(one) => one.scrollWidth <= one.clientWidth"), each


def take_control(page: Page) -> None:
    """The first browser at the cell has it already."""
    button = page.locator('[data-widget="allow"] > button:not(.more)')
    take = page.get_by_role("button", name="Take control")
    until(lambda: button.is_enabled() or take.is_visible(), "there is a way to control")
    if not button.is_enabled():
        take.click()
    expect(button).to_be_enabled()


def test_confirmation_names_the_robot_and_empty_inputs(shown: Page) -> None:
    expect(shown.locator("html[data-floor]")).to_be_attached()
    take_control(shown)
    dialog = asked(shown.locator('[data-widget="allow"] > button:not(.more)'))
    expect(dialog.get_by_role("heading")).to_have_text(f"{LONG} on {ROBOT}?")
    expect(dialog.locator("dd")).to_have_text("(empty)")
    yes, no = box(shown, "dialog:popover-open .yes"), box(shown, "dialog:popover-open .no")
    assert no["width"] * 0.22 >= 20
    assert yes["width"] * 0.22 >= 20
    space = """(button) => {
      const text = document.createRange();
      text.selectNodeContents(button);
      const inside = text.getBoundingClientRect(), around = button.getBoundingClientRect();
      return Math.min(inside.left - around.left, around.right - inside.right);
    }"""
    assert shown.locator("dialog:popover-open .yes").evaluate(space) >= 12
    dialog.locator(".no").click()


@pytest.mark.long("detail")
def test_confirmation_question_is_the_same_without_scripts(demo: Server, without_scripts: Page) -> None:
    page = without_scripts
    page.goto(demo.url)
    take = page.get_by_role("button", name="Take control")
    if take.is_visible():
        take.click()
    page.locator('[data-widget="allow"] > button:not(.more)').click()
    expect(page.get_by_role("heading", level=2)).to_have_text(f"{LONG} on {ROBOT}?")
    expect(page.get_by_text("SIMULATED ROBOT")).to_be_visible()
    expect(page.locator("dd")).to_have_text("(empty)")


def test_the_first_button_is_seen_without_scrolling(shown: Page) -> None:
    button = box(shown, '[data-widget="allow"] > button:not(.more)')
    assert button["y"] + 0.7 * button["height"] <= shown.evaluate("innerHeight")
    toggle = box(shown, '[data-widget="light"] i')
    assert button["y"] - toggle["y"] - toggle["height"] >= 4 / 0.22 - 1  # millimetres
    assert box(shown, '[data-widget="n"]')["y"] == box(shown, '[data-widget="speed"]')["y"]


@pytest.mark.long("detail")
def test_displays_are_no_higher_than_their_content(shown: Page) -> None:
    low, high = box(shown, '[data-widget="enabled"]'), box(shown, '[data-widget="feed"]')
    middle, height = low["y"] + low["height"] / 2, high["height"]
    assert abs(middle - high["y"] - height / 2) < 12  # beside it
    assert low["height"] < height * 0.6
    expect(shown.locator('[data-widget="serial"] .setting')).to_be_hidden()
    assert box(shown, '[data-widget="serial"]')["height"] < high["height"] * 0.7


# Where in its text a label begins a new line.
BREAKS: Final = """(label) => {
  const text = label.firstChild, one = document.createRange(), found = [];
  let last = null;
  for (let at = 0; at < text.length; at++) {
    one.setStart(text, at);
    one.setEnd(text, at + 1);
    const place = [...one.getClientRects()].at(-1); // the first one may be the end of the line before
    if (!place?.width) continue;
    const { top } = place;
    if (last !== null && top > last) found.push(at);
    last = top;
  }
  return found;
}"""


@pytest.mark.long("detail")
def test_a_soft_hyphen_says_where_a_long_word_is_broken(shown: Page) -> None:
    """No browser needs a dictionary for it."""
    breaks = shown.locator('[data-widget="allow"] .label').evaluate(BREAKS)
    assert breaks
    assert {LONG[at - 1] for at in breaks} <= {SOFT_HYPHEN}
