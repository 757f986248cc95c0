"""A trend as an operator uses it: Chromium, the real bridge, an rclpy node that publishes."""

import itertools
import math
import re
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, Response, Route, expect

from app.cell.view.trend import axis_range, value_ticks
from tests.support.browser.pages import HIDE, place
from tests.support.parts import ENOUGH_S, Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = [pytest.mark.long("detail"), pytest.mark.promise("history")]

PANEL = """
title = "Trends"
languages = ["en", "de"]

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "course"
kind = "trend"
label = "Air pressure"
window = "1m"
windows = ["10s", "10m"]
max_age_s = 60.0

[[page.widget.pen]]
topic = "/test_inlet"
type = "std_msgs/msg/Float64"
label = "Inlet"
unit = "bar"
low = 4.0
normal = [4.0, 6.0]
format = ".2f"

[[page.widget.pen]]
topic = "/test_joints"
type = "sensor_msgs/msg/JointState"
field = "position[1]"
label = "J2"

[[page]]
id = "two"
title = "Two"

[[page.widget]]
id = "plain"
kind = "label"
label = "Nothing"
"""
PEAK = 97.25
TREND = '[data-widget="course"]'


def receiving(bridge: Bridge, node: RosNode, folder: Path) -> Server:
    """A server that the robot's values have reached."""
    mine = live_server(bridge, folder, PANEL)

    def arrives() -> bool:
        says(node, 5.0)
        return bool(mine.widget("course")["state"] == "live")

    until(arrives, "the robot's values arrive", every_s=0.1)
    return mine


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.advertise("/test_inlet", "std_msgs/msg/Float64")
    node.advertise("/test_joints", "sensor_msgs/msg/JointState")
    with receiving(bridge, node, tmp_path_factory.mktemp("trends")) as mine:
        yield mine


def says(node: RosNode, value: float) -> None:
    node.publish("/test_inlet", {"data": value})
    joints = {"name": ["a", "b"], "position": [0.0, value / 2], "velocity": [], "effort": []}
    node.publish("/test_joints", joints)


def test_times_have_their_offset_where_the_clock_was_changed(cell: Server, page: Page) -> None:
    """The server says so; it judges the time of the plot."""

    def changed(route: Route) -> None:
        answer = route.fetch()
        route.fulfill(json={**answer.json(), "zone_s": 3600, "offset": "+01:00"})

    page.route("**/widgets/course/trend?*", changed)
    page.goto(cell.url)
    times = page.locator(f"{TREND} .times text")
    expect(times.first).to_have_text(re.compile(r"^\d\d:\d\d:\d\d \+01:00$"))
    page.locator(f"{TREND} .area").click()
    expect(page.locator(f"{TREND} .cursor-values b")).to_have_text(re.compile(r" \+01:00$"))
    page.unroute_all()


def highest(server: Server) -> float:
    trend = server.http.get("/widgets/course/trend", params={"span_s": 60}).json()
    return float(max(value for point in trend["pens"][0] if point for value in point[1:]))


def time_passes(server: Server, page: Page, seconds: float) -> None:
    """By the server's clock; the page's events are taken in the meantime."""

    def now() -> float:
        page.evaluate("0")
        trend = server.http.get("/widgets/course/trend", params={"span_s": 10, "points": 10}).json()
        return float(trend["now"])

    end = now() + seconds
    until(lambda: now() >= end, "time passes", every_s=0.1)


def line(page: Page, pen: int = 0) -> str:
    return page.locator(f"{TREND} .pens > .line").nth(pen).get_attribute("d") or ""


def is_drawn(page: Page) -> bool:
    return "L" in line(page)


def opened(page: Page, cell: Server) -> None:
    """The page with the trend, drawn by its script."""
    page.goto(cell.url)
    expect(page.locator('[data-do="pause"]')).to_be_enabled()


def key(page: Page, action: str) -> Any:
    return page.locator(f'[data-do="{action}"]')


