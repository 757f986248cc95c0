"""What an operator sees and touches: Debian's Chromium, on the real bridge or the demo robot."""

import re
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import closing
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, Request, Route, expect

from app.system.printable import printable
from tests.support import holds
from tests.support.browser.pages import HIDE, place
from tests.support.parts import (
    REFERENCE,
    ROOT,
    SHIPPED,
    TAP_AGAIN_MS,
    Bridge,
    RosNode,
    Server,
    arrives,
    has_heard,
    live,
    publish_until,
    until,
)
from tests.support.samples import TEXTS
from tests.support.servers import ready

pytestmark = [pytest.mark.long("detail"), pytest.mark.promise("offline")]

SIZES = [(1280, 800), (1024, 600)]
NO_SERVER = "No connection to the panel server"
TELL_WHEN_LOCKED = """() => new MutationObserver(() => window.lockedAt ??= Date.now()).observe(
    document.querySelector('[data-lamp="server"]'), { attributes: true },
)"""
LATE_S = 1.0  # by which a busy machine runs a page's timer late


def button(page: Page, name: str) -> Any:
    return page.get_by_role("button", name=name, exact=True)


def why(page: Page, widget: str) -> Any:
    return page.locator(f"#why-{widget}")


@pytest.fixture(scope="module")
def node(node: RosNode) -> Iterator[RosNode]:
    """The robot, which says whether it permits and what it heard last."""
    topics = {"/operation_enabled": "std_msgs/msg/Bool", "/last_heard": "std_msgs/msg/String"}
    for topic, type_name in topics.items():
        node.advertise(topic, type_name)
    yield node
    for topic in topics:
        node.withdraw(topic)


def permit(server: Server, node: RosNode, value: bool) -> None:
    holds.permit(server, node, value, widget="operation1")


@pytest.fixture
def shipped(bridge: Bridge, node: RosNode, tmp_path: Path) -> Iterator[Server]:
    """A server with the shipped panel, on the shared bridge."""
    mine = live(bridge.endpoint, tmp_path, KIOSK_PANEL=str(SHIPPED))
    yield mine
    mine.end()


@pytest.mark.long(None)
def test_the_main_job(shipped: Server, node: RosNode, page: Page) -> None:
    page.goto(f"{shipped.url}/pages/operation")
    expect(button(page, "Publish1")).to_be_disabled()
    expect(why(page, "operation1")).to_contain_text("is not known yet")
    permit(shipped, node, True)
    expect(button(page, "Publish1")).to_be_enabled()
    expect(button(page, "Publish2")).to_be_enabled()
    before = len(node.heard("/operation1"))
    page.get_by_label("Message").fill("pick up")
    button(page, "Publish1").click()
    expect(page.locator("#receipt-operation1")).to_contain_text("Sent at")
    until(lambda: node.heard_data("/operation1")[before:] == ["pick up"], "the robot has it")
    permit(shipped, node, False)
    for name, widget in (("Publish1", "operation1"), ("Publish2", "operation2")):
        expect(button(page, name)).to_be_disabled()
        expect(button(page, name)).to_have_css("background-color", "rgb(169, 169, 169)")
        expect(button(page, name)).to_have_css("cursor", "not-allowed")
        expect(why(page, widget)).to_contain_text("The robot does not permit operation")
        expect(why(page, widget)).to_be_visible()
        described = button(page, name).get_attribute("aria-describedby") or ""
        assert f"why-{widget}" in described.split()
    expect(button(page, "Publish")).to_be_enabled()
    permit(shipped, node, True)
    expect(button(page, "Publish1")).to_be_enabled()


# What some readers take for the end of a line; in a text of the robot's it is part of it.
SEPARATED = "one \x85 two \u2028 three \u2029 four"
EVENTS = "**/events?page=*"
EVENT_STREAM: Final = "text/event-stream"


def say(node: RosNode, server: Server, text: str) -> None:
    def is_known() -> bool:
        return bool(server.widget("last_heard")["text"] == printable(text))

    publish_until(node, "/last_heard", {"data": text}, is_known)


def test_a_text_with_line_separators_keeps_no_button_open(
    server: Server, node: RosNode, page: Page
) -> None:
    permit(server, node, True)
    page.goto(server.url)
    expect(button(page, "Publish1")).to_be_enabled()
    say(node, server, SEPARATED)
    expect(page.locator('[data-widget="last_heard"] .value')).to_contain_text("four")
    permit(server, node, False)
    expect(button(page, "Publish1")).to_be_disabled()
    expect(why(page, "operation1")).to_contain_text("The robot does not permit operation")


