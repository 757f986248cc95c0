"""The table of checks: its order, its causes, and that one more row locks everything."""

import math
from dataclasses import replace
from typing import Any, Final

import pytest

from app.cell.commands.holds import ActiveHold
from app.cell.permission import press_permission
from app.cell.permission.interlocks import interlock_verdict, link_verdict
from app.cell.permission.press_permission import (
    CHECKS,
    Check,
    PermissionRequest,
    ServerConditions,
    cause_of,
    combined,
    judged,
    permission,
    permissions,
)
from app.cell.permission.roles import ConfirmedBy, ConfirmLocks
from app.cell.permission.verdict import PERMITTED, WITHOUT_CONTROL, Verdict
from app.cell.robot.state import RobotState
from app.cell.view.view import build_view
from app.panel.model import Panel
from app.records.principal import Principal, anonymous
from tests.cell.commands.test_calls_and_goals import CALL
from tests.cell.commands.test_holds import JOG, SPEED
from tests.cell.commands.test_holds import Bench as HoldBench
from tests.cell.commands.test_presses import Bench as PressBench
from tests.cell.commands.test_presses import refused
from tests.support.builders import (
    FREE,
    GUARDED,
    INTERFACES,
    MESSAGE,
    NOW,
    panel_of,
    permits,
    robot_there,
)

pytestmark = pytest.mark.promise("press")

WHY = "An alarm is not acknowledged."
ALARM = Verdict(False, "alarm", WHY)


def locked(code: str) -> Verdict:
    return Verdict(False, code, f"locked by {code}")


def question(**more: Any) -> PermissionRequest:
    panel = panel_of(MESSAGE, FREE)
    robot = robot_there(panel)
    parts = {"link": PERMITTED, "interlocks": (), **more}
    return PermissionRequest(next(iter(panel.commands)), robot, NOW, **parts)


@pytest.fixture
def alarm(monkeypatch: pytest.MonkeyPatch) -> None:
    """One more row: what an alarm that locks will be."""
    row = Check("alarm", lambda request: ALARM if request.widget.id != "message" else None)
    monkeypatch.setattr(press_permission, "CHECKS", (*CHECKS[:3], row, *CHECKS[3:]))


def test_the_first_that_locks_is_reported() -> None:
    everything = ServerConditions(locked("control"), "The disk is full.", ending="server_shutting_down")
    one_press = question(link=locked("link"), interlocks=[locked("one")], grounds=everything)
    assert permission(one_press).code == "link"
    assert (
        permission(question(interlocks=[locked("one")], grounds=everything)).code
        == "server_shutting_down"
    )
    without = ServerConditions(locked("control"), "The disk is full.")
    log = permission(question(interlocks=[locked("one")], grounds=without))
    assert (log.code, log.reason, log.others) == ("log", "The disk is full.", ())
    control = permission(
        question(interlocks=[locked("one")], grounds=ServerConditions(locked("control")))
    )
    assert (control.code, control.others) == ("control", ())
    both = permission(question(interlocks=[locked("one"), PERMITTED, locked("two")]))
    assert both.reasons == ["locked by one", "locked by two"]
    assert permission(question(interlocks=[PERMITTED])) is PERMITTED


SATO: Final = Principal(anonymous("127.0.0.1"), "M. Sato")


@pytest.mark.parametrize(
    ("confirmation", "pressed", "who", "confirmed", "code"),
    [
        (False, True, SATO, None, "permitted"),
        ("pin", True, SATO, None, "confirm_needed_pin"),
        ("two_persons", True, SATO, None, "confirm_needed_two"),
        ("pin", True, SATO, ConfirmedBy("M. Sato", "", "pin"), "permitted"),
        ("pin", True, replace(SATO, user=""), None, "confirm_sign_in"),
        ("pin", True, replace(SATO, program=True), None, "confirm_by_program"),
        (
            "pin",
            False,
            SATO,
            None,
            "permitted",
        ),  # a page shows the button: it is asked for at the press
    ],
)
def test_what_a_person_confirms_is_refused_unless_a_person_has(
    confirmation: str | bool, pressed: bool, who: Principal, confirmed: ConfirmedBy | None, code: str
) -> None:
    panel = panel_of({**FREE, "confirm_press": confirmation})
    grounds = ServerConditions(
        who=who, pressed=pressed, confirmed=confirmed, confirm_locks=ConfirmLocks({})
    )
    command = next(iter(panel.commands))
    asked = PermissionRequest(command, robot_there(panel), NOW, PERMITTED, (), grounds)
    assert permission(asked).code == code


def test_what_a_person_confirms_is_locked_until_the_users_are_known() -> None:
    panel = panel_of({**FREE, "confirm_press": "pin"})
    command = next(iter(panel.commands))
    asked = PermissionRequest(command, robot_there(panel), NOW, PERMITTED, ())
    assert not permission(asked).permitted


def test_verdict_changes_at_the_soonest_deadline_of_all_interlocks() -> None:
    soon, later = Verdict(True, until=NOW + 1), Verdict(True, until=NOW + 2)
    assert permission(question(interlocks=[later, soon])).until == NOW + 1
    assert permission(question()).until == math.inf


