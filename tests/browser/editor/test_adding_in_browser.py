"""The panes "Robot" and "Parts" with a mouse and a keyboard."""

import json
import tomllib
from collections.abc import Callable, Iterator
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from app.tools.editor.forms import element_id
from tests.browser.editor.test_editor_in_browser import opened
from tests.browser.test_accessibility import ALL, AXE, RUN
from tests.support.browser.browsers import ReusedPage
from tests.support.editor import PANEL, EditorServer, box_of, drag_line, editing, middle, preview
from tests.support.parts import until

GUARDED: Final = (
    PANEL
    + """
[[page.widget]]
id = "guard"
kind = "indicator"
label = "Guard"
topic = "/guard_locked"
type = "std_msgs/msg/Bool"
states = [
  { value = true, text = "Locked", shape = "circle" },
  { value = false, text = "Open", shape = "cross", colour = "red" },
]
"""
)


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[EditorServer]:
    with editing(tmp_path_factory.mktemp("adding"), GUARDED) as mine:
        yield mine


@pytest.fixture(scope="module")
def reused_page(chromium: Browser) -> Iterator[ReusedPage]:
    """Axe may be added to its pages."""
    mine = ReusedPage(chromium, bypass_csp=True)
    yield mine
    mine.close()


@pytest.fixture
def desk(page: Page, running: EditorServer) -> Page:
    running.edit({"op": "text", "path": [], "text": GUARDED}).raise_for_status()
    page.set_viewport_size({"width": 1440, "height": 900})
    return opened(page, running)


def written(editor: EditorServer) -> dict[str, Any]:
    return tomllib.loads(editor.http.get("/text").text)


def belt(editor: EditorServer) -> list[dict[str, Any]]:
    """The widgets of the first group."""
    widgets: list[dict[str, Any]] = written(editor)["page"][0]["group"][0]["widget"]
    return widgets


def wait(page: Page, is_so: Callable[[], Any], about: str) -> None:
    """Until something is so, while Playwright's events are read."""
    until(lambda: page.evaluate("0") or is_so(), about)


def item(page: Page, tab: str, name: str) -> Any:
    """The line of a pane with this name."""
    page.locator(f"#tab-{tab}").click()
    line = page.locator("#left .offer").filter(has=page.locator(f"b:text-is('{name}')"))
    expect(line).to_be_visible()
    return line


def test_the_list_shows_live_values_and_where_they_are_used(desk: Page) -> None:
    line = item(desk, "robot", "/speed")
    expect(line.locator("small").first).to_contain_text("Float64")
    expect(line.locator(".used")).to_have_text("Cell")
    wait(desk, lambda: line.locator(".value").inner_text(), "the value of /speed")


def test_a_topic_dropped_on_the_page_is_shown_as_chosen(desk: Page, running: EditorServer) -> None:
    x, y = middle(box_of(desk, "#at-ready"))
    drag_line(desk, item(desk, "robot", "/load"), x, y + 10)
    picks = desk.locator(".ways button")
    expect(picks.first).to_be_focused()
    titles = picks.locator("b").all_inner_texts()
    assert "Trend" in titles
    picks.filter(has_text="Trend").click()
    until(
        lambda: desk.evaluate("0") or len(written(running)["page"][0]["group"][0]["widget"]) == 3,
        "added",
    )
    group = written(running)["page"][0]["group"][0]["widget"]
    trend = next(widget for widget in group if widget["kind"] == "trend")
    assert trend["pen"][0]["topic"] == "/load"
    expect(preview(desk).locator(f"#at-{trend['id']}")).to_be_visible()


def test_a_permission_dropped_on_a_button_locks_it(desk: Page, running: EditorServer) -> None:
    drag_line(desk, item(desk, "robot", "/guard_locked"), *middle(box_of(desk, "#at-open")))
    first = desk.locator(".ways button").first
    expect(first.locator("b")).to_have_text("Interlock")
    first.press("Enter")
    wait(desk, lambda: "interlock" in written(running), "the interlock is written")
    tables = written(running)
    (interlock,) = tables["interlock"]
    assert interlock["topic"] == "/guard_locked"
    assert tables["page"][0]["group"][1]["widget"][0]["interlock"] == interlock["id"]
    desk.locator("#undo").click()
    wait(desk, lambda: "interlock" not in written(running), "one step is undone")


def test_by_keys_alone_a_part_is_added_behind_the_selected(desk: Page, running: EditorServer) -> None:
    desk.mouse.click(*middle(box_of(desk, "#at-speed")))
    line = item(desk, "parts", "Text")
    line.press("Enter")
    until(
        lambda: (
            desk.evaluate("0")
            or written(running)["page"][0]["group"][0]["widget"][1]["kind"] == "label"
        ),
        "the text is added",
    )
    label = written(running)["page"][0]["group"][0]["widget"][1]
    assert label == {"id": "label", "kind": "label", "label": "Text"}
    expect(preview(desk).locator("#at-label")).to_be_visible()


BELT: Final = ["page", 0, "group", 0]