@pytest.mark.parametrize(
    ("status", "content_type", "body"),
    [
        (503, "text/plain", "busy"),
        (200, "text/html", "<h1>Sign in</h1>"),
        (200, EVENT_STREAM, ""),
        (200, EVENT_STREAM, 'event: update\ndata: {"operation": {"enabled": true}}\n\n'),
    ],
    ids=["refused", "no stream", "nothing", "no snapshot"],
)
def test_an_answer_without_a_snapshot_opens_nothing_and_the_page_asks_again(
    server: Server, page: Page, status: int, content_type: str, body: str
) -> None:
    opens_nothing(server, page, status=status, content_type=content_type, body=body)


def test_half_a_snapshot_opens_nothing_and_the_page_asks_again(
    server: Server, chromium: Browser
) -> None:
    """The page reports it on its console, which fails a shared page."""
    body = "event: snapshot\ndata: {\n\n"
    with closing(chromium.new_context()) as context:
        opens_nothing(server, context.new_page(), status=200, content_type=EVENT_STREAM, body=body)


def opens_nothing(server: Server, page: Page, **answer: Any) -> None:
    page.goto(server.url)
    expect(button(page, "Publish")).to_be_enabled()
    page.evaluate(HIDE, True)
    page.route(EVENTS, lambda route: route.fulfill(**answer))
    with page.expect_request_finished(lambda request: "/events?" in request.url):
        page.evaluate(HIDE, False)
    with page.expect_request(EVENTS):
        expect(button(page, "Publish")).to_be_disabled()
        expect(why(page, "operation")).to_contain_text(NO_SERVER)
    page.unroute(EVENTS)
    expect(button(page, "Publish")).to_be_enabled()


@pytest.mark.long(None)
def test_every_text_arrives_intact(server: Server, node: RosNode, page: Page) -> None:
    page.goto(server.url)
    expect(button(page, "Publish")).to_be_enabled()
    before = len(node.heard("/operation"))
    for number, text in enumerate(TEXTS):
        page.get_by_label("Message").fill(text)
        expect(button(page, "Publish")).not_to_have_attribute("aria-busy", "true")
        button(page, "Publish").click()
        heard = before + number + 1
        until(partial(has_heard, node, "/operation", heard), f"heard {text!r}")
    assert node.heard_data("/operation")[before:] == TEXTS


def test_a_reload_shows_the_true_state_before_any_script(
    server: Server, node: RosNode, without_scripts: Page
) -> None:
    until(server.ready, "ready")
    permit(server, node, True)
    page = without_scripts
    page.goto(server.url)
    expect(button(page, "Publish1")).to_be_enabled()
    permit(server, node, False)
    page.reload()
    expect(button(page, "Publish1")).to_be_disabled()
    expect(why(page, "operation1")).to_contain_text("does not permit")


@pytest.mark.long(None)
def test_without_scripts_a_press_is_a_form(
    server: Server, node: RosNode, without_scripts: Page
) -> None:
    until(server.ready, "ready")
    page = without_scripts
    # One that was locked for a moment, as by a stall of the server, loads itself again only later.
    until(lambda: page.goto(server.url) and button(page, "Publish").is_enabled(), "it is open")
    before = len(node.heard("/operation"))
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_label("Message").fill("no script 日本語")
    button(page, "Publish").click()
    expect(page.locator("#receipt-operation")).to_contain_text("Sent at")
    expect(page.get_by_label("Message")).to_have_value("no script 日本語")
    until(lambda: len(node.heard("/operation")) > before, "heard")
    page.go_back()
    page.go_forward()
    page.reload()
    server.press("operation", "the next")
    until(lambda: "the next" in node.heard_data("/operation")[before:], "heard")
    assert node.heard_data("/operation")[before:] == ["no script 日本語", "the next"]


def test_a_page_without_scripts_loads_itself_again(
    bridge: Bridge,
    node: RosNode,
    tmp_path: Path,
    servers: Callable[[Server], Server],
    without_scripts: Page,
) -> None:
    """A lock shows without a touch."""
    mine = servers(live(bridge.endpoint, tmp_path, app="tests.support.apps.reloading:app"))
    page = without_scripts
    page.goto(mine.url)
    expect(button(page, "Publish1")).to_be_disabled()
    permit(mine, node, True)
    expect(button(page, "Publish1")).to_be_enabled()
    permit(mine, node, False)
    expect(button(page, "Publish1")).to_be_disabled()


