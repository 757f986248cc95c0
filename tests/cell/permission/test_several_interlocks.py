"""Several interlocks of one control: all have to permit, the first reason shows, all are listed."""

from typing import Any, Final

import pytest

from app.cell.permission.control import NO_CONTROL, ControlView
from app.cell.permission.press_permission import combined, judged
from app.cell.permission.verdict import PERMITTED, Verdict, locked
from app.cell.robot.state import RobotState
from app.cell.view.view import ViewContext, audience, build_view, for_audience
from app.panel.model import Panel
from app.system.texts import joined, say
from tests.cell.commands.test_holds import JOG, MOVES, SPEED, STOPS
from tests.cell.commands.test_holds import Bench as HoldBench
from tests.cell.commands.test_presses import Bench as PressBench
from tests.cell.commands.test_presses import refused
from tests.support.builders import (
    BOOL,
    ENABLED,
    FREE,
    GUARDED,
    MESSAGE,
    NOW,
    Table,
    endpoint,
    panel_of,
    permits,
    robot_there,
    says,
)
from tests.support.words import coded, why

DOORS: Final = "/doors_closed"
AIR: Final = "/air"
BOTH: Final = ["operation", "doors"]
FURTHER: Final[list[Table]] = [
    {"id": "doors", "label": "open doors", "topic": DOORS, "max_age_s": 5.0},
    {"id": "air", "label": "Air", "topic": AIR, "type": "std_msgs/msg/Float64", "min": 5.0,
     "unit": "bar"},
]  # fmt: skip
WAITS: Final = say("interlock_waiting", topic=ENABLED, wanted=BOOL)
FORBIDS: Final = say("interlock_not_permitted", name="operation")
OLD_DOORS: Final = say("interlock_stale", topic="open doors", limit="5")
NO_DOORS: Final = say("interlock_not_permitted", name="open doors")


def cell(*widgets: Table, **more: Any) -> Panel:
    return panel_of(*(widgets or (MESSAGE, {**GUARDED, "interlock": BOTH})), further=FURTHER, **more)


def closes(robot: RobotState, closed: bool = True, at: float = NOW) -> None:
    endpoint(robot, "MP", DOORS, BOOL)
    says(robot, DOORS, closed, BOOL, at=at)


def verdict_of(robot: RobotState, panel: Panel, now: float = NOW) -> Verdict:
    (widget,) = panel.commands
    return judged(widget, panel.interlocks_of(widget), robot, now)


@pytest.mark.parametrize("permitted", [True, False])
@pytest.mark.parametrize("closed", [True, False])
def test_all_have_to_permit(permitted: bool, closed: bool) -> None:
    panel = cell()
    robot = robot_there(panel)
    permits(robot, permitted)
    closes(robot, closed)
    verdict = verdict_of(robot, panel)
    reasons = [FORBIDS] * (not permitted) + [NO_DOORS] * (not closed)
    assert verdict.permitted is (permitted and closed)
    assert verdict.reasons == reasons
    assert verdict.reason == (reasons[0] if reasons else None)


def test_the_order_of_the_file_says_which_is_reported_first() -> None:
    panel = cell(MESSAGE, {**GUARDED, "interlock": ["doors", "operation"]})
    robot = robot_there(panel)
    permits(robot, False)
    closes(robot, False)
    assert verdict_of(robot, panel).reasons == [NO_DOORS, FORBIDS]


def test_first_stale_interlock_ends_the_permission() -> None:
    panel = cell()
    robot = robot_there(panel)
    robot.settled_at = NOW - 10
    permits(robot)
    closes(robot)
    assert verdict_of(robot, panel) == Verdict(True, until=NOW + 5)
    assert verdict_of(robot, panel, NOW + 5).reasons == [OLD_DOORS]


def test_one_reason_is_reported_once() -> None:
    locked = Verdict(False, "interlock_waiting", WAITS)
    assert combined([locked, locked]).reasons == [WAITS]
    assert combined([]) is combined([PERMITTED, PERMITTED]) is PERMITTED


def test_without_a_way_that_is_the_only_reason() -> None:
    panel = cell()
    robot = robot_there(panel)
    robot.link_up = False
    assert verdict_of(robot, panel).reasons == [say("link_unreachable")]


