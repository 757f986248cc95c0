"""A press is bound to what its operator saw, and to its time: it is never sent late."""

import json
import signal
import threading
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import httpx
import pytest
from playwright.sync_api import Browser, Page, expect

from app.cell.commands.judge import PressGuard
from app.cell.permission.control import ControlAuthority
from app.cell.view.publisher import ViewPublisher
from app.cell.view.view import build_view
from app.panel.keys import PanelKeys
from app.records import NullLog
from app.system import clock
from app.system.errors import InputError
from app.system.texts import Text, say
from tests.cell.permission.test_goal_places import cell_with, put_map
from tests.support.builders import (
    NOW,
    PROGRAM,
    VIEW,
    Table,
    guard_of,
    permits,
    press_of,
    robot_there,
    small_panel,
)
from tests.support.parts import (
    REFERENCE,
    TAP_AGAIN_MS,
    Bridge,
    RosNode,
    Server,
    as_response,
    events_in,
    live,
    until,
)
from tests.support.words import english

pytestmark = pytest.mark.promise("press")

HOUR_MS = 3_600_000
EXPIRES_S = PanelKeys.model_fields["press_expires_s"].default


@pytest.fixture
def kiosk(server: Server, node: RosNode) -> Iterator[Server]:
    node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    until(server.ready, "ready")
    permit(server, node, True)
    yield server
    node.withdraw("/operation_enabled")