def test_enter_in_an_input_presses_nothing(server: Server, node: RosNode, chromium: Browser) -> None:
    until(partial(arrives, server, node), "the robot hears a press")
    before = len(node.heard("/operation"))
    for scripts in (True, False):
        context = chromium.new_context(java_script_enabled=scripts)
        page = context.new_page()
        page.goto(server.url)
        page.wait_for_timeout(TAP_AGAIN_MS)
        page.get_by_label("Message").fill("oops")
        page.get_by_label("Message").press("Enter")
        button(page, "Publish").click()
        expect(page.locator("#receipt-operation")).to_contain_text("Sent")
        context.close()
    until(lambda: len(node.heard("/operation")) == before + 2, "the two presses, and no more")


TAPS: Final = """() => {
  globalThis.taps = [];
  addEventListener("click", () => taps.push(performance.now()), true);
}"""
JOINED_MS: Final = 700 - 50  # a tap so soon after another one is the same press


@pytest.mark.long(None)
def test_two_taps_of_a_finger_are_one_press(server: Server, node: RosNode, page: Page) -> None:
    page.goto(server.url)
    page.evaluate(TAPS)
    publish = button(page, "Publish")
    expect(publish).to_be_enabled()
    page.get_by_label("Message").fill("once")

    def presses() -> int:
        """So far: what the server sends last arrives last."""
        expect(publish).not_to_have_attribute("aria-busy", "true")
        until(partial(arrives, server, node), "the robot hears a press")
        return node.heard_data("/operation").count("once")

    def one_press_of_three_taps() -> bool:
        """Not where the machine was so slow that the last one came later."""
        before = presses()
        publish.dblclick(delay=20)
        expect(page.locator("#receipt-operation")).to_contain_text("Sent")
        publish.click()
        soon = float(page.evaluate("taps.at(-1) - taps.at(-3)")) < JOINED_MS
        after = presses()
        assert not soon or after == before + 1
        return soon

    until(one_press_of_three_taps, "three taps one soon after the other")
    before = presses()
    publish.click()
    assert presses() == before + 1, "a press after that is another one"


@pytest.mark.long("real time")
@pytest.mark.parametrize("fault", ["killed", "frozen"])
def test_a_lost_server_locks_every_control_within_two_seconds(
    bridge: Bridge, node: RosNode, tmp_path: Path, page: Page, fault: str
) -> None:
    mine = live(bridge.endpoint, tmp_path)
    try:
        page.goto(mine.url)
        expect(button(page, "Publish")).to_be_enabled()
        page.wait_for_function("() => document.querySelector('#clock').textContent")
        page.evaluate(TELL_WHEN_LOCKED)
        began = time.time()
        mine.process.send(signal.SIGSTOP if fault == "frozen" else signal.SIGKILL)
        expect(why(page, "operation")).to_contain_text(NO_SERVER)
        locked_at = page.evaluate("lockedAt") / 1000
        assert locked_at - began < 2.0 + LATE_S
        for name in ("Publish", "Publish1", "Publish2"):
            expect(button(page, name)).to_be_disabled()
        expect(page.locator('[data-lamp="server"]')).to_have_attribute("data-state", "bad")
        if fault == "frozen":
            mine.process.send(signal.SIGCONT)
            expect(button(page, "Publish")).to_be_enabled()
    finally:
        mine.process.send(signal.SIGCONT)
        mine.end(signal.SIGKILL)


@pytest.mark.long(None)
def test_a_restarted_server_opens_by_a_fresh_snapshot(
    bridge: Bridge, node: RosNode, tmp_path: Path, page: Page
) -> None:
    first = live(bridge.endpoint, tmp_path)
    page.goto(first.url)
    expect(button(page, "Publish")).to_be_enabled()
    first.end(signal.SIGKILL)
    expect(button(page, "Publish")).to_be_disabled()
    second = live(bridge.endpoint, tmp_path, port=first.port)
    try:
        expect(button(page, "Publish")).to_be_enabled()
        expect(button(page, "Publish1")).to_be_disabled()
        expect(why(page, "operation1")).to_contain_text("is not known yet")
    finally:
        second.end()


