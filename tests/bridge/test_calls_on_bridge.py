"""Services and actions of a robot on Cyclone DDS, from the panel, through the real bridge."""

import json
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from typing import Any

import httpx
import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from app.ros.dialects.peer_traits import BRIDGE_TRAITS
from tests.support.browser.pages import widget
from tests.support.cyclone import TYPES, Client, CycloneRobot, served
from tests.support.panel_text import ADD
from tests.support.parts import Bridge, Server, Stream, http_client, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("receipt")

FIBONACCI = "example_interfaces/action/Fibonacci"

ANSWER_S = 10.0  # for which /nowhere would be waited

PANEL = (
    """
title = "Cyclone cell"
mode = "live"

[[page]]
id = "calls"
title = "Calls"

[[page.widget]]
id = "words"
kind = "text"
label = "Words"

[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/said"
type = "std_msgs/msg/String"
message = { data = "{words}" }

[[page.widget]]
id = "enable"
kind = "call"
label = "Enable"
service = "/set_enabled"
type = "std_srvs/srv/SetBool"
request = { data = true }

"""
    + ADD
    + """
[[page.widget]]
id = "slow"
kind = "call"
label = "Slow"
service = "/slow"
type = "std_srvs/srv/Trigger"
timeout_s = 1.0

[[page.widget]]
id = "long"
kind = "call"
label = "Long"
service = "/slow_2"
type = "std_srvs/srv/Trigger"
timeout_s = 30.0

[[page.widget]]
id = "nowhere"
kind = "call"
label = "Nowhere"
service = "/nowhere"
type = "std_srvs/srv/Trigger"
timeout_s = 10.0

[[page.widget]]
id = "other"
kind = "call"
label = "Other type"
service = "/reset"
type = "std_srvs/srv/Empty"

[[page.widget]]
id = "count"
kind = "action"
label = "Count"
action = "/fibonacci"
type = "example_interfaces/action/Fibonacci"
goal = { order = 6 }
feedback = "so far {sequence}"
result = "{sequence}"

[[page.widget]]
id = "refused"
kind = "action"
label = "Count backwards"
action = "/fibonacci"
type = "example_interfaces/action/Fibonacci"
goal = { order = -1 }
"""
)


@pytest.fixture
def kiosk(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        until(lambda: mine.widget("enable")["enabled"], "the service is offered")
        yield mine


@pytest.fixture
def own_kiosk(own_cyclone_bridge: Bridge, tmp_path: Path) -> Iterator[Server]:
    """A kiosk behind a bridge that the test may end."""
    with live_server(own_cyclone_bridge, tmp_path, PANEL) as mine:
        yield mine


def uuid_of(octets: bytes) -> Any:
    return TYPES.types["unique_identifier_msgs/msg/UUID"](np.frombuffer(octets, dtype=np.uint8))


def goal_of(order: int) -> Any:
    return TYPES.types[f"{FIBONACCI}_Goal"](order)


def press(kiosk: Server, widget: str, **more: Any) -> httpx.Response:
    return kiosk.http.post(f"/widgets/{widget}", json={"inputs": {}, **more})


def test_a_call_that_succeeds_shows_the_answer(kiosk: Server, robot: CycloneRobot) -> None:
    receipt = press(kiosk, "add")
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "succeeded")
    assert "the sum is 42" in receipt.json()["reason"]
    assert robot.requests("/add_two_ints") == [{"a": 40, "b": 2}]
    assert "the sum is 42" in kiosk.widget("add")["result"]  # for every browser, and after a reload
    assert "the sum is 42" in kiosk.http.get("/").text


def test_rejection_shows_the_robots_words(kiosk: Server, robot: CycloneRobot) -> None:
    robot.answer_set_enabled(success=False, message="the door is open")
    receipt = press(kiosk, "enable")
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "rejected")
    assert receipt.json()["reason"].endswith(": the door is open")
    robot.answer_set_enabled(success=True, message="")
    assert press(kiosk, "enable").json()["outcome"] == "succeeded"
    assert robot.requests("/set_enabled") == [{"data": True}] * 2


def test_no_such_service_is_reported_at_once(kiosk: Server) -> None:
    assert "does not offer /nowhere" in kiosk.widget("nowhere")["reason"]
    began = time.monotonic()
    receipt = press(kiosk, "nowhere")
    assert time.monotonic() - began < ANSWER_S
    assert (receipt.status_code, receipt.json()["outcome"]) == (503, "refused")


