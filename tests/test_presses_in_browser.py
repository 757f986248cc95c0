"""How a press leaves the page: with its click, whoever made that, and before the page shows it."""

import re
from collections.abc import Iterator
from datetime import datetime
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from tests.parts import ROOT, Server, until

# Each press as it leaves: in which event, and how many buttons were busy by then.
NOTE: Final = """
    window.left = [];
    const note = (by, text) => {
        const busy = document.querySelectorAll("[aria-busy]").length;
        left.push({ by, during: event?.type, busy, ...JSON.parse(text) });
    };
    const send = WebSocket.prototype.send;
    WebSocket.prototype.send = function (text) { note("socket", text); send.call(this, text); };
    const real = fetch;
    fetch = (url, options) => {
        if (options?.method === "POST") note("post", options.body);
        return real(url, options);
    };
"""
CLICK: Final = "new MouseEvent('click', { bubbles: true, cancelable: true })"
# Of a program on the page or beside it, such as one that reads the screen.
PROGRAMS: Final = {
    "click": "(button) => button.click()",
    "dispatched click": f"(button) => button.dispatchEvent({CLICK})",
    "submit": "(button) => button.form.requestSubmit(button)",
}
MADE_BY: Final = ("mouse", "finger", "Enter", "Space", *PROGRAMS)


@pytest.fixture(scope="module")
def demo() -> Iterator[Server]:
    mine = Server(ROOT)
    until(mine.ready, "ready")
    yield mine
    mine.end()


@pytest.fixture
def shown(demo: Server, page: Page) -> Page:
    """Its page, that notes what leaves."""
    page.add_init_script(NOTE)
    page.goto(demo.url)
    expect(publish(page)).to_be_enabled()
    page.wait_for_function("() => document.querySelector('#clock').textContent")
    page.get_by_label("Message").fill("once")
    return page


def publish(page: Page) -> Any:
    return page.get_by_role("button", name="Publish", exact=True)


def make(page: Page, by: str) -> None:
    if by == "mouse":
        publish(page).click()
    elif by == "finger":
        box = publish(page).bounding_box()
        session = page.context.new_cdp_session(page)
        where = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [where]})
        session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    elif by in PROGRAMS:
        publish(page).evaluate(PROGRAMS[by])
    else:
        publish(page).press(by)


def receipt(page: Page) -> Any:
    return page.locator("#receipt-operation")


@pytest.mark.parametrize("by", MADE_BY)
def test_a_press_leaves_once_within_its_event_and_then_shows(shown: Page, by: str, way: str) -> None:
    if way == "post":
        shown.route("**/line.js", lambda route: route.abort())
    else:
        with shown.expect_websocket():
            shown.get_by_role("heading", name="Operation", exact=True).click()
        shown.wait_for_timeout(300)  # it is open
    began = shown.evaluate("Date.now()")
    make(shown, by)
    shown.wait_for_function("() => left.length")
    expect(receipt(shown)).to_contain_text("Sent on /operation at", timeout=10_000)
    (press,) = shown.evaluate("left")
    assert press["by"] == way
    assert press["during"] == ("submit" if by == "submit" else "click")
    assert press["busy"] == 0
    assert press["inputs"] == {"message": "once"}
    assert re.fullmatch("[0-9a-f]{32}", press["id"])
    assert re.fullmatch(r"[0-9a-z]+-\d+", press["seen"])
    at = datetime.fromisoformat(press["at"]).timestamp() * 1000
    assert began - 100 < at < shown.evaluate("Date.now()")


def test_each_press_has_an_id_of_its_own(shown: Page) -> None:
    for button in ("Publish", "Publish1", "Publish2"):
        one = shown.get_by_role("button", name=button, exact=True)
        expect(one).to_be_enabled()
        one.click()
    expect(publish(shown)).not_to_have_attribute("aria-busy", "true")
    publish(shown).press("Enter")
    presses = shown.evaluate("left")
    assert len(presses) == len({press["id"] for press in presses}) == 4


@pytest.mark.parametrize("by", PROGRAMS)
def test_a_locked_button_is_pressed_by_no_program(shown: Page, by: str) -> None:
    publish(shown).evaluate("(button) => { button.disabled = true; }")
    make(shown, by)
    shown.evaluate("() => document.querySelector('main form').requestSubmit()")
    publish(shown).evaluate("(button) => { button.disabled = false; }")
    publish(shown).press("Enter")
    expect(receipt(shown)).to_contain_text("Sent on /operation at")
    assert len(shown.evaluate("left")) == 1


def test_a_button_that_opens_under_a_resting_finger_is_not_pressed(shown: Page) -> None:
    shown.evaluate(
        "() => { window.clicks = 0;"
        " document.querySelector('main form').addEventListener('click', () => clicks++); }"
    )
    publish(shown).evaluate("(button) => { button.disabled = true; }")
    publish(shown).hover(force=True)
    shown.mouse.down()
    publish(shown).evaluate("(button) => { button.disabled = false; }")
    shown.mouse.up()
    assert shown.evaluate("[clicks, left]") == [1, []]
    publish(shown).click()
    expect(receipt(shown)).to_contain_text("Sent on /operation at")
    assert len(shown.evaluate("left")) == 1


def test_where_the_script_did_not_come_a_press_is_a_form(demo: Server, page: Page) -> None:
    page.route("**/press.js", lambda route: route.abort())
    page.goto(demo.url)
    expect(publish(page)).to_be_enabled()
    page.get_by_label("Message").fill("by form")
    with page.expect_navigation():
        publish(page).click()
    expect(receipt(page)).to_contain_text("Sent on /operation at")
    expect(page.get_by_label("Message")).to_have_value("by form")
    until(lambda: "by form" in demo.widget("last_heard")["text"], "the robot has it")
