"""A socket for presses beside slow robots, impatient clients and other tabs."""

import json
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Page, Request, WebSocket, WebSocketRoute, expect

from app.web.routes.presses import MOST_AT_ONCE
from tests.cell.session.test_nothing_grows import MUTE, Robot, widget
from tests.support.browser.pages import HIDE
from tests.support.parts import (
    ENOUGH_S,
    ROOT,
    PressSocket,
    Server,
    as_response,
    until,
    zenoh_file,
)
from tests.web.test_server import reads_nothing

pytestmark = pytest.mark.promise("offline")

WAITS_S: Final = 3.0  # long enough to see a press that is under way
LONG_S: Final = 2 * ENOUGH_S
LONG_SHUTDOWN: Final = "tests.support.apps.long_shutdown:app"
LATER_S: Final = 1.2  # than an ending server gives a client that reads nothing
FREE: Final = """
    [[page.widget]]
    id = "free"
    kind = "publish"
    label = "Publish"
    topic = "/free"
    type = "std_msgs/msg/String"
    message = { data = "free" }
"""


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with slow(tmp_path_factory.mktemp("slow")) as mine:
        yield mine


@contextmanager
def slow(folder: Path, waits_s: float = WAITS_S, app: str = "app.main:app") -> Iterator[Server]:
    """On a robot that answers no call."""
    robot = Robot()
    panel = folder / "slow.toml"
    calls = "".join(widget(name, waits_s) for name in MUTE)
    panel.write_text(f'title = "Slow"\nmode = "live"\n[[page]]\nid = "p"\ntitle = "P"\n{FREE}{calls}')
    zenoh = str(zenoh_file(folder, robot.endpoint))
    mine = Server(ROOT, app=app, KIOSK_PANEL=str(panel), KIOSK_ZENOH=zenoh)
    until(lambda: all(w["enabled"] for w in mine.snapshot()["widgets"].values()), "all is offered")
    yield mine
    mine.end()
    robot.close()


def press(name: str, press_id: str = "", **more: Any) -> str:
    return json.dumps({"widget": name, "id": press_id or name, "inputs": {}, **more})


def logged(kiosk: Server, press_id: str) -> str:
    """The line in the server's log with the result of a press."""
    return next((line for line in kiosk.process.lines if f"press {press_id} of" in line), "")


def test_a_slow_answer_holds_up_no_other_press(kiosk: Server) -> None:
    with kiosk.socket() as socket:
        socket.say(press(MUTE[0], "slow"))
        socket.say(press("free", "quick"))
        first, second = socket.hear(), socket.hear()
    assert (first["press"], first["outcome"], first["status"]) == ("quick", "unknown", 200)
    assert (second["press"], second["outcome"], second["status"]) == ("slow", "timed_out", 504)
    assert (first["code"], second["code"]) == ("press_no_subscriber", "timed_out")


def test_too_many_presses_at_once_are_refused_and_none_is_lost(kiosk: Server) -> None:
    with kiosk.socket() as socket, kiosk.socket() as other:
        for name in MUTE:
            socket.say(press(name, f"many.{name}"))
        other.say(press("free", "many.other"))  # another page is not held up
        assert other.hear()["status"] == 200
        answers = {said["press"]: said for said in (socket.hear() for _ in MUTE)}
        assert set(answers) == {f"many.{name}" for name in MUTE}
        refused = [said for said in answers.values() if said["status"] == 429]
        assert len(refused) == len(MUTE) - MOST_AT_ONCE
        assert f"{MOST_AT_ONCE} presses" in refused[0]["error"]
        assert {said["status"] for said in answers.values()} == {429, 504}
        assert not any(logged(kiosk, said["press"]) for said in refused)
        socket.say(press("free", "many.after"))
        assert socket.hear()["status"] == 200


def test_client_that_leaves_early_loses_only_its_answer(kiosk: Server) -> None:
    with kiosk.socket() as socket:
        socket.say(press(MUTE[1], "left"))
        until(lambda: kiosk.widget(MUTE[1])["busy"], "it is under way")
    until(lambda: "timed_out" in logged(kiosk, "left"), "it came to its end")
    again = kiosk.http.post(f"/widgets/{MUTE[1]}", json={"inputs": {}, "id": "left"})
    assert (again.status_code, again.json()["outcome"]) == (504, "timed_out")