def test_a_service_of_another_type_is_never_called(kiosk: Server, robot: CycloneRobot) -> None:
    assert "/reset is std_srvs/srv/Trigger on the robot" in kiosk.widget("other")["reason"]
    assert press(kiosk, "other").status_code == 409
    assert robot.requests("/reset") == []


def test_a_late_answer_corrects_the_receipt(kiosk: Server, robot: CycloneRobot) -> None:
    robot.answer_slow(seconds=5)
    receipt = press(kiosk, "slow", id="slow-1")
    assert (receipt.status_code, receipt.json()["outcome"]) == (504, "timed_out")
    assert "may or may not have done it" in receipt.json()["reason"]
    until(lambda: kiosk.widget("slow")["outcome"] == "succeeded", "the late answer is shown")
    again = press(kiosk, "slow", id="slow-1")
    assert (again.status_code, again.json()["outcome"]) == (200, "succeeded")
    assert len(robot.requests("/slow")) == 1
    until(lambda: "late response" in kiosk.process.text, "it is logged")


def test_while_a_call_waits_its_button_is_locked_and_others_go_on(
    kiosk: Server, robot: CycloneRobot
) -> None:
    robot.answer_slow(seconds=4)
    with ThreadPoolExecutor(2) as pool:
        slow = pool.submit(press, kiosk, "long", id="one")
        until(lambda: kiosk.widget("long")["busy"], "under way")
        same = pool.submit(press, kiosk, "long", id="one")
        second = press(kiosk, "long", id="two")
        assert second.status_code == 409
        assert "waiting for the robot" in second.json()["reason"]
        assert press(kiosk, "add").json()["outcome"] == "succeeded"
        assert not slow.done()
        assert slow.result().json() == same.result().json()
    assert len(robot.requests("/slow_2")) == 1
    assert kiosk.widget("long")["enabled"]


def heard_after_s(kiosk: Server, robot: CycloneRobot, words: str) -> float:
    """From a press of a publish widget to the node's having heard it."""
    began = time.monotonic()
    receipt = kiosk.http.post("/widgets/say", json={"inputs": {"words": words}})
    assert receipt.json()["outcome"] == "published"
    until(lambda: {"data": words} in robot.heard(topic="/said"), "heard", every_s=0.001)
    return time.monotonic() - began


@pytest.mark.long("real time")
def test_calls_that_wait_hold_up_no_press(
    cyclone_bridge: Bridge,
    robot: CycloneRobot,
    tmp_path: Path,
    servers: Callable[[Server], Server],
) -> None:
    names = [f"wait_{n}" for n in range(3 * (BRIDGE_TRAITS.max_unanswered + 1))]
    panel = PANEL + "".join(waiting_widget(*numbered_name) for numbered_name in enumerate(names))
    kiosk = servers(live_server(cyclone_bridge, tmp_path, panel))
    robot.subscribe(topic="/said", type="std_msgs/msg/String")
    robot.answer_slow(seconds=None)
    until(lambda: kiosk.widget("say")["enabled"], "joined")
    until(lambda: kiosk.widget(names[-1])["enabled"], "offered")
    until(lambda: robot.publishers(topic="/said"), "the bridge publishes")
    until(lambda: _is_published(kiosk), "the kiosk knows that the node subscribes")
    alone = median(heard_after_s(kiosk, robot, f"alone {n}") for n in range(20))
    with ThreadPoolExecutor(len(names)) as pool:
        began = time.monotonic()
        calls = [pool.submit(press_alone, kiosk, name) for name in names]
        until(lambda: sum(call.done() for call in calls) == 3, "what is too many is refused at once")
        assert time.monotonic() - began < WAITING_S / 2
        beside = median(heard_after_s(kiosk, robot, f"beside {n}") for n in range(20))
        assert sum(call.done() for call in calls) == 3, "the others wait all the while"
        outcomes = Counter(call.result().json()["outcome"] for call in calls)
    assert outcomes == {"timed_out": 3 * BRIDGE_TRAITS.max_unanswered, "refused": 3}
    assert len(robot.requests("/slow")) == BRIDGE_TRAITS.max_unanswered
    assert beside < 3 * alone + 0.02, f"{beside * 1000:.1f} ms instead of {alone * 1000:.1f} ms"


