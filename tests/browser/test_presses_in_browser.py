"""How a press leaves the page: with its click, whatever made that, and before the page shows it."""

import csv
import io
import re
import time
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.support.browser.browsers import ReusedPage
from tests.support.browser.finger import Touch
from tests.support.browser.pages import asked, middle, place
from tests.support.parts import ROOT, TAP_AGAIN_MS, Server, until

pytestmark = pytest.mark.promise("offline")

# Each press as it leaves: in which event, how many buttons were busy by then, and how late the beat was
# that set the page's clock. Each pointer that goes down: when, and whether it could answer.
NOTE: Final = """
    window.left = [];
    window.opened = 0;
    window.downs = [];
    addEventListener("pointerdown", () => {
        const answers = document.querySelector("dialog:popover-open .yes:enabled") !== null;
        downs.push({ at: performance.now(), answers });
    }, true);
    window.late = null;
    window.EventSource = class extends EventSource {
        constructor(url) {
            super(url);
            let first = true;
            const beat = ({ data }) => {
                const ms = Date.now() - JSON.parse(data).now;
                late = first ? ms : Math.min(late, ms);
                first = false;
            };
            queueMicrotask(() => { // after the listeners of the page
                this.addEventListener("snapshot", () => (first = true));
                this.addEventListener("beat", beat);
            });
        }
    };
    window.WebSocket = class extends WebSocket {
        constructor(url) { super(url); this.addEventListener("open", () => opened++); }
    };
    const note = (by, text) => {
        const busy = document.querySelectorAll("[aria-busy]").length;
        left.push({ by, during: event?.type, busy, late, ...JSON.parse(text) });
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
DOUBLE_TAP_MS: Final = 150
SECOND_TAP_MS: Final = 700  # as the page's scripts have it
ROUNDED_MS: Final = 5  # whole milliseconds, and a tenth with each heartbeat
MADE_BY: Final = ("mouse", "finger", "Enter", "Space", *PROGRAMS)


@pytest.fixture(scope="module")
def reused_page(chromium: Browser) -> Iterator[ReusedPage]:
    """Its pages note what leaves."""
    mine = ReusedPage(chromium, NOTE)
    yield mine
    mine.close()


@pytest.fixture
def shown(demo: Server, page: Page) -> Page:
    """Its page."""
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
        touch = Touch(page)
        touch.send("touchStart", middle(publish(page)))
        touch.send("touchEnd")
    elif by in PROGRAMS:
        publish(page).evaluate(PROGRAMS[by])
    else:
        publish(page).press(by)


def receipt(page: Page) -> Any:
    return page.locator("#receipt-operation")


def test_a_press_leaves_once_within_its_event_and_then_shows(shown: Page, way: str) -> None:
    """Whatever made it, one after the other."""
    if way == "post":
        shown.route("**/press-socket.js", lambda route: route.abort())
    else:
        shown.locator("header h1").click()
        shown.wait_for_function("() => opened")
    for by in MADE_BY:
        shown.get_by_label("Message").fill(by)
        shown.evaluate("() => { left = []; }")
        receipt(shown).evaluate("(before) => { before.textContent = ''; }")
        began = shown.evaluate("Date.now()")
        make(shown, by)
        shown.wait_for_function("() => left.length")
        expect(receipt(shown)).to_contain_text("Sent at")
        expect(publish(shown)).not_to_have_attribute("aria-busy", "true")
        (press,) = shown.evaluate("left")
        assert press["by"] == way, by
        assert press["during"] == ("submit" if by == "submit" else "click"), by
        assert press["busy"] == 0, by
        assert press["inputs"] == {"message": by}
        assert re.fullmatch("[0-9a-f]{32}", press["id"]), by
        assert re.fullmatch(r"[0-9a-z]+-\d+", press["seen"]), by
        at = datetime.fromisoformat(press["at"]).timestamp() * 1000
        assert began - press["late"] - ROUNDED_MS < at < shown.evaluate("Date.now()"), by


@pytest.mark.long("detail")
def test_each_press_has_its_own_id(shown: Page) -> None:
    for number, by in enumerate(("mouse", "Enter", "mouse"), 1):
        make(shown, by)
        shown.wait_for_function("(number) => left.length === number", arg=number)
        expect(publish(shown)).not_to_have_attribute("aria-busy", "true")
    presses = shown.evaluate("left")
    assert len(presses) == len({press["id"] for press in presses}) == 3


@pytest.mark.parametrize("by", PROGRAMS)
def test_a_locked_button_is_pressed_by_no_program(shown: Page, by: str) -> None:
    publish(shown).evaluate("(button) => { button.disabled = true; }")
    make(shown, by)
    shown.evaluate("() => document.querySelector('form.page').requestSubmit()")
    publish(shown).evaluate("(button) => { button.disabled = false; }")
    publish(shown).press("Enter")
    expect(receipt(shown)).to_contain_text("Sent at")
    assert len(shown.evaluate("left")) == 1


def test_a_button_that_opens_under_a_resting_finger_is_not_pressed(shown: Page) -> None:
    shown.evaluate(
        "() => { window.clicks = 0;"
        " document.querySelector('form.page').addEventListener('click', () => clicks++); }"
    )
    publish(shown).evaluate("(button) => { button.disabled = true; }")
    publish(shown).hover(force=True)
    shown.mouse.down()
    publish(shown).evaluate("(button) => { button.disabled = false; }")
    shown.mouse.up()
    assert shown.evaluate("[clicks, left]") == [1, []]
    publish(shown).click()
    expect(receipt(shown)).to_contain_text("Sent at")
    assert len(shown.evaluate("left")) == 1


HEAD: Final = """
title = "Cell"
mode = "demo"
[[page]]
id = "main"
title = "Main"
"""
WIDE: Final = """
[[page.widget]]
id = "go{n}"
kind = "publish"
label = "Start {n}"
topic = "/operation{topic}"
type = "std_msgs/msg/String"
message = {{ data = "x" }}
confirm_press = {asks}
span = 12
"""


def many_buttons(folder: Path, asks: bool) -> Server:
    """So many that there is one wherever a dialog or another page has its own."""
    file = folder / "panel.toml"
    kind = str(asks).lower()
    topics = ("", "1", "2", "", "", "", "", "")
    file.write_text(
        HEAD + "".join(WIDE.format(n=n, topic=topic, asks=kind) for n, topic in enumerate(topics, 1))
    )
    return Server(ROOT, KIOSK_PANEL=str(file))


def logged(server: Server) -> list[dict[str, str]]:
    text = server.http.get("/log.csv?every=true").text.removeprefix("\ufeff")
    return list(csv.DictReader(io.StringIO(text)))


def pressed(server: Server) -> int:
    """How many presses are in the operator's log."""
    return sum(entry["kind"] == "pressed" for entry in logged(server))


