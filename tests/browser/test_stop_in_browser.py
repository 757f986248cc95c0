"""Stop works with any number of fingers on the glass, beside a question, while the screen is cleaned,
and when it is dark."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.finger import Touch
from tests.support.browser.pages import comes, middle, place
from tests.support.browser.touch import MM_PER_PX, PANEL, SIZES, overlap, permit, settled, touched
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("stop")

STOP: Final = "[data-widget=stop] > button:not(.more)"
PAUSE: Final = """
[[frame.widget]]
id = "pause"
kind = "publish"
label = "Pause"
confirm_press = true
topic = "/operation2"
type = "std_msgs/msg/String"
message = { data = "pause" }

[[page]]
id = "setup"
"""
RESET: Final = """
[[page.group.widget]]
id = "reset"
kind = "publish"
role = "reset"
label = "Reset"
confirm_press = true
consequence = "Motors come on. The arm does not move."
topic = "/operation2"
type = "std_msgs/msg/String"
message = { data = "reset" }

[[page]]
id = "other"
"""
# How long it takes from a touch to the look of a pressed button.
FEELS: Final = """(button) => new Promise((resolve) => {
  let at = 0;
  addEventListener("pointerdown", (event) => (at = event.timeStamp), { capture: true, once: true });
  new MutationObserver(() => requestAnimationFrame(() => resolve(performance.now() - at)))
    .observe(button, { attributeFilter: ["data-down"] });
})"""


@contextmanager
def stop_server(folder: Path, above: str = "") -> Iterator[Server]:
    panel = PANEL.replace('\n[[page]]\nid = "other"\n', RESET) % above
    panel = panel.replace('\n[[page]]\nid = "setup"\n', PAUSE)
    with demo_server(folder, panel) as server:
        permit(server)
        yield server


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with stop_server(tmp_path_factory.mktemp("stop")) as server:
        yield server


@pytest.fixture
def page(touchscreen: Page, cell: Server) -> Page:
    return touched(touchscreen, cell)


def stops(server: Server) -> int:
    """How many presses of Stop were sent."""
    return server.process.text.count(" of stop by ")


def pressed(server: Server, before: int) -> None:
    until(lambda: stops(server) > before, "Stop is sent")
    assert stops(server) == before + 1


@pytest.mark.parametrize("fingers", [1, 4])
def test_stop_works_while_other_fingers_rest_on_the_glass(
    page: Page, cell: Server, fingers: int
) -> None:
    resting = [(640.0 + 40 * n, 300.0) for n in range(fingers)]
    touch, before = Touch(page), stops(cell)
    for n in range(fingers):
        touch.send("touchStart", *resting[: n + 1])
    stop = middle(page.locator(STOP))
    touch.send("touchStart", *resting, stop)
    touch.lift(fingers, stop)
    pressed(cell, before)
    for n in range(fingers):
        touch.lift(n, resting[n])
    pressed(cell, before)


def test_stop_works_while_a_finger_holds_the_robot(page: Page, cell: Server) -> None:
    touch, before = Touch(page), stops(cell)
    hold = middle(page.get_by_role("button", name="Left"))

    def held() -> bool:
        """Its script may not have been there at the first touch."""
        touch.send("touchStart", hold)
        if comes(page.locator("[data-widget=jog][data-hold=held]")):
            return True
        touch.send("touchEnd")
        return False

    until(held, "it is held")
    stop = middle(page.locator(STOP))
    touch.send("touchStart", hold, stop)
    touch.lift(1, stop)
    pressed(cell, before)
    touch.lift(0, hold)


def test_a_tap_is_one_press_and_a_finger_that_slides_off_none(page: Page, cell: Server) -> None:
    before = stops(cell)
    page.locator(STOP).tap()
    pressed(cell, before)
    expect(page.locator(f"{STOP}:not([aria-busy])")).to_be_attached()
    touch, (x, y) = Touch(page), middle(page.locator(STOP))
    touch.send("touchStart", (x, y))
    expect(page.locator(f"{STOP}[data-down]")).to_be_attached()
    touch.send("touchMove", (x + 300, y - 200))
    expect(page.locator(f"{STOP}[data-down]")).to_have_count(0)
    touch.send("touchEnd")
    page.locator(STOP).tap()
    pressed(cell, before + 1)


def test_cancelled_touch_presses_stop_only_if_the_finger_was_on_stop(page: Page, cell: Server) -> None:
    """A browser takes the pointers of all fingers away where one of them scrolls the page."""
    touch, (x, y), before = Touch(page), middle(page.locator(STOP)), stops(cell)
    touch.send("touchStart", (x, y))
    touch.send("touchMove", (x + 300, y - 200))
    touch.send("touchCancel")
    touch.send("touchStart", (x, y))
    touch.send("touchCancel")
    pressed(cell, before)


def test_keyboard_key_presses_stop_once(page: Page, cell: Server) -> None:
    before = stops(cell)
    page.locator(STOP).focus()
    page.keyboard.press(" ")
    pressed(cell, before)


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_a_question_stands_beside_its_button_and_stop_is_pressed_at_once(
    touchscreen: Page, cell: Server, size: tuple[int, int]
) -> None:
    page = touched(touchscreen, cell, size)
    before = stops(cell)
    page.get_by_role("button", name="Reset").tap()
    question = page.get_by_role("dialog", name="Reset")
    expect(question).to_contain_text("Motors come on. The arm does not move.")
    expect(question).to_be_in_viewport(ratio=1)
    expect(page.locator("[data-widget=reset][data-asked]")).to_be_attached()
    assert uncovered(page)
    page.locator(STOP).tap()
    pressed(cell, before)
    expect(question).to_be_hidden()  # another touch is "not now"


def uncovered(page: Page) -> bool:
    """Whether nothing lies over Stop."""
    script = "([x, y]) => document.elementFromPoint(x, y).closest('[data-widget=stop]') !== null"
    return bool(page.evaluate(script, list(middle(page.locator(STOP)))))


# Parts of the rail that are below something else.
COVERED: Final = """() => {
  const found = [];
  const parts = ".pages, .frame-keys, .frame-keys > .key > button:not(.more)";
  for (const part of document.querySelectorAll(parts)) {
    const { left, top, right, bottom } = part.getBoundingClientRect();
    for (const x of [left + 2, (left + right) / 2, right - 2]) {
      for (const y of [top + 2, (top + bottom) / 2, bottom - 2]) {
        const above = document.elementFromPoint(x, y);
        const isRail = above.closest(".pages, .frame-keys") && !above.closest(".ask");
        if (!isRail) found.push(above.className || above.tagName);
      }
    }
  }
  return found;
}"""


def opened_parts(page: Page) -> Iterator[tuple[str, str]]:
    """(what was touched, what has opened), one after the other."""
    for opener, sheet in (
        (".menu-key", "#menu"),
        (".lamps", "#links"),
        ("[data-widget=reset] > button:not(.more)", "dialog:popover-open"),
        ("[data-widget=pause] > button:not(.more)", "dialog:popover-open"),
        ("#input-speed", ".keypad"),
        ("#input-order", ".keyboard"),
        ("#input-belt", ".keypad"),
        ("#input-note", ".keyboard"),
    ):
        if not page.locator(opener).is_visible():
            page.locator(".group-tab", has_text="Belt").first.tap()
        page.locator(opener).tap()
        expect(page.locator(sheet)).to_be_visible()
        settled(page)
        yield opener, sheet
        if page.locator(".cancel-entry").count():
            page.locator(".cancel-entry").tap()
            settled(page)
        else:
            page.keyboard.press("Escape")
        expect(page.locator(sheet)).to_be_hidden()
        expect(page.locator("body[data-asks]")).to_have_count(0)


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_nothing_that_opens_reaches_the_rail_with_stop_in_its_lower_left_corner(
    touchscreen: Page, cell: Server, size: tuple[int, int]
) -> None:
    page = touched(touchscreen, cell, size)
    stop = place(page.locator("[data-widget=stop]"))
    assert stop["x"] < 12
    assert stop["height"] >= 20 / MM_PER_PX - 0.5
    keys = place(page.locator(".frame-keys"))
    assert keys["y"] + keys["height"] == size[1]
    for opener, sheet in opened_parts(page):
        assert page.evaluate(COVERED) == [], opener
        assert not overlap(page, sheet, ".frame-keys"), opener


def test_a_double_tap_of_a_frame_key_asks_once(page: Page, cell: Server) -> None:
    page.locator("[data-widget=pause] > button:not(.more)").dblclick()
    question = page.get_by_role("dialog", name="Pause")
    expect(question).to_be_visible()
    expect(page.locator("[data-widget=pause] .receipt")).to_be_empty()
    question.locator(".no").click()
    expect(question).to_be_hidden()


def test_the_question_presses_with_yes_only(page: Page, cell: Server) -> None:
    def resets() -> int:
        return cell.process.text.count(" of reset by ")

    before = resets()
    reset, question = page.get_by_role("button", name="Reset"), page.get_by_role("dialog", name="Reset")
    reset.tap()
    question.get_by_role("button", name="Cancel").or_(question.locator(".no")).first.tap()
    expect(question).to_be_hidden()
    expect(page.locator("body[data-asks]")).to_have_count(0)
    reset.tap()
    question.locator(".yes").tap()
    until(lambda: resets() == before + 1, "it is sent")
    expect(question).to_be_hidden()
    expect(page.locator("body[data-asks]")).to_have_count(0)
    reset.focus()
    page.keyboard.press(" ")
    expect(question).to_be_visible()
    page.keyboard.press("Escape")
    expect(question).to_be_hidden()
    expect(reset).to_be_focused()
    assert resets() == before + 1


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_stop_stays_uncovered_and_works_during_cleaning(
    touchscreen: Page, cell: Server, size: tuple[int, int]
) -> None:
    page = touched(touchscreen, cell, size)
    before = stops(cell)
    page.get_by_role("button", name="Menu").tap()
    page.get_by_role("button", name="Clean the screen").tap()
    expect(page.locator("#cleaning")).to_be_visible()
    expect(page.locator("#cleaning")).to_contain_text("Only Stop works")
    expect(page.locator("#cleaning")).to_contain_text("or when the button below is held")
    assert uncovered(page)
    page.touchscreen.tap(*middle(page.locator(STOP)))
    pressed(cell, before)
    expect(page.locator("#cleaning")).to_be_visible()


@pytest.mark.long("detail")
def test_cleaning_ends_when_its_button_is_held(page: Page, cell: Server) -> None:
    page.get_by_role("button", name="Menu").tap()
    page.get_by_role("button", name="Clean the screen").tap()
    end = page.locator(".end-cleaning")
    expect(end).to_be_visible()
    end.tap()  # too short
    expect(page.locator("#cleaning")).to_be_visible()
    touch = Touch(page)
    touch.send("touchStart", middle(end))
    expect(page.locator("#cleaning")).to_be_hidden()
    touch.send("touchEnd")


def test_the_first_touch_on_a_dark_page_stops(touchscreen: Page, tmp_path: Path) -> None:
    with stop_server(tmp_path, "\n[screen]\ndim_after_s = 2") as cell:
        page = touched(touchscreen, cell)
        before = stops(cell)
        expect(page.locator("#dark")).to_be_visible()
        assert uncovered(page)
        page.touchscreen.tap(*middle(page.locator(STOP)))
        pressed(cell, before)
        expect(page.locator("#dark")).to_be_hidden()


@pytest.mark.long("real time")
def test_a_touch_is_seen_within_50_ms(page: Page, cell: Server) -> None:
    load = page.locator("[data-widget=load] > button:not(.more)")
    touch = Touch(page)

    def felt() -> Any:
        load.evaluate(f"(button) => void (window.felt = ({FEELS})(button))")
        touch.send("touchStart", middle(load))
        took = page.evaluate("window.felt")
        touch.send("touchCancel")
        expect(page.locator("[data-widget=load] > button:not(.more)[data-down]")).to_have_count(0)
        return took

    assert sorted(felt() for _ in range(5))[2] < 50