def _is_published(kiosk: Server) -> bool:
    answer = kiosk.http.post("/widgets/say", json={"inputs": {"words": "first"}})
    return bool(answer.json()["outcome"] == "published")


WAITING_S = 3.0


def waiting_widget(number: int, name: str) -> str:
    service = ("/slow", "/slow_2", "/slow_3")[number % 3]
    return f"""
        [[page.widget]]
        id = "{name}"
        kind = "call"
        label = "Wait"
        service = "{service}"
        type = "std_srvs/srv/Trigger"
        timeout_s = {WAITING_S}
    """


def press_alone(kiosk: Server, widget: str) -> httpx.Response:
    """A press with a connection of its own."""
    with http_client(kiosk.url, 2 * WAITING_S) as http:
        return http.post(f"/widgets/{widget}", json={"inputs": {}})


def test_a_robot_that_has_just_come_gets_the_first_call(
    own_kiosk: Server,
    own_cyclone_bridge: Bridge,
    cyclone_robots: Callable[..., CycloneRobot],
) -> None:
    until(lambda: "does not offer" in (own_kiosk.widget("add")["reason"] or ""), "joined, and no robot")
    for number in range(3):
        with own_kiosk.stream() as stream:
            stream.next("snapshot")
            robot = cyclone_robots(own_cyclone_bridge.domain)
            reasons = list(reasons_of("add", stream))
        receipt = press(own_kiosk, "add", id=f"first-{number}")
        assert receipt.json()["outcome"] == "succeeded", receipt.json()
        assert len(reasons) == 1
        assert "has just started" in reasons[0]
        assert len(robot.requests("/add_two_ints")) == 1
        robot.end()
        until(lambda: not own_kiosk.widget("add")["enabled"], "the robot is gone")


def reasons_of(widget: str, stream: Stream) -> Iterator[str]:
    """Why a widget is locked, as it changes, until it opens."""
    while True:
        _, changes, _ = stream.next("update")
        if changes.get(widget, {}).get("enabled"):
            return
        if reason := changes.get(widget, {}).get("reason"):
            yield reason


def test_lost_bridge_while_waiting_leaves_the_result_unknown(
    own_kiosk: Server,
    own_cyclone_bridge: Bridge,
    own_client: Client,
    cyclone_robots: Callable[..., CycloneRobot],
) -> None:
    robot = cyclone_robots(own_cyclone_bridge.domain)
    served(robot, own_client)
    until(lambda: own_kiosk.widget("long")["enabled"], "offered")
    robot.answer_slow(seconds=None)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(press, own_kiosk, "long")
        until(lambda: robot.requests("/slow_2"), "the robot is at it")
        own_cyclone_bridge.kill()
        receipt = waiting.result()
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "unknown")
    assert "The robot may have done it" in receipt.json()["reason"]


def test_a_goal_runs_to_its_result_and_shows_in_every_browser(
    kiosk: Server, robot: CycloneRobot
) -> None:
    robot.fibonacci(step_s=2)
    receipt = press(kiosk, "count", id="goal-1")
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "accepted")
    assert "waiting for the robot" in kiosk.widget("count")["reason"]
    until(lambda: "so far [0, 1, 1" in kiosk.widget("count")["result"], "its feedback is shown")
    assert kiosk.widget("count")["goal"] == "EXECUTING"
    robot.fibonacci(step_s=0.01)
    until(lambda: kiosk.widget("count")["outcome"] == "succeeded", "its result is there")
    assert kiosk.widget("count")["goal"] == "SUCCEEDED"
    assert "[0, 1, 1, 2, 3, 5, 8]" in kiosk.widget("count")["result"]
    assert kiosk.widget("count")["enabled"]
    assert press(kiosk, "count", id="goal-1").json()["outcome"] == "succeeded"
    assert len(robot.goals()) == 1


def test_a_goal_is_canceled_from_the_panel(kiosk: Server, robot: CycloneRobot) -> None:
    robot.fibonacci(step_s=30)
    assert press(kiosk, "count").json()["outcome"] == "accepted"
    until(lambda: kiosk.widget("count")["stoppable"], "it can be canceled")
    canceled = kiosk.http.post("/widgets/count/cancel")
    assert (canceled.status_code, canceled.json()["outcome"]) == (200, "accepted")
    until(lambda: kiosk.widget("count")["outcome"] == "canceled", "it was canceled")
    nothing = kiosk.http.post("/widgets/count/cancel")
    assert (nothing.status_code, nothing.json()["outcome"]) == (409, "refused")