def test_a_server_that_ends_reports_the_result_of_a_press_that_is_under_way(tmp_path: Path) -> None:
    with slow(tmp_path, app=LONG_SHUTDOWN) as mine, mine.socket() as socket:
        socket.say(press(MUTE[0], "late"))
        until(lambda: mine.widget(MUTE[0])["busy"], "it is under way")
        mine.process.send(signal.SIGTERM)
        said = socket.hear()
        assert (said["press"], said["outcome"], said["status"]) == ("late", "timed_out", 504)


def stopping(socket: PressSocket) -> bool:
    """Whether a press is refused because the server stops."""
    socket.say(press("free", f"free.{time.monotonic_ns()}"))
    said = socket.hear()
    return said["status"] == 409 and "the panel server is shutting down" in said["reason"]


@pytest.mark.parametrize("way", ["socket", pytest.param("post", marks=pytest.mark.long("detail"))])
def test_a_server_that_ends_waits_for_no_robot_for_long(tmp_path: Path, way: str) -> None:
    with (
        slow(tmp_path, LONG_S) as mine,
        mine.socket() as socket,
        mine.socket() as other,
        ThreadPoolExecutor() as pool,
    ):
        began = time.monotonic()
        if way == "socket":
            socket.say(press(MUTE[0], "long"))
            answered = pool.submit(socket.hear, ENOUGH_S)
        else:
            body = {"inputs": {}, "id": "long"}
            answered = pool.submit(lambda: mine.http.post(f"/widgets/{MUTE[0]}", json=body).json())
        until(lambda: mine.widget(MUTE[0])["busy"], "it is under way")
        mine.process.send(signal.SIGTERM)
        until(lambda: stopping(other), "nothing more is sent", every_s=0.05)
        said = answered.result(ENOUGH_S)
        assert (said["id"], said["outcome"]) == ("long", "unknown")
        assert said["reason"] == "The panel server is shutting down. The result is unknown."
        assert mine.process.wait(ENOUGH_S) == -signal.SIGTERM  # which uvicorn raises again
        assert time.monotonic() - began < LONG_S
    assert said["reason"] in logged(mine, "long")


@pytest.mark.long("detail")
def test_unread_socket_does_not_delay_shutdown(tmp_path: Path) -> None:
    with (
        slow(tmp_path, LONG_S, LONG_SHUTDOWN) as mine,
        mine.socket() as socket,
        mine.socket() as other,
    ):
        socket.say(press(MUTE[0], "long"))
        until(lambda: mine.widget(MUTE[0])["busy"], "it is under way")
        mine.process.send(signal.SIGTERM)
        until(lambda: stopping(other), "nothing more is sent", every_s=0.05)
        time.sleep(LATER_S)
        with reads_nothing(mine):
            assert socket.hear(ENOUGH_S)["outcome"] == "unknown"
            mine.process.wait(ENOUGH_S)


def test_message_that_is_not_a_press_gets_an_error(kiosk: Server) -> None:
    with kiosk.socket() as socket:
        for text, why in (
            (b"\0", "the message is not text"),
            (json.dumps({"widget": "free", "inputs": {}}), "id: Field required"),
            (json.dumps({"id": "x", "inputs": {}}), "widget: Field required"),
            (press("free", more=1), "more: Extra inputs"),
        ):
            socket.say(text)
            said = socket.hear()
            assert (said["status"] == 422, why in said["error"]) == (True, True), said
        socket.say(press("nothing", "no-such"))
        assert as_response(socket.hear()).status_code == 404


def posts_of(page: Page) -> list[Request]:
    """Those that the page makes from now on."""
    posts: list[Request] = []

    def on_request(request: Request) -> None:
        if request.method == "POST":
            posts.append(request)

    page.on("request", on_request)
    return posts


def publish(page: Page) -> Any:
    return page.get_by_role("button", name="Publish", exact=True)


NOTE_OPENED: Final = """() => {
    window.opened = 0;
    window.WebSocket = class extends WebSocket {
        constructor(url) { super(url); this.addEventListener("open", () => opened++); }
    };
}"""


NOTE_ENDED: Final = NOTE_OPENED.replace('"open"', '"close"')