def start(page: Page, number: int) -> Any:
    return page.get_by_role("button", name=f"Start {number}", exact=True)


def double_tap(page: Page, x: float, y: float) -> None:
    page.mouse.click(x, y)
    page.wait_for_timeout(DOUBLE_TAP_MS)
    page.mouse.click(x, y)
    page.wait_for_timeout(TAP_AGAIN_MS)


Opens = Callable[[Page, bool], Server]


@pytest.fixture
def opens(tmp_path: Path, servers: Callable[[Server], Server]) -> Opens:
    """Opens a page of many buttons that ask or do not, long enough ago to be read."""

    def opened(page: Page, asks: bool) -> Server:
        mine = servers(many_buttons(tmp_path, asks))
        until(mine.ready, "ready")
        page.goto(mine.url)
        page.wait_for_timeout(TAP_AGAIN_MS)
        return mine

    return opened


def test_a_key_that_is_held_down_is_one_press(opens: Opens, page: Page) -> None:
    mine = opens(page, False)
    expect(page.locator("html[data-floor]")).to_be_attached()
    start(page, 1).focus()
    for _ in range(60):  # two seconds of a keyboard's repeats
        page.keyboard.down("Enter")
        page.wait_for_timeout(33)
    page.keyboard.up("Enter")
    expect(start(page, 1)).not_to_have_attribute("aria-busy", "true")
    assert pressed(mine) == 1
    start(page, 1).press("Enter")
    until(lambda: pressed(mine) == 2, "a second press of the key is a second one")


def settled(page: Page) -> None:
    """What was tapped is over: the next tap is another one."""
    expect(page.locator("body:not([data-asks])")).to_be_attached()
    expect(page.locator("[aria-busy]")).to_have_count(0)


def came_together(page: Page) -> bool:
    """Whether the last tap came as soon after the one before it as a second tap does."""
    return bool(page.evaluate("downs.at(-1).at - downs.at(-2).at") < SECOND_TAP_MS)


