"""The result of a press whose button is locked meanwhile, and labels that are signs."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.pages import place, widget
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("detail")

PANEL: Final = """
title = "Cell"
mode = "demo"
interlock = [{ id = "operation", topic = "/operation_enabled", max_age_s = 2.0 }]

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "move"
kind = "action"
label = "Move"
action = "/move"
type = "example_interfaces/action/Fibonacci"
goal = { order = 3 }
result = "{sequence[0]:.2f} m"
progress = "sequence[0]"
progress_falls = true

[[page.widget]]
id = "down"
kind = "hold"
label = "−"
icon = "minus"
span = 3
topic = "/jog"
type = "std_msgs/msg/Float64"
message = { data = -0.1 }
release = { data = 0.0 }
interlock = "operation"

[[page.widget]]
id = "up"
kind = "hold"
label = "Up"
icon = "plus"
span = 3
topic = "/jog"
type = "std_msgs/msg/Float64"
message = { data = 0.1 }
release = { data = 0.0 }
interlock = "operation"

[[page.widget]]
id = "course"
kind = "trend"
label = "Course"
right_max = 8.0
[[page.widget.pen]]
label = "Load"
topic = "/load"
type = "std_msgs/msg/Float64"
unit = "%"
[[page.widget.pen]]
label = "Air"
topic = "/air"
type = "std_msgs/msg/Float64"
unit = "bar"
axis = "right"
"""
# As an interlock does whose topic forbids after the goal has ended.
LOCK: Final = """(key) => {
  key.querySelector("button").disabled = true;
  key.querySelector('[data-text="reason"]').textContent = "Guard door is open: it must be closed.";
  return [key, key.querySelector(".why"), key.querySelector(".result")].map((element) => {
    const { top, bottom } = element.getBoundingClientRect();
    return element.checkVisibility({ visibilityProperty: true }) ? [top, bottom] : null;
  });
}"""
RECTS: Final = """(texts) => texts.map((text) => text.getBoundingClientRect())
  .map(({ left, right }) => [left, right])"""
SIZES: Final = [(1280, 800), (1024, 600), (800, 480)]


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as mine:
        yield mine


@pytest.mark.parametrize("size", SIZES)
def test_a_result_is_readable_beside_the_lock(cell: Server, page: Page, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(cell.url)
    move = widget(page, "move")
    key = move.locator(".key")
    button = key.locator("> button:not(.more)")
    button.click()
    result = key.locator(".result")
    expect(result).to_have_attribute("data-outcome", "succeeded")
    expect(button).to_be_enabled()
    expect(result).to_contain_text(" m")

    def places() -> list[list[float]] | None:
        """In one moment: the next event opens it again."""
        seen: list[list[float] | None] = key.evaluate(LOCK)
        return [place for place in seen if place] if all(seen) else None

    inside, lock, told = until(places, "the lock and the result are shown")
    assert lock[1] <= told[0] + 1
    assert told[1] <= inside[1]


def test_a_label_that_is_its_icons_sign_is_drawn_once(cell: Server, page: Page) -> None:
    page.goto(cell.url)
    expect(widget(page, "down").locator(".face > .icon")).to_have_count(0)
    expect(widget(page, "down").locator(".face > .label")).to_have_text("−")
    expect(widget(page, "up").locator(".face > .icon")).to_have_count(1)


@pytest.mark.parametrize("size", SIZES)
def test_a_second_axis_has_its_numbers_on_the_right(
    cell: Server, page: Page, size: tuple[int, int]
) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.goto(cell.url)
    course = widget(page, "course")
    expect(course.locator(".right-values text").first).to_be_attached()
    area = place(course.locator(".area"))
    rects = course.locator(".right-values text").evaluate_all(RECTS)  # at once: they are drawn again
    assert rects
    for left, right in rects:
        assert left >= area["x"] + area["width"]
        assert right <= size[0]