def test_the_axis_and_the_values_have_the_decimal_sign_of_the_language(
    cell: Server, node: RosNode, chromium: Browser
) -> None:
    says(node, 4.25)
    says(node, 4.75)
    context = chromium.new_context()
    context.add_cookies([{"name": "kiosk_language", "value": "de", "url": cell.url}])
    page = context.new_page()
    opened(page, cell)
    expect(page.locator(f"{TREND} .pen-0 > b")).to_have_text("4,75 bar")
    page.locator(f"{TREND} .plot-marks").click(position={"x": 300, "y": 40})
    expect(page.locator(f"{TREND} .cursor-values")).to_be_visible()
    expect(page.locator(f"{TREND} .cursor-values")).not_to_contain_text(".")
    context.close()


@pytest.mark.long(None)
def test_every_sample_of_a_real_node_is_in_the_line_and_the_text(
    cell: Server, node: RosNode, page: Page
) -> None:
    """A single peak among many values is drawn, live, without a reload."""
    opened(page, cell)
    says(node, PEAK)
    for number in range(100):
        says(node, 5.0 + math.sin(number / 10))
    says(node, 4.5)
    expect(page.locator(f"{TREND} .pen-0 > b")).to_have_text("4.50 bar")
    expect(page.locator(f"{TREND} .pen-1 > b")).to_have_text("2.25")
    until(lambda: highest(cell) == PEAK, "the history has the peak")
    expect(page.locator(f"{TREND} .values text").last).to_have_text(re.compile("[89]0|100"))
    ys = [float(y) for y in re.findall(r"[ML][\d.-]+ ([\d.-]+)", line(page))]
    assert min(ys) < 100
    assert max(ys) > 850
    assert line(page, 1)


def test_a_value_beyond_its_limit_is_marked(cell: Server, node: RosNode, page: Page) -> None:
    opened(page, cell)
    says(node, 3.0)
    expect(page.locator(TREND)).to_have_attribute("data-state0", "low")
    says(node, 5.0)
    expect(page.locator(TREND)).to_have_attribute("data-state0", "live")


def test_a_pause_keeps_the_picture_while_the_server_goes_on(
    cell: Server, node: RosNode, page: Page
) -> None:
    opened(page, cell)
    says(node, 5.5)
    until(lambda: line(page), "a line is drawn")
    key(page, "pause").press("Enter")
    expect(page.locator(".paused")).to_have_text(re.compile(r"^Paused −00:00:\d\d$"))
    expect(key(page, "live")).to_be_focused()
    before, urls = line(page), []
    page.on("request", lambda request: urls.append(request.url))
    says(node, PEAK)
    expect(page.locator(f"{TREND} .pen-0 > b")).to_have_text("97.25 bar")
    expect(page.locator(".paused")).to_have_text(re.compile(r"−00:00:0[3-9]"))
    assert line(page) == before
    assert not [url for url in urls if "/trend?" in url]
    key(page, "live").click()
    expect(page.locator(".paused")).to_be_hidden()
    until(lambda: line(page) != before, "it follows again")
    expect(key(page, "pause")).to_be_visible()


def test_looking_back_and_zooming(cell: Server, node: RosNode, page: Page) -> None:
    opened(page, cell)
    says(node, 5.0)
    until(lambda: line(page), "a line is drawn")
    times = page.locator(f"{TREND} .times text")
    key(page, "back").click()
    expect(page.locator(".paused")).to_have_text(re.compile(r"−00:00:[23]\d"))
    key(page, "longer").click()
    expect(key(page, "longer")).to_be_disabled()
    expect(times.first).to_have_text(re.compile(r"^\d\d:\d\d$"))
    key(page, "shorter").click()
    key(page, "shorter").click()
    expect(key(page, "shorter")).to_be_disabled()
    expect(times.first).to_have_text(re.compile(r"^\d\d:\d\d:\d\d$"))
    for _ in range(12):
        if key(page, "forward").is_enabled():
            key(page, "forward").click()
    expect(page.locator(".paused")).to_be_hidden()