@pytest.mark.long(None)
def test_a_post_that_gets_no_answer_is_not_known_and_not_repeated(
    server: Server, node: RosNode, own_page: Page
) -> None:
    page = own_page
    page.goto(server.url)
    expect(button(page, "Publish")).to_be_enabled()
    posts: list[Request] = []

    def lose(route: Route) -> None:
        posts.append(route.request)
        route.abort()

    page.route("**/widgets/**", lose)
    page.route_web_socket("**/presses", lambda socket: socket.close())
    page.reload()
    expect(button(page, "Publish")).to_be_enabled()
    button(page, "Publish").click()
    expect(page.locator("#receipt-operation")).to_contain_text("may or may not have been sent")
    page.wait_for_timeout(1500)  # long enough for a retry to show, were there one
    assert len(posts) == 1


def test_five_visible_windows_of_a_browser_work_beside_hidden_windows(
    server: Server, node: RosNode, chromium: Browser
) -> None:
    """A browser opens six connections to one server over HTTP/1.1."""
    context = chromium.new_context()
    pages = [context.new_page() for _ in range(8)]
    visible = pages[3:]
    for page in pages:
        page.goto(server.url)
        expect(button(page, "Publish")).to_be_enabled()
        if page not in visible:
            page.evaluate(HIDE, True)
    permit(server, node, True)
    for page in visible:
        expect(button(page, "Publish1")).to_be_enabled()
    permit(server, node, False)
    for page in pages:
        expect(button(page, "Publish1")).to_be_disabled()
    for page in visible:
        expect(why(page, "operation1")).to_contain_text("does not permit")
        until(partial(sends, page), "it is sent", every_s=TAP_AGAIN_MS / 1000)
    context.close()


def sends(page: Page) -> bool:
    """Whether a press is sent: a server that stood still refuses one."""
    button(page, "Publish").click()
    receipt = page.locator("#receipt-operation")
    expect(receipt).not_to_be_empty()
    return "Sent" in receipt.inner_text()


@pytest.mark.long(None)
def test_a_hidden_page_gives_its_stream_back_and_is_locked_until_a_new_snapshot(
    server: Server, node: RosNode, page: Page
) -> None:
    def streams(count: int) -> bool:
        return f"kiosk_streams {count}.0" in server.http.get("/metrics").text

    until(server.ready, "ready")
    permit(server, node, True)
    page.goto(server.url)
    expect(button(page, "Publish1")).to_be_enabled()
    until(lambda: streams(1), "one stream")
    page.evaluate(HIDE, True)
    until(lambda: streams(0), "no stream")
    expect(button(page, "Publish1")).to_be_disabled()
    permit(server, node, False)
    held: list[Route] = []
    page.route(EVENTS, lambda route: held.append(route))
    with page.expect_request(EVENTS):
        page.evaluate(HIDE, False)
    for name in ("Publish", "Publish1"):
        expect(button(page, name)).to_be_disabled()
    expect(why(page, "operation")).to_contain_text(NO_SERVER)
    page.unroute(EVENTS)  # lets what is held go on
    until(lambda: streams(1), "one stream again")
    expect(why(page, "operation1")).to_contain_text("does not permit")
    expect(button(page, "Publish")).to_be_enabled()


def test_hostile_text_is_only_text(server: Server, node: RosNode, page: Page) -> None:
    hostile = "</p><img src=x onerror=alert(1)><script>document.title='owned'</script>"
    page.goto(server.url)
    expect(button(page, "Publish")).to_be_enabled()
    say(node, server, hostile)
    value = page.locator('[data-widget="last_heard"] .value')
    expect(value).to_have_text(hostile)
    page.reload()
    expect(value).to_have_text(hostile)
    assert page.title() == "Operation – Robot cell 1"
    assert page.locator("main img").count() == 0


@pytest.mark.long(None)
@pytest.mark.parametrize(
    ("panel", "widget", "most_files", "most_bytes"),
    [(REFERENCE, "operation", 20, 48_000), (SHIPPED, "stop", 31, 69_500)],
    ids=["reference", "shipped"],
)
def test_the_first_page_is_small_and_asks_no_other_host(
    panel: Path, widget: str, most_files: int, most_bytes: int, chromium: Browser
) -> None:
    with ready(Server(ROOT, KIOSK_PANEL=str(panel))) as demo:
        is_small(demo, chromium, widget, most_files, most_bytes)


