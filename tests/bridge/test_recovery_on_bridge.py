"""Goals that a server has sent, and the next one follows: through the real bridge, after a kill."""

import json
import signal
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.cell.commands.goals import goal_id
from app.records import Entry, Filter
from app.records.database import rows
from app.records.verify import verify
from tests.bridge.test_calls_on_bridge import PANEL, cancel, press
from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, Server, live, until
from tests.support.servers import panel_file

GET_RESULT = "/fibonacci/_action/get_result"
CANCEL_GOAL = "/fibonacci/_action/cancel_goal"

Start = Callable[[], Server]


@pytest.fixture
def start(
    cyclone_bridge: Bridge, tmp_path: Path, servers: Callable[[Server], Server]
) -> Callable[..., Server]:
    """Starts a server on the data of the one before."""

    def started(panel: str = "") -> Server:
        data = str(tmp_path / "data")
        path = panel or str(panel_file(tmp_path, PANEL))
        return servers(live(cyclone_bridge.endpoint, tmp_path, KIOSK_DATA=data, KIOSK_PANEL=path))

    return started


def with_a_goal(start: Start, press_id: str = "goal-1") -> Server:
    """A server from which a goal was sent that is under way."""
    kiosk = start()
    until(lambda: kiosk.widget("count")["enabled"], "offered")
    assert press(kiosk, "count", id=press_id).json()["outcome"] == "accepted"
    until(lambda: kiosk.widget("count")["goal"] == "EXECUTING", "it runs")
    return kiosk


def found_again(kiosk: Server) -> Server:
    until(lambda: kiosk.widget("count")["goal"] == "EXECUTING", "it is found")
    return kiosk


def logged(folder: Path, press_id: str = "goal-1") -> list[tuple[str, str]]:
    """What the log has of a press: (kind, outcome), the oldest first."""
    return [(entry.kind, entry.outcome) for entry in entries_of(folder, press_id)]


def entries_of(folder: Path, press_id: str) -> list[Entry]:
    newest_first = rows(folder / "data", Filter(every=True), None, 1000)
    return [row.entry for row in reversed(newest_first) if row.entry.press == press_id]


BROKEN_OFF = [("pressed", ""), ("closed", "accepted"), ("corrected", "unknown")]


@pytest.mark.long("detail")
@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
def test_after_a_restart_a_goal_is_followed_to_its_end(
    start: Start, robot: CycloneRobot, tmp_path: Path, by: signal.Signals
) -> None:
    robot.fibonacci(step_s=30)
    with_a_goal(start).end(by)
    again = start()
    shown = again.widget("count")
    assert (shown["busy"], shown["enabled"], shown["press"]) == (True, False, "goal-1")
    found_again(again)
    until(lambda: "waiting for the robot" in again.widget("count")["reason"], "joined, and locked")
    assert again.widget("count")["stoppable"]
    assert press(again, "count", id="goal-2").status_code == 409
    until(lambda: logged(tmp_path)[-1] == ("corrected", "accepted"), "logged")
    robot.fibonacci(step_s=0.05)
    until(lambda: again.widget("count")["outcome"] == "succeeded", "its end is shown")
    assert "[0, 1, 1, 2, 3, 5, 8]" in again.widget("count")["result"]
    assert again.widget("count")["enabled"]
    ended = [*BROKEN_OFF, ("corrected", "accepted"), ("corrected", "succeeded")]
    until(lambda: logged(tmp_path) == ended, "and logged")
    assert verify(tmp_path / "data").fault == ""
    ((goal),) = robot.goals()
    assert goal["id"] == goal_id(entries_of(tmp_path, "goal-1")[0].hash).hex
    assert robot.requests(CANCEL_GOAL) == []


def test_after_a_kill_a_goal_can_be_canceled(
    start: Start, robot: CycloneRobot, tmp_path: Path, page: Page
) -> None:
    robot.fibonacci(step_s=30)
    with_a_goal(start).end(signal.SIGKILL)
    again = start()
    page.goto(again.url)
    count = page.locator('[data-widget="count"]')
    expect(count.locator(".goal")).to_have_text("Running")
    expect(count.get_by_role("button", name="Count", exact=True)).to_be_disabled()
    count.get_by_role("button", name="Cancel").click()
    expect(count.locator(".goal")).to_be_empty()
    expect(count.get_by_role("button", name="Count", exact=True)).to_be_enabled()
    assert len(robot.requests(CANCEL_GOAL)) == 1
    until(lambda: logged(tmp_path)[-1] == ("corrected", "canceled"), "logged")