@pytest.mark.parametrize(
    ("name", "path", "key", "is_placed"),
    [
        ("Page", ["page", 2], "title", False),
        ("Interlock", ["interlock", 0], "topic", False),
        ("Condition", ["condition", 0], "topic", False),
        ("Alarm", ["alarm", 0], "topic", False),
        ("Source", ["source", 0], "topic", False),
        ("Group", ["page", 0, "group", 0], "title", True),
        ("Gauge", [*BELT, "widget", 1], "topic", True),
    ],
)
def test_a_dropped_part_is_made_and_its_form_asks_for_what_it_needs(
    desk: Page, running: EditorServer, name: str, path: list[Any], key: str, is_placed: bool
) -> None:
    line = item(desk, "parts", name)
    line.scroll_into_view_if_needed()
    grip = line.bounding_box()
    speed = box_of(desk, "#at-speed")
    assert grip is not None
    desk.mouse.move(grip["x"] + 60, grip["y"] + 12)
    desk.mouse.down()
    desk.mouse.move(speed["x"] + speed["width"] * 0.8, speed["y"] + 20, steps=5)
    expect(desk.locator(".ghost")).to_have_text(name)
    expect(desk.locator(".drop")).to_have_count(1 if is_placed else 0)
    desk.mouse.up()
    expect(desk.locator(f"[id='{element_id(tuple(path))}.{key}']")).to_be_focused()
    made: Any = written(running)
    for step in path:
        made = made[step]
    assert made
    desk.locator("#tab-outline").click()
    expect(desk.locator(".tr[aria-selected='true']")).to_have_attribute("data-path", json.dumps(path))
    desk.locator("#undo").click()
    wait(desk, lambda: running.state()["faults"] == 0, "one step is undone")


def test_a_part_fills_the_empty_cell_that_was_selected(desk: Page, running: EditorServer) -> None:
    """Of three columns the first is two rows high, and the second has something in both."""
    own = [[*BELT, "widget", number] for number in range(4)]
    speed = belt(running)[0]
    both = [speed | {"id": name, "span": 4} for name in ("over", "beside")]
    running.edit(
        {"op": "set", "path": [*own[0], "span"], "value": 4},
        {"op": "set", "path": [*own[0], "rows"], "value": 2},
        {"op": "set", "path": [*own[1], "span"], "value": 4},
        *({"op": "insert", "path": own[2 + at], "value": table} for at, table in enumerate(both)),
    ).raise_for_status()
    expect(preview(desk).locator("#at-beside")).to_be_visible()
    over, beside = box_of(desk, "#at-over"), box_of(desk, "#at-beside")

    def is_chosen() -> bool:
        """Before the editor knows of the edit, the empty place there is two rows high."""
        desk.mouse.click(middle(over)[0], middle(beside)[1])
        ring = desk.locator(".ring.chosen").bounding_box()
        return ring is not None and ring["height"] == pytest.approx(beside["height"], abs=8)

    wait(desk, is_chosen, "the empty cell is selected")
    expect(desk.locator(".ring.chosen .tag")).to_have_text("Empty place")
    item(desk, "parts", "Text").press("Enter")
    wait(desk, lambda: len(belt(running)) == 5, "the text is added")
    assert belt(running)[4] == {"id": "label", "kind": "label", "label": "Text", "span": 4}
    made = box_of(desk, "#at-label")
    assert made["x"] == pytest.approx(over["x"], abs=1)
    assert made["y"] == pytest.approx(beside["y"], abs=1)


def test_words_filter_the_list_and_escape_adds_nothing(desk: Page, running: EditorServer) -> None:
    item(desk, "robot", "/load")
    before = written(running)
    desk.locator(".left input[name='find']").fill("float load")
    expect(desk.locator(".offer:visible")).to_have_count(1)
    line = desk.locator(".offer:visible")
    line.press("Enter")
    expect(desk.locator(".ways")).to_be_visible()
    desk.keyboard.press("Escape")
    expect(line).to_be_focused()
    assert written(running) == before


def test_words_of_a_search_stay_in_their_pane(desk: Page) -> None:
    desk.locator("#tab-parts").click()
    desk.get_by_placeholder("Name of a part").fill("alarm")
    expect(desk.locator(".offer:visible")).to_have_count(3)
    desk.locator("#tab-robot").click()
    expect(desk.get_by_placeholder("Name, type or node")).to_have_value("")
    expect(desk.locator(".offer:visible").filter(has_text="/speed")).to_have_count(1)


def test_escape_finds_the_line_in_a_list_that_came_again_meanwhile(desk: Page) -> None:
    line = item(desk, "robot", "/load")
    line.press("Enter")
    expect(desk.locator(".ways")).to_be_visible()
    shown = line.element_handle()
    desk.route("**/robot", lambda route: route.fulfill(json={"values": {}, "rows": -1}))
    wait(desk, lambda: not shown.evaluate("line => line.isConnected"), "the list comes again")
    desk.keyboard.press("Escape")
    expect(line).to_be_focused()


def test_the_robots_values_leave_the_pane_that_was_chosen_meanwhile(desk: Page) -> None:
    item(desk, "robot", "/load")
    held: list[Route] = []
    desk.route("**/robot", lambda route: held.append(route))
    wait(desk, lambda: held, "the values are asked for")
    item(desk, "parts", "Gauge")
    fragments: list[str] = []
    desk.on("request", lambda request: fragments.append(request.url))
    with desk.expect_request_finished(lambda request: request.url.endswith("/robot")):
        held[0].fulfill(json={"values": {}, "rows": -1})
    desk.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert not [url for url in fragments if "/parts/robot" in url]


@pytest.mark.parametrize("tab", ["robot", "parts"])
def test_the_panes_have_no_fault_of_accessibility(desk: Page, tab: str) -> None:
    item(desk, tab, "/speed" if tab == "robot" else "Gauge")
    desk.evaluate(AXE)
    run = RUN.replace("document,", "{exclude: ['iframe']},")
    assert desk.evaluate(run, {"values": ALL, "type": "tag"}) == []