def is_small(demo: Server, chromium: Browser, widget: str, most_files: int, most_bytes: int) -> None:
    context = chromium.new_context()
    page = context.new_page()
    network = context.new_cdp_session(page)
    network.send("Network.enable")
    requested: dict[str, str] = {}  # URLs by request, but of fonts and of what is in the page itself
    received: Counter[str] = Counter()  # bytes by request, with headers
    failed: dict[str, str] = {}  # the reasons by request

    def request_sent(event: dict[str, Any]) -> None:
        url = event["request"]["url"]
        if not (url.startswith("data:") or "/fonts/" in url):
            requested[event["requestId"]] = url

    network.on("Network.requestWillBeSent", request_sent)
    network.on(
        "Network.responseReceived",
        lambda event: received.update({event["requestId"]: event["response"]["encodedDataLength"]}),
    )
    network.on(  # the stream is never finished
        "Network.dataReceived",
        lambda event: received.update({event["requestId"]: event["encodedDataLength"]}),
    )
    network.on(
        "Network.loadingFinished",
        lambda event: received.__setitem__(event["requestId"], event["encodedDataLength"]),
    )
    network.on(
        "Network.loadingFailed",
        lambda event: failed.__setitem__(event["requestId"], event["errorText"]),
    )
    page.goto(demo.url)
    expect(page.locator(f"[data-widget={widget}] [type=submit]")).to_be_enabled()
    page.wait_for_timeout(500)

    def all_came() -> bool:
        page.wait_for_timeout(50)
        return requested.keys() <= received.keys() | failed.keys()

    until(all_came, "all has come")
    # A stream that is lost is opened again.
    lost = {requested[request]: why for request, why in failed.items() if request in requested}
    assert all(url.startswith(f"{demo.url}/events?") for url in lost), lost
    urls = set(requested.values())
    assert len(urls) <= most_files, urls
    assert all(url.startswith(demo.url) for url in urls)
    assert sum(received[request] for request in requested) < most_bytes
    context.close()


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_page_fits_its_screen_with_buttons_of_twenty_millimetres(
    server: Server, node: RosNode, page: Page, width: int, height: int
) -> None:
    page.set_viewport_size({"width": width, "height": height})
    page.goto(server.url)
    expect(button(page, "Publish")).to_be_enabled()
    permit(server, node, True)
    expect(button(page, "Publish1")).to_be_enabled()
    button(page, "Publish1").click()
    expect(page.locator("#receipt-operation1")).to_contain_text("Sent")
    mm_per_px = 0.22
    places = []
    for name in ("Publish", "Publish1", "Publish2"):
        box = place(button(page, name))
        assert box["height"] * mm_per_px >= 19.9
        assert box["width"] * mm_per_px >= 20
        places.append(box)
    for left, right in pairwise(places):
        assert (right["x"] - left["x"] - left["width"]) * mm_per_px >= 4.9
    fits = "() => [document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
    assert page.evaluate(fits) <= [width, height]
    heading = page.locator('[data-widget="last_heard"]').bounding_box()
    permit(server, node, False)
    expect(button(page, "Publish1")).to_be_disabled()
    # Nothing moved under a finger when the locks came.
    assert page.locator('[data-widget="last_heard"]').bounding_box() == heading
    assert page.evaluate(fits) <= [width, height]


@pytest.mark.long(None)
def test_a_button_acts_on_release_and_sliding_off_cancels(
    server: Server, node: RosNode, page: Page
) -> None:
    page.goto(server.url)
    expect(button(page, "Publish")).to_be_enabled()
    before = len(node.heard("/operation"))
    button(page, "Publish").hover()
    page.mouse.down()
    page.mouse.move(5, 5)
    page.mouse.up()
    expect(page.locator("#receipt-operation")).to_have_text("")
    button(page, "Publish").hover()
    page.mouse.down()
    expect(page.locator("#receipt-operation")).to_have_text("")
    page.mouse.up()
    expect(page.locator("#receipt-operation")).to_contain_text("Sent")
    until(lambda: len(node.heard("/operation")) == before + 1, "one press")


def test_controls_have_labels_and_elements_stay_in_place(demo: Server, page: Page) -> None:
    page.goto(demo.url)
    page.evaluate("() => { window.kept = [...document.querySelectorAll('[data-widget]')]; }")
    page.get_by_label("Message").fill("in place")
    until(lambda: demo.widget("operation")["enabled"], "enabled")
    button(page, "Publish").click()
    expect(page.locator('[data-widget="last_heard"] .value')).to_contain_text("in place")
    assert page.evaluate("() => window.kept.every((element) => element.isConnected)")
    for root in page.locator("[data-widget]").all():
        assert re.fullmatch(r"[a-z]+", root.get_attribute("data-kind") or "")