def test_verdicts_of_several_are_reported_in_their_order() -> None:
    pair = combined([locked("one"), locked("two")])
    assert combined([PERMITTED, locked("zero"), pair]).reasons == [
        "locked by zero",
        "locked by one",
        "locked by two",
    ]


@pytest.mark.parametrize(
    ("code", "cause"),
    [
        ("link_no_bridge", "link"),
        ("service_unavailable", "link"),
        ("server_shutting_down", "link"),
        ("panel_being_taken", "link"),
        ("log", "log"),
        ("control_held", "interlock"),
        ("interlock_not_permitted", "interlock"),
        ("alarm", "interlock"),
    ],
)
def test_a_receipt_has_the_cause_of_the_code(code: str, cause: str) -> None:
    assert cause_of(code) == cause


@pytest.mark.usefixtures("alarm")
def test_a_check_more_locks_a_press_and_a_call() -> None:
    bench = PressBench(panel_of(MESSAGE, FREE, GUARDED, CALL))
    for number, widget in enumerate(("free", "guarded", CALL["id"])):
        receipt = bench.press(widget, {}, f"p{number}")
        assert refused(bench, receipt) == ("interlock", WHY)


@pytest.mark.usefixtures("alarm")
def test_a_check_more_keeps_a_hold_from_its_begin() -> None:
    assert HoldBench().refused() == ("interlock", WHY)


def test_a_check_more_ends_a_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = HoldBench()
    holding = bench.begun()
    assert isinstance(holding, ActiveHold)
    monkeypatch.setattr(press_permission, "CHECKS", (Check("alarm", lambda _: ALARM), *CHECKS))
    bench.holds.step()
    (receipt,) = bench.receipts
    assert receipt.outcome == "aborted"
    assert WHY in str(receipt.reason)


@pytest.mark.usefixtures("alarm")
def test_a_check_more_shows_in_the_view() -> None:
    panel = panel_of(MESSAGE, FREE, GUARDED, CALL)
    robot = robot_there(panel)
    permits(robot)
    shown = build_view(panel, robot, NOW).view["widgets"]
    for widget in ("free", "guarded", CALL["id"]):
        assert (shown[widget]["enabled"], shown[widget]["reason"]) == (False, WHY)
    assert judged(next(iter(panel.commands)), (), robot, NOW) is ALARM


def test_a_stop_needs_no_control_but_everything_else() -> None:
    panel = panel_of(
        {**FREE, "id": "go", "message": {"data": "go"}, "role": "start"},
        {**GUARDED, "id": "halt", "message": {"data": "halt"}, "role": "stop"},
        {**GUARDED, "id": "same_interlock", "message": {"data": "go"}, "topic": "/go"},
    )
    robot = robot_there(panel)
    permits(robot)
    no_control = ServerConditions(control=locked("control"))
    assert codes_of(panel, robot, no_control) == {
        "go": "control",
        "halt": WITHOUT_CONTROL.code,
        "same_interlock": "control",
    }
    assert set(codes_of(panel, robot, ServerConditions()).values()) == {PERMITTED.code}
    no_log = ServerConditions(locked("control"), "The disk is full.")
    assert codes_of(panel, robot, no_log)["halt"] == "log"
    permits(robot, False)
    assert not codes_of(panel, robot, no_control)["halt"].startswith("permitted")


def codes_of(panel: Panel, robot: RobotState, grounds: ServerConditions) -> dict[str, str]:
    """The codes of all verdicts; each widget is judged alone and with the others to the same code."""
    link = link_verdict(robot, NOW)
    interlocks = {i.id: interlock_verdict(i, robot, NOW, link) for i in panel.interlocks}
    together = permissions(panel, robot, NOW, link, interlocks, grounds)
    for widget in panel.commands:
        alone = judged(widget, panel.interlocks_of(widget), robot, NOW, grounds)
        assert alone.code == together[widget.id].code
    return {name: verdict.code for name, verdict in together.items()}


def test_a_hold_needs_control_whatever_its_role() -> None:
    panel = panel_of(SPEED, {**JOG, "role": "stop"})
    robot = robot_there(panel)
    (hold,) = panel.commands
    no_control = ServerConditions(control=locked("control"))
    assert judged(hold, (), robot, NOW, no_control).code == "control"


STAMPED: Final = {
    **FREE,
    "topic": "/stamped",
    "type": "geometry_msgs/msg/PointStamped",
    "message": {"header": {"stamp": "{now}"}},
}


def test_what_needs_a_time_is_locked_while_the_simulated_time_is_not_known() -> None:
    """Not a stop, which is sent without it."""
    stop = {**STAMPED, "id": "halt", "role": "stop"}
    panel = panel_of(MESSAGE, FREE, {**STAMPED, "id": "goal"}, stop)
    robot = robot_there(panel)

    def locks() -> dict[str, str]:
        verdicts = permissions(panel, robot, NOW, link_verdict(robot, NOW), {})
        return {name: verdict.code for name, verdict in verdicts.items() if not verdict.permitted}

    assert locks() == {}
    simulated = robot.clock.begin_simulated()
    assert locks() == {"goal": "clock_awaited_lock"}
    simulated.put(INTERFACES.encode("rosgraph_msgs/msg/Clock", {"clock": {"sec": 1}}), 0.0)
    assert locks() == {}