def touched(page: Page) -> WebSocket:
    """The socket of a page that was touched for the first time, and not pressed."""
    expect(publish(page)).to_be_enabled()
    page.wait_for_function("() => document.querySelector('#clock').textContent")
    page.evaluate(NOTE_OPENED)
    with page.expect_websocket() as opened:
        page.locator("header h1").click()
    page.wait_for_function("() => opened")
    return opened.value


def test_a_page_presses_on_its_socket_and_gets_a_late_answer_there(kiosk: Server, page: Page) -> None:
    posts = posts_of(page)
    page.goto(kiosk.url)
    socket = touched(page)
    assert socket.url == f"ws://127.0.0.1:{kiosk.port}/presses"
    page.get_by_role("button", name=MUTE[2], exact=True).click()
    expect(page.locator(f'[data-widget="{MUTE[2]}"] .result')).to_contain_text("Waiting for the robot")
    publish(page).click()
    expect(page.locator("#receipt-free")).to_contain_text("Sent at")
    expect(page.locator(f'[data-widget="{MUTE[2]}"] .result')).to_contain_text("No response within")
    assert posts == []
    assert not socket.is_closed()


@pytest.mark.long("detail")
def test_a_page_that_is_only_looked_at_has_no_socket(kiosk: Server, own_page: Page) -> None:
    page = own_page
    sockets: list[WebSocket] = []
    page.on("websocket", lambda socket: sockets.append(socket))
    page.add_init_script(
        "const real = setTimeout; setTimeout = (does, ms) => real(does, ms === 60_000 ? 5000 : ms);"
    )
    page.goto(kiosk.url)
    expect(publish(page)).to_be_enabled()
    page.wait_for_function("() => document.querySelector('#clock').textContent")
    page.mouse.move(200, 200)
    page.wait_for_timeout(300)
    assert sockets == []
    with page.expect_websocket() as opened:
        page.mouse.down()
    socket = opened.value
    assert not socket.is_closed()
    socket.wait_for_event("close")
    expect(publish(page)).to_be_enabled()


@pytest.mark.long("table")
@pytest.mark.parametrize("fault", ["it does not open", "it breaks", "it hangs"])
def test_a_press_whose_socket_breaks_is_not_known_and_not_repeated(
    kiosk: Server, own_page: Page, fault: str
) -> None:
    page = own_page
    posts = posts_of(page)
    said: list[str | bytes] = []
    sockets: list[WebSocketRoute] = []

    def broken(socket: WebSocketRoute) -> None:
        sockets.append(socket)
        if len(sockets) > 1:
            socket.connect_to_server()
        elif fault == "it does not open":
            socket.close()
        else:
            socket.on_message(lambda text: on_message(socket, text))

    def on_message(socket: WebSocketRoute, text: str | bytes) -> None:
        said.append(text)
        if fault == "it breaks":
            socket.close()

    page.route_web_socket("**/presses", broken)
    page.goto(kiosk.url)
    expect(publish(page)).to_be_enabled()
    page.wait_for_function("() => document.querySelector('#clock').textContent")
    page.evaluate(NOTE_ENDED if fault == "it does not open" else NOTE_OPENED)
    page.locator("header h1").click()
    page.wait_for_function("() => opened")  # the socket is there, or not
    publish(page).click()
    receipt = page.locator("#receipt-free")
    if fault == "it does not open":
        expect(receipt).to_contain_text("Sent at")
        return
    expect(receipt).to_contain_text("may or may not have been sent", timeout=10_000)
    page.wait_for_timeout(1000)  # long enough for a repetition to show, were there one
    assert (len(said), posts, len(sockets)) == (1, [], 1)
    publish(page).click()
    expect(receipt).to_contain_text("Sent at")
    assert (len(said), len(sockets)) == (1, 2)


def test_a_hidden_page_gives_its_socket_back(kiosk: Server, page: Page) -> None:
    page.goto(kiosk.url)
    first = touched(page)
    assert not first.is_closed()
    with first.expect_event("close"):
        page.evaluate(HIDE, True)
    page.evaluate(HIDE, False)
    second = touched(page)
    publish(page).click()
    expect(page.locator("#receipt-free")).to_contain_text("Sent at")
    assert (first.is_closed(), second.is_closed()) == (True, False)