def cancel(kiosk: Server, **fields: Any) -> httpx.Response:
    return kiosk.http.post("/widgets/count/cancel", json=fields)


def test_a_cancel_of_a_goal_that_is_over_stops_no_other(kiosk: Server, robot: CycloneRobot) -> None:
    robot.fibonacci(step_s=0.01)
    press(kiosk, "count", id="goal-1")
    until(lambda: kiosk.widget("count")["outcome"] == "succeeded", "the first one is over")
    robot.fibonacci(step_s=30)
    press(kiosk, "count", id="goal-2")
    until(lambda: kiosk.widget("count")["stoppable"], "the second one runs")
    assert kiosk.widget("count")["press"] == "goal-2"
    late = cancel(kiosk, press="goal-1", seen="0-1", at="2020-01-01T00:00:00Z", inputs={})
    assert (late.status_code, late.json()["outcome"]) == (409, "refused")
    assert late.json()["reason"].startswith("Nothing was canceled. That goal has ended")
    assert cancel(kiosk, press=2).status_code == 422
    assert robot.requests("/fibonacci/_action/cancel_goal") == []
    assert cancel(kiosk, press="goal-2", seen="0-1", at="2020-01-01T00:00:00Z").status_code == 200
    until(lambda: kiosk.widget("count")["outcome"] == "canceled", "it was canceled, however late")


def test_a_page_cancels_the_goal_that_it_showed(kiosk: Server, robot: CycloneRobot, page: Page) -> None:
    robot.fibonacci(step_s=30)
    page.goto(kiosk.url)
    button = page.locator('[data-widget="count"]').get_by_role("button", name="Cancel")
    press(kiosk, "count", id="goal-1")
    expect(button).to_have_attribute("value", "goal-1")
    robot.cancel()
    expect(button).to_be_disabled()
    until(lambda: kiosk.widget("count")["enabled"], "it is over")
    press(kiosk, "count", id="goal-2")
    expect(button).to_have_attribute("value", "goal-2")
    page.reload()
    expect(button).to_have_attribute("value", "goal-2")
    with page.expect_request("**/cancel") as sent:
        button.click()
    assert json.loads(sent.value.post_data or "")["press"] == "goal-2"
    until(lambda: kiosk.widget("count")["enabled"], "canceled")
    assert kiosk.widget("count")["outcome"] == "canceled"
    form = {"content-type": "application/x-www-form-urlencoded"}
    press(kiosk, "count", id="goal-3")
    until(lambda: kiosk.widget("count")["goal"] == "EXECUTING", "another one runs")
    kiosk.http.post("/widgets/count/cancel", content="_press=goal-2&words=", headers=form)
    assert kiosk.widget("count")["goal"] == "EXECUTING"
    kiosk.http.post("/widgets/count/cancel", content="_press=goal-3&words=", headers=form)
    until(lambda: kiosk.widget("count")["outcome"] == "canceled", "canceled by a form")
    assert len(robot.requests("/fibonacci/_action/cancel_goal")) == 2


@pytest.mark.parametrize(("end", "outcome"), [("abort", "aborted"), ("cancel", "canceled")])
def test_a_goal_that_the_robot_ends_itself(
    kiosk: Server, robot: CycloneRobot, end: str, outcome: str
) -> None:
    robot.fibonacci(step_s=30)
    assert press(kiosk, "count").json()["outcome"] == "accepted"
    getattr(robot, end)()
    until(lambda: kiosk.widget("count")["outcome"] == outcome, outcome)
    assert kiosk.widget("count")["goal"] == outcome.upper()


def test_a_goal_that_the_robot_rejects(kiosk: Server) -> None:
    receipt = press(kiosk, "refused")
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "rejected")
    assert kiosk.widget("refused")["enabled"]
    assert kiosk.widget("refused")["goal"] == ""