def test_reason_of_the_command_itself_is_reported_first() -> None:
    panel = cell()
    robot = robot_there(panel)
    endpoint(robot, "MS", "/guarded", BOOL)
    permits(robot, False)
    closes(robot)
    wrong, then = verdict_of(robot, panel).reasons
    assert coded(wrong, "topic", "found") == ("topic_wrong_type", "/guarded", BOOL)
    assert then == FORBIDS


def test_a_view_lists_all_reasons_of_a_control_with_several() -> None:
    single = {**FREE, "id": "single", "topic": "/single", "interlock": "operation"}
    panel = cell(MESSAGE, {**GUARDED, "interlock": BOTH}, single)
    robot = robot_there(panel)
    closes(robot, False)
    shown = build_view(panel, robot, NOW).view["widgets"]
    assert shown["guarded"] == {
        "enabled": False,
        "reason": WAITS,
        "reasons": joined([WAITS, NO_DOORS], "between_lines"),
        "more": say("more_reasons", number=1),
    }
    assert shown["single"] == {"enabled": False, "reason": WAITS}
    permits(robot)
    shown = build_view(panel, robot, NOW).view["widgets"]
    assert [shown["guarded"]["reasons"], shown["guarded"]["reason"]] == [NO_DOORS] * 2
    closes(robot)
    shown = build_view(panel, robot, NOW).view["widgets"]
    assert shown["guarded"] == {"enabled": True, "reason": None, "reasons": "", "more": ""}


def test_without_control_that_is_the_only_reason() -> None:
    panel = cell(control={"required": True})
    robot = robot_there(panel)
    control: ControlView = {**NO_CONTROL, "required": True, "text": "Not in control."}
    lock = Verdict(False, "control_free", "Not in control.")
    built = build_view(panel, robot, NOW, ViewContext(control=control, control_lock=lock))
    view = for_audience(built.view, built.without_control, audience("free"))
    assert view["widgets"]["guarded"] == {
        "enabled": False, "reason": "Not in control.", "reasons": "Not in control.", "more": "",
    }  # fmt: skip
    assert view["widgets"]["message"] == {}


def test_a_link_that_locks_by_the_second_reason_says_so() -> None:
    panel = cell()
    robot = robot_there(panel)
    permits(robot, False)
    robot.update_publishers()
    link = build_view(panel, robot, NOW).view["link"]["node"]
    assert link["locks"] == say("locks", names=("Free",))
    endpoint(robot, "MP", DOORS, BOOL)
    robot.update_publishers()
    link = build_view(panel, robot, NOW).view["link"]["node"]
    assert (link["locks"], link["reason"]) == (
        say("locks", names=("Free",)),
        say("interlock_waiting", topic="open doors", wanted=BOOL),
    )


def test_press_is_refused_by_a_second_interlock() -> None:
    bench = PressBench(cell())
    closes(bench.robot, False)
    receipt = bench.press("guarded")
    assert refused(bench, receipt) == ("interlock", NO_DOORS)
    closes(bench.robot)
    assert bench.press("guarded", press_id="p2").outcome == "published"


def test_second_interlock_ends_a_hold() -> None:
    bench = HoldBench(panel=cell(SPEED, {**JOG, "interlock": BOTH}))
    closes(bench.robot)
    bench.begun()
    bench.pending.append(lambda: closes(bench.robot, False, at=bench.loop.now))
    bench.loop.pass_time(0.1)
    assert bench.points == [MOVES, STOPS]
    (receipt,) = bench.receipts
    assert (receipt.outcome, why(receipt.reason)) == ("aborted", NO_DOORS)
    assert bench.refused() == ("interlock", NO_DOORS)


def test_an_alarm_that_is_not_known_is_named_after_what_an_operator_can_act_on() -> None:
    alarm = locked("alarm_inhibits_unknown", name="Motor 1")
    door = locked("interlock_not_permitted", name="guard door")
    for order in ([alarm, door], [door, alarm]):
        verdict = combined(order)
        assert (verdict.code, [other.code for other in verdict.others]) == (door.code, [alarm.code])
    assert combined([alarm]).code == alarm.code