@pytest.mark.long("detail")
def test_goal_is_still_followed_after_a_second_kill(
    start: Start, robot: CycloneRobot, tmp_path: Path
) -> None:
    robot.fibonacci(step_s=30)
    with_a_goal(start).end(signal.SIGKILL)
    for _ in range(2):
        again = found_again(start())
        until(lambda: logged(tmp_path)[-1] == ("corrected", "accepted"), "logged")
        again.end(signal.SIGKILL)
    last = found_again(start())
    assert cancel(last, press="goal-1").json()["outcome"] == "accepted"
    until(lambda: last.widget("count")["outcome"] == "canceled", "canceled by its press")
    assert len(robot.goals()) == 1


def test_a_goal_that_ended_in_the_meantime_is_shown(
    start: Start, robot: CycloneRobot, tmp_path: Path
) -> None:
    robot.fibonacci(step_s=30)
    with_a_goal(start).end(signal.SIGKILL)
    robot.abort()
    again = start()
    until(lambda: again.widget("count")["outcome"] == "aborted", "its end is shown")
    assert again.widget("count")["result"].startswith("Aborted by the robot before ")
    until(lambda: logged(tmp_path) == [*BROKEN_OFF, ("corrected", "aborted")], "and logged")


def test_a_goal_that_the_robot_forgot_is_said_to_be_unknown_once(
    start: Start, robot: CycloneRobot, tmp_path: Path
) -> None:
    robot.fibonacci(step_s=30, keep_s=0.1)
    with_a_goal(start).end(signal.SIGKILL)
    robot.abort()
    again = start()
    until(lambda: again.widget("count")["enabled"], "open")
    assert "no longer knows this goal" in again.widget("count")["result"]
    until(lambda: logged(tmp_path) == [*BROKEN_OFF, ("corrected", "unknown")], "and logged")
    again.end()
    before = len(robot.requests(GET_RESULT))
    last = start()
    until(lambda: last.widget("count")["enabled"], "open")
    assert last.widget("count")["result"] == ""
    assert len(robot.requests(GET_RESULT)) == before
    assert len(logged(tmp_path)) == len(BROKEN_OFF) + 1


@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
def test_an_end_before_the_robots_answer_leaves_a_goal_that_is_found(
    start: Start, robot: CycloneRobot, tmp_path: Path, by: signal.Signals
) -> None:
    robot.fibonacci(step_s=30, answer_goals=False)
    kiosk = start()
    until(lambda: kiosk.widget("count")["enabled"], "offered")
    with kiosk.socket() as socket:
        socket.say(json.dumps({"widget": "count", "inputs": {}, "id": "goal-1"}))
        until(lambda: robot.goals(), "the robot is at it")
        kiosk.end(by)
    again = start()
    found_again(again)
    assert cancel(again, press="goal-1").status_code == 200
    until(lambda: again.widget("count")["outcome"] == "canceled", "canceled")
    ended = [
        ("pressed", ""),
        ("closed", "unknown"),
        ("corrected", "accepted"),
        ("corrected", "canceled"),
    ]
    until(lambda: logged(tmp_path) == ended, "and logged")


@pytest.mark.long("detail")
def test_a_goal_is_in_doubt_until_the_robot_is_there(
    own_cyclone_bridge: Bridge,
    cyclone_robots: Callable[..., CycloneRobot],
    servers: Callable[[Server], Server],
    tmp_path: Path,
) -> None:
    def start() -> Server:
        data, panel = str(tmp_path / "data"), str(panel_file(tmp_path, PANEL))
        bridge = own_cyclone_bridge.endpoint
        return servers(live(bridge, tmp_path, KIOSK_DATA=data, KIOSK_PANEL=panel))

    first = cyclone_robots(own_cyclone_bridge.domain)
    first.fibonacci(step_s=30)
    with_a_goal(start).end(signal.SIGKILL)
    first.end()
    again = start()
    until(lambda: "does not offer /fibonacci" in (again.widget("count")["reason"] or ""), "joined")
    shown = again.widget("count")
    assert "may still be running" in shown["result"]
    assert (shown["goal"], shown["busy"], shown["stoppable"]) == ("UNKNOWN", True, False)
    assert cancel(again, press="goal-1").json()["code"] == "cancel_may_not_have_arrived"
    cyclone_robots(own_cyclone_bridge.domain)
    until(lambda: again.widget("count")["enabled"], "offered, and the robot does not know it")
    assert "no longer knows this goal" in again.widget("count")["result"]


def test_goal_before_a_restart_is_unknown_without_a_log(
    start: Callable[..., Server], robot: CycloneRobot, tmp_path: Path
) -> None:
    path = tmp_path / "unlogged.toml"
    path.write_text(PANEL.replace("[[page]]", "[log]\nenabled = false\n\n[[page]]", 1))
    robot.fibonacci(step_s=30)
    with_a_goal(lambda: start(str(path))).end(signal.SIGKILL)
    again = start(str(path))
    until(lambda: again.widget("count")["enabled"], "open")
    assert again.widget("count")["result"] == ""
    late = cancel(again, press="goal-1")
    assert late.json()["code"] == "cancel_goal_ended"
    robot.cancel()