def test_another_clients_goal_is_not_shown_as_ours(
    kiosk: Server, robot: CycloneRobot, client: Client
) -> None:
    robot.fibonacci(step_s=30)
    other = uuid_of(b"other goal" + bytes(6))
    sent = client.call("fibonacci/_action/send_goal", f"{FIBONACCI}_SendGoal", other, goal_of(45))
    assert sent.accepted
    assert press(kiosk, "refused").json()["outcome"] == "rejected"
    assert press(kiosk, "count").json()["outcome"] == "accepted"
    robot.fibonacci(step_s=0.1)
    until(lambda: kiosk.widget("count")["outcome"] == "succeeded", "ours has ended")
    assert [goal["status"] for goal in robot.goals()] == [2, 4], "the other's goes on"
    assert kiosk.widget("count")["goal"] == "SUCCEEDED"
    assert (kiosk.widget("refused")["goal"], kiosk.widget("refused")["busy"]) == ("", False)
    robot.cancel()


def test_node_that_ends_during_a_goal_leaves_the_result_unknown_and_the_widget_usable(
    own_kiosk: Server,
    own_cyclone_bridge: Bridge,
    cyclone_robots: Callable[..., CycloneRobot],
) -> None:
    robot = cyclone_robots(own_cyclone_bridge.domain)
    until(lambda: own_kiosk.widget("count")["enabled"], "offered")
    robot.fibonacci(step_s=30)
    assert press(own_kiosk, "count", id="goal-1").json()["outcome"] == "accepted"
    robot.end()
    until(lambda: own_kiosk.widget("count")["goal"] == "UNKNOWN", "it is not known any more")
    assert "stopped offering /fibonacci" in own_kiosk.widget("count")["result"]
    assert press(own_kiosk, "count", id="goal-1").json()["outcome"] == "unknown"
    robot = cyclone_robots(own_cyclone_bridge.domain)
    until(lambda: "no longer knows this goal" in own_kiosk.widget("count")["result"], "asked for again")
    until(lambda: own_kiosk.widget("count")["enabled"], "offered again")
    robot.fibonacci(step_s=30)
    assert press(own_kiosk, "count").json()["outcome"] == "accepted"
    robot.fibonacci(step_s=0.01)
    until(lambda: own_kiosk.widget("count")["goal"] == "SUCCEEDED", "another goal is done")


def test_a_goal_whose_answer_was_cut_off_is_found_again_and_can_be_canceled(
    own_kiosk: Server,
    own_cyclone_bridge: Bridge,
    cyclone_robots: Callable[..., CycloneRobot],
) -> None:
    robot = cyclone_robots(own_cyclone_bridge.domain)
    until(lambda: own_kiosk.widget("count")["enabled"], "offered")
    robot.fibonacci(step_s=30, answer_goals=False)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(press, own_kiosk, "count", id="goal-1")
        until(lambda: robot.goals(), "the robot is at it")
        own_cyclone_bridge.kill()
        receipt = waiting.result()
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "unknown")
    until(lambda: own_kiosk.widget("count")["goal"] == "UNKNOWN", "nothing is heard of it")
    own_cyclone_bridge.start()
    locked_until_found(own_kiosk)
    assert press(own_kiosk, "count", id="goal-1").json()["outcome"] == "accepted"
    until(lambda: robot.requests("/fibonacci/_action/get_result"), "its end is asked for")
    assert cancel(own_kiosk, press="goal-1").status_code == 200
    until(lambda: own_kiosk.widget("count")["outcome"] == "canceled", "canceled")
    assert len(robot.goals()) == 1


def locked_until_found(kiosk: Server) -> None:
    """A goal that was cut off: at no time another can be sent, before the robot reports it."""

    def unlocked() -> bool:
        shown = kiosk.widget("count")
        assert not shown["enabled"], shown
        return bool(shown["goal"] == "EXECUTING")

    until(unlocked, "it is found again")
    assert kiosk.widget("count")["stoppable"]


def test_cut_off_goal_locks_its_button_until_the_goal_is_reported(
    own_kiosk: Server, own_cyclone_bridge: Bridge, cyclone_robots: Callable[..., CycloneRobot]
) -> None:
    robot = cyclone_robots(own_cyclone_bridge.domain)
    until(lambda: own_kiosk.widget("count")["enabled"], "offered")
    robot.fibonacci(step_s=30)
    assert press(own_kiosk, "count").json()["outcome"] == "accepted"
    until(lambda: own_kiosk.widget("count")["goal"] == "EXECUTING", "it runs")
    own_cyclone_bridge.kill()
    until(lambda: own_kiosk.widget("count")["goal"] == "UNKNOWN", "nothing is heard of it")
    own_cyclone_bridge.start()
    locked_until_found(own_kiosk)
    robot.cancel()
    until(lambda: own_kiosk.widget("count")["enabled"], "its end is known")