def test_a_touch_shows_the_values_at_a_time(cell: Server, node: RosNode, chromium: Browser) -> None:
    says(node, 5.0)
    context = chromium.new_context(viewport={"width": 1024, "height": 600}, has_touch=True)
    page = context.new_page()
    opened(page, cell)
    until(lambda: line(page), "a line is drawn")
    key(page, "pause").tap()
    x = re.findall(r"[ML]([\d.]+) ", line(page))[-1]
    box = place(page.locator(f"{TREND} .area"))
    at = box["x"] + float(x) / 1000 * box["width"]
    page.touchscreen.tap(at, box["y"] + box["height"] / 2)
    values = page.locator(".cursor-values")
    expect(values).to_be_visible()
    assert re.match(r"\d\d:\d\d:\d\dInlet.*bar", values.inner_text().replace("\n", ""))
    assert "J2" in values.inner_text()
    assert page.locator(f"{TREND} .cursor").get_attribute("visibility") == "visible"
    context.close()


def test_the_cursor_goes_by_keys(cell: Server, node: RosNode, page: Page) -> None:
    opened(page, cell)
    says(node, 5.0)
    until(lambda: line(page), "a line is drawn")
    page.locator(f"{TREND} .area").focus()
    page.keyboard.press("ArrowLeft")
    values = page.locator(".cursor-values")
    expect(values).to_be_visible()
    before = values.locator("b").inner_text()
    for _ in range(3):
        page.keyboard.press("ArrowLeft")
    until(lambda: values.locator("b").inner_text() < before, "the cursor is at an earlier time")
    page.keyboard.press("Escape")
    expect(values).to_be_hidden()


def test_reload_and_another_browser_show_the_same_history(
    cell: Server, node: RosNode, chromium: Browser
) -> None:
    """The history is the server's: two browsers have the same, and a reload loses nothing."""
    says(node, PEAK)
    says(node, 5.0)
    until(lambda: highest(cell) == PEAK, "the history has the peak")
    contexts = [chromium.new_context() for _ in range(2)]
    pages = [context.new_page() for context in contexts]
    for page in (*pages, pages[0]):
        opened(page, cell)
        until(partial(is_drawn, page), "a line is drawn")
        top = min(float(y) for y in re.findall(r"[ML][\d.]+ ([\d.-]+)", line(page)))
        assert top < 100, "the peak is drawn"
    for context in contexts:
        context.close()


def test_a_note_moves_nothing(cell: Server, page: Page) -> None:
    opened(page, cell)
    places = f"""[...document.querySelectorAll('{TREND}, {TREND} > *:not(p)')].map((one) => {{
      const at = one.getBoundingClientRect();
      return [at.top, at.height];
    }})"""
    before = page.evaluate(places)
    shown = f"""(() => {{
      const trend = document.querySelector('{TREND}');
      trend.dataset.state = "old";
      const notes = [...trend.querySelectorAll(".note, .fault-note")];
      for (const note of notes) note.textContent = "Inlet: 20 s old";
      return [notes.every((note) => note.checkVisibility()), {places}];
    }})()"""
    assert page.evaluate(shown) == [True, before]


def test_a_hidden_trend_is_not_requested(cell: Server, page: Page) -> None:
    urls: list[str] = []
    page.on("request", lambda request: urls.append(request.url))
    opened(page, cell)

    def count() -> int:
        page.evaluate("0")
        return len([url for url in urls if "/trend?" in url])

    until(lambda: count() >= 2, "it asks")
    page.evaluate(HIDE, True)
    before = count()
    time_passes(cell, page, 2.5)
    assert count() - before <= 1, "one may have been under way"
    page.evaluate(HIDE, False)
    until(lambda: count() > before + 1, "it asks again")
    page.goto(f"{cell.url}/pages/two")
    before = count()
    time_passes(cell, page, 1.5)
    assert count() == before


# How many ms after the response to one request for a trend the next one began.
PAUSES = """() => {
  const asked = performance.getEntriesByType("resource").filter(({ name }) => name.includes("/trend?"));
  return asked.slice(1).map(({ startTime }, i) => startTime - asked[i].responseEnd);
}"""
LEAST_PAUSE_MS = 499  # 500, and a clock that is rounded