@pytest.fixture(scope="module")
def kiosk_60_s(
    bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    """A kiosk whose panel lets a press expire after 60 s: a busy machine is faster."""
    folder = tmp_path_factory.mktemp("minute")
    panel = folder / "panel.toml"
    panel.write_text(f"press_expires_s = 60.0\n{REFERENCE.read_text()}")
    with live(bridge.endpoint, folder, KIOSK_PANEL=str(panel)) as mine:
        until(mine.ready, "ready")
        until(lambda: mine.widget("operation")["enabled"], "it can be pressed")
        yield mine


def permit(kiosk: Server, node: RosNode, value: bool) -> None:
    def is_applied() -> bool:
        node.publish("/operation_enabled", {"data": value})
        return bool(kiosk.widget("operation1")["enabled"]) is value

    until(is_applied, f"permitted: {value}", every_s=0.1)


def server_time(kiosk: Server, later_s: float = 0.0) -> str:
    """The server's own time as its heartbeat has it."""
    events = events_in(kiosk.http.get("/events?once=1").text)
    (data,) = [data for name, data, _ in events if name == "beat"]
    seconds = float(httpx.Response(200, text=data).json()["now"]) / 1000 + later_s
    return datetime.fromtimestamp(seconds, UTC).isoformat()


def age_s(at: str) -> float:
    """The time since a time of the server, whose clock is this machine's."""
    return (datetime.now(UTC) - datetime.fromisoformat(at)).total_seconds()


def test_press_is_refused_if_the_state_changed_since_it_was_seen(
    kiosk: Server, node: RosNode, way: str
) -> None:
    kiosk = kiosk.by(way)
    event_id = kiosk.snapshot()["id"]
    assert kiosk.press("operation1", "as seen", seen=event_id).status_code == 200
    permit(kiosk, node, False)
    permit(kiosk, node, True)
    answer = kiosk.press("operation1", "changed", seen=event_id, id="changed-1")
    assert (answer.status_code, answer.json()["outcome"]) == (409, "refused")
    assert "changed while you pressed" in answer.json()["reason"]
    again = kiosk.press("operation1", "changed", seen=event_id, id="changed-1")
    assert (again.status_code, again.json()) == (409, answer.json())
    assert kiosk.press("operation", "not guarded", seen=event_id).status_code == 200
    assert kiosk.press("operation1", "again", seen=kiosk.snapshot()["id"]).status_code == 200
    until(lambda: node.heard_data("/operation1")[-1:] == ["again"], "heard")
    assert "changed" not in node.heard_data("/operation1")


def test_a_lock_that_blinks_under_a_resting_finger_refuses_the_press(
    kiosk: Server, node: RosNode, page: Page
) -> None:
    """What counts is what was seen when the finger came down."""
    page.goto(kiosk.url)
    publish = page.get_by_role("button", name="Publish1", exact=True)
    expect(publish).to_be_enabled()
    page.get_by_label("Message").fill("blinked")
    publish.hover()
    page.mouse.down()
    permit(kiosk, node, False)
    expect(publish).to_be_disabled()
    permit(kiosk, node, True)
    expect(publish).to_be_enabled()
    page.mouse.up()
    expect(page.locator("#receipt-operation1")).to_contain_text("changed while you pressed")
    expect(publish).not_to_have_attribute("aria-busy", "true")
    publish.click()
    expect(page.locator("#receipt-operation1")).to_contain_text("Sent at")
    until(lambda: "blinked" in node.heard_data("/operation1"), "heard")
    assert node.heard_data("/operation1").count("blinked") == 1


@pytest.mark.long("every screen")
@pytest.mark.parametrize(
    ("later_s", "status", "words"),
    [(0.0, 200, "Sent"), (-30.0, 200, "Sent"), (-90.0, 409, "to arrive"), (60.0, 409, "ahead of")],
)
def test_a_press_has_its_time_and_the_panel_says_how_long(
    kiosk_60_s: Server, later_s: float, status: int, words: str, way: str
) -> None:
    kiosk = kiosk_60_s.by(way)
    answer = kiosk.press("operation", "timed", at=server_time(kiosk, later_s))
    assert (answer.status_code, words in answer.json()["reason"]) == (status, True), answer.json()


@pytest.mark.parametrize(
    ("panel", "later_s", "words"),
    [
        ({}, 0.0, ""),
        ({}, -2.0, ""),
        ({}, -2.01, "to arrive"),
        ({}, 1.0, ""),
        ({}, 1.01, "ahead of"),
        ({"press_expires_s": 10.0}, -10.0, ""),
        ({"press_expires_s": 10.0}, -10.01, "to arrive"),
    ],
)
def test_the_limits_of_the_time_of_a_press(
    monkeypatch: pytest.MonkeyPatch, panel: Table, later_s: float, words: str
) -> None:
    limits = small_panel(**panel)
    guard = guard_of(limits, robot_there(limits))
    monkeypatch.setattr(clock, "server_now", lambda: NOW)
    why = english(guard.late(NOW + later_s))
    assert words in why
    assert bool(why) == bool(words)


def test_a_press_of_a_page_that_showed_the_lock_before_it_changed_is_stale() -> None:
    """The button was locked and opened again after the page: what the operator saw is no longer true.
    A change that is none of the button's does not matter."""
    panel = small_panel()
    robot = robot_there(panel)
    permits(robot)
    publisher = ViewPublisher(build_view(panel, robot, NOW).view, "r1")
    control = ControlAuthority(panel.control, "", log_line=lambda *_: None)
    guard = PressGuard(publisher, control, NullLog(), 3.0, lambda: ())

    def reason(widget: str, seen: str) -> str:
        command = next(command for command in panel.commands if command.id == widget)
        stale = guard.stale_reason(press_of(command, {}, seen=seen))
        return stale.code if isinstance(stale, Text) else ""

    seen = publisher.id
    assert reason("guarded", seen) == ""
    for permitted in (False, True):
        permits(robot, permitted)
        publisher.post(build_view(panel, robot, NOW).view)
    assert publisher.view["widgets"]["guarded"]["enabled"]
    assert reason("guarded", seen) == "press_state_changed"
    assert reason("free", seen) == ""
    assert reason("guarded", publisher.id) == ""


def test_a_place_is_not_sent_from_a_view_with_another_map() -> None:
    panel, robot, _, _ = cell_with()
    publisher = ViewPublisher(build_view(panel, robot, NOW).view, "r1")
    guard = PressGuard(
        publisher,
        ControlAuthority(panel.control, "", log_line=lambda *_: None),
        NullLog(),
        3.0,
        lambda: (),
    )
    press = press_of(panel.commands[0], {}, seen=publisher.id)
    put_map(robot, resolution=0.3)
    publisher.post(build_view(panel, robot, NOW).view)
    assert publisher.view["widgets"]["drive"]["enabled"]
    assert guard.stale_reason(press) == say("press_state_changed")
    assert guard.stale_reason(replace(press, seen=publisher.id)) == ""


@pytest.mark.parametrize("seen", ["", f"{VIEW}-0", "0123-99"])
def test_a_press_with_a_view_of_this_or_another_server_is_received(seen: str) -> None:
    panel = small_panel()
    guard = guard_of(panel, robot_there(panel))
    guard.receive(press_of(panel.commands[0], {}, seen=seen))


@pytest.mark.parametrize("seen", ["x", "5eed", f"{VIEW}-99", f"{VIEW}--1"])
def test_an_invalid_or_future_view_is_an_input_error(seen: str) -> None:
    panel = small_panel()
    guard = guard_of(panel, robot_there(panel))
    with pytest.raises(InputError):
        guard.receive(press_of(panel.commands[0], {}, seen=seen))


def test_a_press_of_another_robots_or_an_earlier_view_is_stale() -> None:
    panel = small_panel()
    guard = guard_of(panel, robot_there(panel), other_views=["0123"])
    reasons = [guard.stale_reason(press_of(panel.commands[0], {}, seen=f"{view}-1"))
               for view in ("0123", "4567")]  # fmt: skip
    assert reasons == [say("press_seen_on_another_robot"), say("press_seen_before_restart")]


def test_an_act_needs_control_only_where_the_panel_requires_it() -> None:
    for required in (False, True):
        panel = small_panel(control={"required": required})
        guard = guard_of(panel, robot_there(panel))
        assert guard.control_verdict(PROGRAM).permitted is not required


def test_a_version_that_is_not_there_yet_is_bad_input(kiosk: Server, way: str) -> None:
    boot, _, version = kiosk.snapshot()["id"].partition("-")
    answer = kiosk.by(way).press("operation", "x", seen=f"{boot}-{int(version) + 1000}")
    assert answer.status_code == 422
    assert "is not there yet" in answer.json()["error"]


def test_a_press_that_waited_in_a_stopped_server_is_not_sent(kiosk: Server, node: RosNode) -> None:
    at = server_time(kiosk)
    answers: list[httpx.Response] = []
    with kiosk.socket() as socket:
        kiosk.process.send(signal.SIGSTOP)
        try:
            poster = threading.Thread(
                target=lambda: answers.append(kiosk.press("operation", "too late", at=at))
            )
            poster.start()
            press = {"widget": "operation", "id": "hung", "inputs": {"message": "too late"}, "at": at}
            socket.say(json.dumps(press))
            until(lambda: age_s(at) > EXPIRES_S, "they have expired")
        finally:
            kiosk.process.send(signal.SIGCONT)
        poster.join(10)
        answers.append(as_response(socket.hear()))
    assert len(answers) == 2
    for answer in answers:
        assert answer.json()["outcome"] == "refused"
    assert "too late" not in node.heard_data("/operation")


def test_a_press_in_a_browser_waits_for_no_stopped_server(
    kiosk: Server, node: RosNode, page: Page
) -> None:
    page.goto(kiosk.url)
    expect(page.get_by_role("button", name="Publish", exact=True)).to_be_enabled()
    page.get_by_label("Message").fill("never late")
    page.wait_for_timeout(700)  # a heartbeat
    kiosk.process.send(signal.SIGSTOP)
    try:
        page.get_by_role("button", name="Publish", exact=True).click()
        page.wait_for_timeout(3000)
    finally:
        kiosk.process.send(signal.SIGCONT)
    # Too late, or by then without a link: never sent.
    expect(page.locator("#receipt-operation")).to_contain_text("Not sent")
    expect(page.get_by_role("button", name="Publish", exact=True)).to_be_enabled()
    page.get_by_role("button", name="Publish", exact=True).click()
    expect(page.locator("#receipt-operation")).to_contain_text("Sent at")
    until(lambda: "never late" in node.heard_data("/operation"), "heard")
    assert node.heard_data("/operation").count("never late") == 1


def test_a_tablets_wrong_clock_does_not_matter(kiosk: Server, chromium: Browser) -> None:
    for hours in (-5, 5):
        context = chromium.new_context()
        context.add_init_script(
            f"const now = Date.now; Date.now = () => now() + {hours * HOUR_MS};"
            f"const Real = Date; Date = class extends Real {{ constructor(...a) {{"
            f" a.length ? super(...a) : super(now() + {hours * HOUR_MS}); }} }};"
        )
        page = context.new_page()
        page.goto(kiosk.url)
        page.get_by_role("button", name="Publish", exact=True).click()
        expect(page.locator("#receipt-operation")).to_contain_text("Sent at")
        context.close()


def test_a_press_in_a_page_that_stood_still_is_not_sent(
    kiosk: Server, node: RosNode, page: Page
) -> None:
    """The page's script is busy for 3 s; the tap that came in the meantime has its own time."""
    page.goto(kiosk.url)
    publish = page.get_by_role("button", name="Publish", exact=True)
    expect(publish).to_be_enabled()
    page.get_by_label("Message").fill("stood still")
    box: Any = publish.bounding_box()
    session = page.context.new_cdp_session(page)
    page.evaluate(
        "() => addEventListener('pointerdown', () => void setTimeout(() => {"
        " console.log('busy'); const end = performance.now() + 3000;"
        " while (performance.now() < end); }, 100))"
    )
    where = {"x": box["x"] + 20, "y": box["y"] + 20, "button": "left", "clickCount": 1}
    with page.expect_console_message(lambda message: message.text == "busy"):
        session.send("Input.dispatchMouseEvent", {"type": "mousePressed", **where})
    session.send("Input.dispatchMouseEvent", {"type": "mouseReleased", **where})
    expect(page.locator("#receipt-operation")).not_to_be_empty()
    assert "Sent" not in (page.locator("#receipt-operation").text_content() or "")
    assert "stood still" not in node.heard_data("/operation")


def test_without_scripts_a_page_that_is_too_old_presses_nothing(
    kiosk: Server, node: RosNode, without_scripts: Page
) -> None:
    page = without_scripts
    page.goto(kiosk.url)
    html = page.content()
    page.wait_for_timeout(TAP_AGAIN_MS)
    page.get_by_label("Message").fill("fresh")
    page.get_by_role("button", name="Publish", exact=True).click()
    expect(page.locator("#receipt-operation")).to_contain_text("Sent")
    fields = dict(
        part.split('" value="')
        for part in html.replace('">', "\n").split('name="')[1:]
        for part in [part.split("\n")[0]]
        if part.startswith(("_seen", "_until"))
    )
    assert set(fields) == {"_seen", "_until"}
    old = {**fields, "_until": str(float(fields["_until"]) - 120), "message": "old page"}
    answer = kiosk.http.post("/widgets/operation", data=old, follow_redirects=True)
    assert "to arrive. Press again" in answer.text
    assert "old page" not in node.heard_data("/operation")