def over_a_button(page: Page, answer: str) -> tuple[int, float, float]:
    """The number of a button whose question has its answer over another button, and where that is."""
    expect(page.locator("html[data-floor]")).to_be_attached()
    for number in range(1, 9):
        dialog = asked(start(page, number))
        x, y = middle(dialog.locator(answer))
        dialog.locator(".no").click()
        settled(page)
        below = "([x, y]) => document.elementFromPoint(x, y)?.closest('button') != null"
        if page.evaluate(below, [x, y]):
            return number, x, y
    raise AssertionError("no question has its answer over a button")


@pytest.mark.long("real time")
def test_the_second_tap_of_a_press_that_asks_is_no_answer(opens: Opens, page: Page) -> None:
    mine = opens(page, True)
    expect(page.locator("html[data-floor]")).to_be_attached()
    double_tap(page, *middle(start(page, 3)))
    dialog = page.get_by_role("dialog")
    expect(dialog).to_be_visible()
    assert pressed(mine) == 0
    dialog.locator(".yes").click()
    until(lambda: pressed(mine) == 1, "a tap that comes later is an answer")


@pytest.mark.parametrize(("answer", "presses"), [(".yes", 1), (".no", 0)])
def test_the_second_tap_of_an_answer_presses_nothing_below(
    opens: Opens, page: Page, answer: str, presses: int
) -> None:
    mine = opens(page, True)
    number, x, y = over_a_button(page, answer)
    dialog = page.get_by_role("dialog")

    def is_answered() -> bool:
        """Not where the machine stood still between the two taps."""
        before = pressed(mine)
        settled(page)
        start(page, number).click()
        expect(dialog.locator(".yes")).to_be_enabled()
        double_tap(page, x, y)
        until(lambda: pressed(mine) == before + presses, "the first tap is the answer")
        if came_together(page):
            return True
        if dialog.is_visible():  # the second tap was another press
            dialog.locator(".no").click()
        return False

    until(is_answered, "both taps come in time")
    expect(dialog).not_to_be_visible()
    settled(page)
    page.mouse.click(x, y)
    expect(dialog).to_be_visible()  # a later tap is a press


@pytest.mark.long("detail")
def test_a_question_comes_late_and_says_so_where_it_can_not_come(opens: Opens, page: Page) -> None:
    """Its script is loaded at the first touch: a press before that waits for it, and is not lost."""
    mine = opens(page, True)
    held: list[Route] = []
    lost: list[Route] = []
    page.route("**/ask.js", lambda route: held.append(route))
    expect(page.locator("html[data-floor]")).to_be_attached()
    start(page, 3).click()

    def is_asked_for() -> bool:
        page.wait_for_timeout(50)
        return bool(held)

    until(is_asked_for, "the script of questions is asked for")
    expect(page.get_by_role("dialog")).to_be_hidden()
    for route in held:
        route.continue_()
    page.unroute("**/ask.js")
    dialog = page.get_by_role("dialog")
    expect(dialog.locator(".yes")).to_be_enabled()
    dialog.locator(".yes").click()
    until(lambda: pressed(mine) == 1, "it is pressed")

    def lose(route: Route) -> None:
        lost.append(route)
        route.abort()

    page.route("**/ask.js", lose)
    page.reload()
    expect(page.locator("html[data-floor]")).to_be_attached()
    start(page, 3).click()
    expect(page.locator("#receipt-go3")).to_contain_text("Not sent")
    assert lost
    assert pressed(mine) == 1


def test_an_answer_that_opens_under_a_resting_finger_is_not_given(opens: Opens, page: Page) -> None:
    mine = opens(page, True)
    expect(page.locator("html[data-floor]")).to_be_attached()
    yes = page.get_by_role("dialog").locator(".yes")

    def rests() -> bool:
        """Not where the machine stood still until the answer was open."""
        settled(page)
        asked(start(page, 1))
        yes.hover(force=True)
        page.mouse.down()
        if not page.evaluate("downs.at(-1).answers"):
            return True
        page.mouse.up()
        return False

    until(rests, "the finger is down before the answer opens")
    before = pressed(mine)
    expect(yes).to_be_enabled()
    page.mouse.up()
    expect(yes).to_be_visible()
    yes.click()
    until(lambda: pressed(mine) == before + 1, "a tap on the open answer is one")


def forms_come_soon(page: Page, but: float = 0.0) -> None:
    """Forms come to the server as soon after their pages as a second tap does, however slow the machine
    is: those of all pages but the one that was rendered at this time."""

    def is_sent(route: Route) -> None:
        def since(match: re.Match[str]) -> str:
            return match[0] if float(match[1]) == but else f"_since={float(match[1]) + 60}"

        data = route.request.post_data or ""
        route.continue_(post_data=re.sub(r"\b_since=([\d.]+)", since, data))

    page.route("**/widgets/*", is_sent)