def test_requests_are_at_most_two_a_second_and_small(cell: Server, page: Page) -> None:
    sizes: list[tuple[str, int]] = []

    def answered(response: Response) -> None:
        if "/trend?" in response.url:
            sizes.append((response.url, len(response.body())))

    page.on("response", answered)
    opened(page, cell)
    time_passes(cell, page, 3.0)
    until(lambda: page.evaluate(PAUSES) and len(sizes) >= 2, "it asks again")
    assert min(page.evaluate(PAUSES)) >= LEAST_PAUSE_MS
    assert "since=" not in sizes[0][0]
    assert all("since=" in url and size < 600 for url, size in sizes[1:])


@pytest.mark.long(None)
def test_a_lost_server_marks_values_as_old_and_keeps_the_picture(
    bridge: Bridge, node: RosNode, page: Page, tmp_path: Path
) -> None:
    with receiving(bridge, node, tmp_path) as mine:
        opened(page, mine)
        until(lambda: line(page), "a line is drawn")
        drawn = line(page)
    expect(page.locator(TREND)).to_have_attribute("data-state", "old", timeout=1000 * ENOUGH_S)
    decoration = "e => getComputedStyle(e).textDecorationStyle"
    assert page.locator(f"{TREND} .pen-0 > b").evaluate(decoration) == "dotted"
    assert line(page).count("L") >= drawn.count("L") - 1


# Extremes, equal neighbours, and values as robots have them.
DOUBLES = sorted(
    {
        sign * value
        for sign in (-1, 1)
        for value in (0.0, 5e-324, 1e-310, 2.3e-308, 1e-9, 0.1, 1.0, 97.25, 1e6, 1e15)
    }
    | {math.nextafter(1.0, 2.0), math.nextafter(97.25, 0.0), 1.7e308, -1.7e308, -sys.float_info.max}
)
AXES = """async ([module, ranges]) => {
  const { axisRange, valueTicks } = await import(module);
  return ranges.map(([low, high, fixedLow, fixedHigh]) => {
    const ends = axisRange(low, high, fixedLow ?? undefined, fixedHigh ?? undefined);
    const ticks = [];
    for (const [value] of valueTicks(...ends, 4)) if (ticks.push(value) > 20) break;
    return [...ends, ...ticks];
  });
}"""


def test_the_browser_draws_the_axes_of_the_server(cell: Server, page: Page) -> None:
    """Also for values at which an axis has no width, or more than a double can say."""
    page.goto(cell.url)
    script = page.locator('script[src$="main.js"]').get_attribute("src") or ""
    ends = [(low, high) for low, high in itertools.product(DOUBLES, DOUBLES) if low <= high]
    ranges = [
        (*pair, *fixed)
        for pair in ends
        for fixed in ((None, None), (0.0, None), (None, 5e-324), (-5.0, 5.0))
    ]
    module = script.replace("main.js", "trend/plot.js")
    for drawn, parameters in zip(page.evaluate(AXES, [module, ranges]), ranges, strict=True):
        low, high = axis_range(*parameters)
        expected = [low, high, *(value for value, _ in value_ticks(low, high))]
        assert drawn == pytest.approx(expected, rel=1e-12, abs=0.0), parameters


@pytest.mark.parametrize(
    "values", [(1.7e308, -1.7e308), (5e-324, 0.0, 1e-323), (1.0, math.nextafter(1.0, 2.0))]
)
@pytest.mark.usefixtures("cell")
def test_no_value_of_a_robot_takes_the_page(
    values: tuple[float, ...], bridge: Bridge, node: RosNode, page: Page, tmp_path: Path
) -> None:
    with receiving(bridge, node, tmp_path) as mine:
        for value in values:
            node.publish("/test_inlet", {"data": value})
        until(lambda: "5.00" not in mine.widget("course")["text0"], "they arrive")
        assert mine.http.get("/").status_code == 200
        opened(page, mine)
        until(lambda: is_drawn(page), "a line is drawn")
        assert page.locator(f"{TREND} .values text").count() >= 1
        assert "NaN" not in page.locator(f"{TREND} .plot").inner_html()
        node.publish("/test_inlet", {"data": 4.5})
        expect(page.locator(f"{TREND} .pen-0 > b")).to_have_text("4.50 bar")