def counting(kiosk: Server, page: Page) -> Locator:
    """The widget of a goal, whose key was pressed."""
    page.goto(kiosk.url)
    count = widget(page, "count")
    count.get_by_role("button", name="Count", exact=True).click()
    return count


def test_a_goal_of_more_than_five_seconds_survives_a_reload(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    robot.fibonacci(step_s=3)
    count = counting(kiosk, page)
    expect(count.locator(".result")).to_contain_text("In progress")
    page.reload()
    expect(count.locator(".result")).to_contain_text("so far [0, 1, 1, 2")
    expect(count.locator(".goal")).to_have_text("Running")
    other = page.context.new_page()
    other.goto(kiosk.url)
    on_another_page = other.locator('[data-widget="count"]')
    expect(on_another_page.locator(".goal")).to_have_text("Running")
    expect(count.get_by_role("button", name="Cancel")).to_be_enabled()
    robot.fibonacci(step_s=0.1)
    expect(count.locator(".result")).to_contain_text("Succeeded")
    expect(count.locator(".goal")).to_be_empty()
    expect(on_another_page.locator(".goal")).to_be_empty()
    expect(count.get_by_role("button", name="Cancel")).to_be_disabled()
    expect(count.get_by_role("button", name="Count", exact=True)).to_be_enabled()


def test_a_goals_state_is_not_known_while_the_server_is_lost(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    robot.fibonacci(step_s=30)
    count = counting(kiosk, page)
    expect(count.locator(".goal")).to_have_text("Running")
    kiosk.process.send(signal.SIGSTOP)
    expect(count.locator(".goal")).to_have_text("unknown")
    kiosk.process.send(signal.SIGCONT)
    expect(count.locator(".goal")).to_have_text("Running")
    expect(count.get_by_role("button", name="Cancel")).to_be_enabled()


def test_late_reply_corrects_the_result_in_every_browser(
    kiosk: Server, robot: CycloneRobot, page: Page
) -> None:
    robot.answer_slow(seconds=6)
    page.goto(kiosk.url)
    other = page.context.new_page()
    other.goto(kiosk.url)
    page.get_by_role("button", name="Slow", exact=True).click()
    results = [browser_page.locator('[data-widget="slow"] .result') for browser_page in (page, other)]
    for result in results:
        expect(result).to_contain_text("No response within 1 s")
        expect(result).to_have_attribute("data-outcome", "timed_out")
    for result in results:
        expect(result).to_contain_text("Done at")
        expect(result).to_have_attribute("data-outcome", "succeeded")
    expect(page.locator('[data-widget="slow"] .receipt')).to_be_empty()


@pytest.mark.parametrize("manner", ["rclcpp", "rclpy"])
def test_a_cancel_that_the_robot_refuses_is_reported(
    kiosk: Server, robot: CycloneRobot, page: Page, manner: str
) -> None:
    robot.fibonacci(step_s=30, refuse_cancels=manner)
    page.goto(kiosk.url)
    count = page.locator('[data-widget="count"]')
    count.get_by_role("button", name="Count", exact=True).click()
    count.get_by_role("button", name="Cancel").click()
    expect(count.locator(".receipt")).to_contain_text("The robot refused to cancel")
    expect(count.locator(".goal")).to_have_text("Running")
    refused = cancel(kiosk)
    assert (refused.status_code, refused.json()["outcome"]) == (200, "rejected")
    assert kiosk.widget("count")["goal"] == "EXECUTING"
    robot.fibonacci(step_s=0.01, refuse_cancels="")
    expect(count.locator(".goal")).to_be_empty()


def test_calls_and_cancels_work_without_scripts(kiosk: Server, robot: CycloneRobot) -> None:
    form = {"content-type": "application/x-www-form-urlencoded"}
    added = kiosk.http.post("/widgets/add", content="_id=f1&words=", headers=form)
    assert added.status_code == 303
    assert "the sum is 42" in kiosk.http.get(added.headers["location"]).text
    robot.fibonacci(step_s=30)
    kiosk.http.post("/widgets/count", content="_id=f2&words=", headers=form)
    assert kiosk.http.post("/widgets/count/cancel", content="_id=f2", headers=form).status_code == 303
    until(lambda: kiosk.widget("count")["outcome"] == "canceled", "canceled")