def rendered_at(page: Page) -> float:
    """When the server rendered the page; 0 for one that loaded itself."""
    values = page.locator("input[name=_since]").evaluate_all("(all) => all.map((one) => one.value)")
    return float(values[0]) if values else 0.0


def is_read(page: Page) -> bool:
    """Whether the page is so old that a tap on it is not the second tap of the one that brought it."""
    return time.time() - rendered_at(page) > TAP_AGAIN_MS / 1000


@pytest.mark.long("detail")
def test_without_scripts_too(opens: Opens, without_scripts: Page) -> None:
    page, mine = without_scripts, opens(without_scripts, True)
    start(page, 1).click()
    yes = place(page.locator(".yes"))
    x, y = yes["x"] + 5, yes["y"] + 5
    forms_come_soon(page)
    double_tap(page, x, y)  # the first one comes before anyone can have read the question
    expect(page.locator(".yes")).to_be_visible()
    assert pressed(mine) == 0
    page.unroute_all()
    until(lambda: is_read(page), "the question is read")
    page.mouse.click(x, y)
    until(lambda: pressed(mine) == 1, "a tap that comes later is an answer")


def test_without_scripts_a_double_tap_is_one_press_and_its_receipt_stays(
    opens: Opens, without_scripts: Page
) -> None:
    page, mine = without_scripts, opens(without_scripts, False)
    box = place(start(page, 1))

    def is_sent() -> bool:
        """Not where the machine stood still in between."""
        page.unroute_all()
        page.goto(mine.url)
        page.wait_for_timeout(TAP_AGAIN_MS)
        forms_come_soon(page, but=rendered_at(page))
        double_tap(page, box["x"] + 20, box["y"] + 20)
        return "Sent at" in page.locator("#receipt-go1").inner_text()

    until(is_sent, "it is sent")
    # The second tap is on the page that the first one brings, or still on that of the first one, whose
    # form is the same press again.
    sent, soon = r"Sent at [\d:]+\.", "Not sent: pressed so soon after the page.*"
    either = re.compile(f"^(Start 1: {sent} {soon}|{sent})$")
    expect(page.locator("#receipt-go1")).to_have_text(either)
    assert pressed(mine) == 1
    page.unroute_all()
    until(lambda: is_read(page), "the receipt is read")
    page.mouse.click(box["x"] + 20, box["y"] + 20)
    until(lambda: pressed(mine) == 2, "a later one is another press")


@pytest.mark.long("detail")
def test_a_form_that_comes_as_soon_as_its_page_says_so_and_loses_nothing(demo: Server) -> None:
    soon = {"_since": str(time.time() + 60), "message": "typed"}
    page = demo.http.post("/widgets/operation", data=soon, follow_redirects=True)
    assert "Not sent: pressed so soon after the page" in page.text
    assert 'value="typed"' in page.text
    before = page.url.params["receipt"]
    again = demo.http.post("/widgets/operation", data={**soon, "_last": before}, follow_redirects=True)
    assert again.text.count("Not sent: pressed so soon after the page") == 1
    entries = [entry for entry in logged(demo) if entry["press"] == before]
    assert [(entry["kind"], entry["outcome"]) for entry in entries] == [("refused", "refused")]


@pytest.mark.long("detail")
def test_without_scripts_a_page_that_loaded_itself_takes_a_press_at_once(
    opens: Opens, without_scripts: Page
) -> None:
    page, mine = without_scripts, opens(without_scripts, False)
    start(page, 1).click()
    expect(page.locator("#receipt-go1")).to_contain_text("Sent at")
    with page.expect_navigation(timeout=15_000):
        pass
    expect(page.locator("#receipt-go1")).to_contain_text("Sent at")
    assert page.locator("input[name=_since]").count() == 0
    start(page, 2).click()
    expect(page.locator("#receipt-go2")).to_contain_text("Sent at")
    assert pressed(mine) == 2


def test_error_of_a_gateway_is_not_shown_as_a_refusal(shown: Page) -> None:
    """The server may have sent it all the same."""

    def times_out(route: Route) -> None:
        route.fetch()
        route.fulfill(status=504, json={"message": "The upstream server is timing out"})

    shown.route("**/press-socket.js", lambda route: route.abort())
    shown.route("**/widgets/*", times_out)
    publish(shown).click()
    expect(receipt(shown)).to_have_attribute("data-outcome", "unknown")
    expect(receipt(shown)).to_contain_text("may or may not have been sent")
