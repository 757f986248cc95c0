"""A press: judged by the server, sent once, answered with a receipt."""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from typing import Any, Final

import pytest

from app.cell.commands.presses import ends_with
from app.cell.commands.receipts import RECEIPTS_KEPT, Receipt
from app.cell.permission.control import ControlAuthority
from app.cell.robot.state import RobotState, Sample
from app.panel.model import Panel
from app.panel.rules import ControlRules
from app.records.principal import Clients, Principal
from app.system.errors import LinkError, NotFound
from app.system.texts import TextLike, joined, say
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    FREE,
    GUARDED,
    HEARD,
    INTERFACES,
    MESSAGE,
    NOW,
    PROGRAM,
    TEXT,
    FakeTransport,
    Table,
    endpoint,
    guard_of,
    panel_of,
    permits,
    press_of,
    press_widget,
    presses_of,
    robot_there,
    sending_of,
    small_panel,
)
from tests.support.words import coded, english, why

pytestmark = pytest.mark.promise("receipt")

PATH = "nav_msgs/msg/Path"


class Way(FakeTransport):
    """The way to the robot, as a press needs it: it keeps what was put."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, bytes]] = []
        self.listened_to = True
        self.fails: str | None = None

    def put(self, key: str, payload: bytes) -> None:
        if self.fails:
            raise LinkError(self.fails)
        self.sent.append((key, payload))

    def has_reader(self, key: str) -> bool:
        return self.listened_to

    @property
    def texts(self) -> list[str]:
        return [INTERFACES.decode(TEXT, payload).data for _, payload in self.sent]


class Bench:
    """Presses on a robot that is there and permits, at a time that is set."""

    def __init__(self, panel: Panel | None = None, control: ControlAuthority | None = None) -> None:
        panel = panel or small_panel()
        self.now = NOW
        self.way = Way()
        self.robot = robot_there(panel)
        permits(self.robot)
        guard = guard_of(panel, self.robot, control)
        self._presses = presses_of(panel, self.robot, self.way, guard=guard, monotonic=lambda: self.now)
        self.receipt = self._presses.receipt
        self.command, self.limited = self._presses.widget, self._presses.limited
        self.typed = sending_of(panel, self.robot, self.way).parse_form

    def press(
        self,
        widget: str = "free",
        inputs: Mapping[str, Any] | None = None,
        press_id: str = "p1",
        who: Principal = PROGRAM,
    ) -> Receipt:
        inputs = {"message": "hello"} if inputs is None else inputs
        return asyncio.run(press_widget(self._presses, widget, inputs, press_id, who))

    def cancel(self, widget: str) -> Receipt:
        return asyncio.run(self._presses.cancel(press_of(self._presses.widget(widget), {}, "")))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def refused(bench: Bench, receipt: Receipt) -> tuple[str, TextLike]:
    """Cause and reason of a press that sent nothing."""
    assert receipt.outcome == "refused"
    assert bench.way.sent == []
    return receipt.cause, why(receipt.reason)


def test_a_press_sends_its_message_once(bench: Bench) -> None:
    receipt = bench.press()
    assert (receipt.outcome, receipt.cause) == ("published", "")
    assert bench.way.sent == [("free", b"\0\1\0\0\6\0\0\0hello\0")]


def test_now_is_the_time_of_sending_and_no_input() -> None:
    message = {"poses": [{}, {"header": {"stamp": "{now}", "frame_id": "{message}"}}]}
    panel = panel_of(MESSAGE, {**FREE, "type": PATH, "message": message})
    bench = Bench(panel)
    before = time.time_ns()
    receipt = bench.press(inputs={"message": "map"})
    after = time.time_ns()
    assert receipt.outcome == "published"
    assert receipt.inputs == {"message": "map"}
    ((_, payload),) = bench.way.sent
    first, second = INTERFACES.decode(PATH, payload).poses
    assert (first.header.stamp.sec, first.pose.orientation.w) == (0, 1.0)
    assert second.header.frame_id == "map"
    assert before <= second.header.stamp.sec * 10**9 + second.header.stamp.nanosec <= after
    again = bench.press(inputs={"message": "map", "now": "12:00"}, press_id="p2")
    assert (again.outcome, again.cause) == ("refused", "input")
    assert 'there is no input "now" on this panel' in str(again.reason)


def test_receipt_has_the_documented_fields(bench: Bench) -> None:
    answer = bench.press(press_id="p7").as_json()
    assert list(answer) == ["id", "widget", "outcome", "code", "reason", "at"]
    assert (answer["id"], answer["widget"], answer["outcome"]) == ("p7", "free", "published")
    assert answer["code"] == "published"
    assert str(answer["reason"]).startswith("Sent at ")
    assert datetime.fromisoformat(str(answer["at"])).utcoffset() == timedelta(0)


def test_the_robots_namespace_stands_before_the_key() -> None:
    bench = Bench(small_panel(namespace="/robot1"))
    bench.press()
    assert [key for key, _ in bench.way.sent] == ["robot1/free"]


def test_a_press_without_a_subscriber_is_sent_but_unknown(bench: Bench) -> None:
    bench.way.listened_to = False
    receipt = bench.press()
    assert (receipt.outcome, receipt.cause) == ("unknown", "")
    assert coded(receipt.reason, "topic") == ("press_no_subscriber", "/free")
    assert bench.way.texts == ["hello"]


def test_a_permitted_press_behind_an_interlock_is_sent(bench: Bench) -> None:
    assert bench.press("guarded").outcome == "published"
    assert [key for key, _ in bench.way.sent] == ["guarded"]


def forbids(bench: Bench) -> None:
    permits(bench.robot, False)


def cuts(bench: Bench) -> None:
    bench.robot.mark_peer_lost(BRIDGE, 2)


def garbles(bench: Bench) -> None:
    bench.robot.update("operation_enabled", Sample(b"true!", 2, NOW, NOW, BRIDGE))


def takes_another_type(bench: Bench) -> None:
    endpoint(bench.robot, "MP", ENABLED, TEXT)


def listens_with_another_type(bench: Bench) -> None:
    endpoint(bench.robot, "MS", "/guarded", BOOL)


@pytest.mark.parametrize(
    ("happens", "code", "about"),
    [
        (forbids, "interlock_not_permitted", {"name": "operation"}),
        (cuts, "interlock_connection_lost", {"topic": ENABLED}),
        (garbles, "interlock_unreadable", {"topic": ENABLED}),
        (takes_another_type, "topic_wrong_type", {"topic": ENABLED, "found": TEXT}),
        (listens_with_another_type, "topic_wrong_type", {"topic": "/guarded", "found": BOOL}),
    ],
)
def test_a_forged_press_is_refused_with_its_reason(
    bench: Bench, happens: Callable[[Bench], None], code: str, about: Mapping[str, str]
) -> None:
    happens(bench)
    cause, reason = refused(bench, bench.press("guarded"))
    assert cause == "interlock"
    assert coded(reason, *about) == (code, *about.values())


def test_a_press_before_the_robot_permitted_is_refused() -> None:
    bench = Bench(panel_of(MESSAGE, GUARDED, interlock={"topic": "/estop_ok"}))
    cause, reason = refused(bench, bench.press("guarded"))
    assert (cause, reason) == ("interlock", say("interlock_waiting", topic="/estop_ok", wanted=BOOL))


def test_a_permission_is_judged_at_the_time_of_the_press() -> None:
    bench = Bench(small_panel({"max_age_s": 2}))
    endpoint(bench.robot, "MP", ENABLED, BOOL)
    bench.now = NOW + 1.9
    assert bench.press("guarded", press_id="p1").outcome == "published"
    bench.now = NOW + 2
    late = bench.press("guarded", press_id="p2")
    assert (late.outcome, late.cause) == ("refused", "interlock")
    assert len(bench.way.sent) == 1


def loses_link(robot: RobotState) -> None:
    robot.link_up = False


def loses_bridge(robot: RobotState) -> None:
    robot.graph.apply_token(f"@/{BRIDGE}/@ros2_lv", False)


def goes_silent(robot: RobotState) -> None:
    robot.graph.update_versions({})


def joins(robot: RobotState) -> None:
    robot.settled_at = math.inf


@pytest.mark.parametrize(
    ("happens", "code"),
    [
        (loses_link, "link_unreachable"),
        (loses_bridge, "link_no_bridge"),
        (goes_silent, "link_bridge_silent"),
        (joins, "link_connecting"),
    ],
)
@pytest.mark.parametrize("widget", ["free", "guarded"])
def test_without_a_way_to_the_robot_nothing_is_sent(
    bench: Bench, happens: Callable[[RobotState], None], code: str, widget: str
) -> None:
    happens(bench.robot)
    cause, reason = refused(bench, bench.press(widget))
    assert (cause, coded(reason)) == ("link", (code,))


def test_refused_put_counts_as_not_sent(bench: Bench) -> None:
    bench.way.fails = "can't send on free: closed"
    cause, reason = refused(bench, bench.press())
    assert (cause, reason) == ("link", "can't send on free: closed")


@pytest.mark.parametrize(
    ("inputs", "why"),
    [
        ({}, 'the input "message" is missing'),
        ({"massage": "x"}, 'there is no input "massage" on this panel'),
        ({"message": "x", "heard": "y"}, 'there is no input "heard" on this panel'),
        ({"message": "x", "guarded": "y"}, 'there is no input "guarded" on this panel'),
        ({"message": None}, 'Message ("message") must be text, not null'),
        ({"message": 5}, "must be text, not 5"),
        ({"message": True}, "must be text, not true"),
        ({"message": math.nan}, "must be text, not nan"),
        ({"message": ["x"]}, 'must be text, not ["x"]'),
        ({"message": {"data": "x"}}, "must be text"),
        ({"message": "123456789"}, "Message is 9 characters long; 8 are allowed"),
        ({"message": "a\0b"}, "has a NUL character"),
        ({"message": "\ud800"}, "is not valid Unicode text"),
    ],
)
def test_a_bad_input_is_refused_with_its_reason(
    bench: Bench, inputs: Mapping[str, Any], why: str
) -> None:
    cause, reason = refused(bench, bench.press(inputs=inputs))
    assert cause == "input"
    assert why in str(reason)


def test_a_huge_value_makes_no_huge_reason(bench: Bench) -> None:
    _, reason = refused(bench, bench.press(inputs={"message": ["x" * 10_000]}))
    assert len(str(reason)) < 200


@pytest.mark.parametrize(
    "text", ["", "12345678", "漢字漢字漢字漢字", "🤖" * 8, "{x}", "{{}}", "a\nb", "<b>"]
)
def test_a_text_arrives_as_it_was_typed(bench: Bench, text: str) -> None:
    assert bench.press(inputs={"message": text}).outcome == "published"
    assert bench.way.texts == [text]


def test_an_input_that_the_message_does_not_name_may_come_along() -> None:
    other = {**MESSAGE, "id": "other"}
    bench = Bench(panel_of(MESSAGE, other, FREE))
    assert bench.press(inputs={"message": "hello", "other": "x"}).outcome == "published"
    assert bench.way.texts == ["hello"]


REACH = {"id": "reach", "kind": "slider", "label": "Reach", "min": -1.0, "max": 1.0, "default": 0.25}
MODE = {
    "id": "mode",
    "kind": "select",
    "label": "Mode",
    "options": [{"value": 1, "label": "One"}, {"value": 2, "label": "Two"}],
    "default": 2,
}
ON = {"id": "on", "kind": "toggle", "label": "On", "default": False}
COUNT = {"id": "count", "kind": "number", "label": "Count", "min": 0, "max": 9, "default": 5}
ALL = "{message} {reach} {mode} {on} {count}"


def test_an_input_with_a_default_may_be_left_out() -> None:
    inputs = [{**MESSAGE, "default": "hi"}, REACH, MODE, ON, COUNT]
    bench = Bench(panel_of(*inputs, {**FREE, "message": {"data": ALL}}))
    receipt = bench.press(inputs={})
    assert bench.way.texts == ["hi 0.25 2 false 5"]
    used = {"message": "hi", "reach": 0.25, "mode": 2, "on": False, "count": 5}
    assert receipt.inputs == used
    assert bench.press(inputs=used) == receipt  # the same press, said in full
    bench.press(inputs={"reach": -1, "mode": 1}, press_id="p2")
    assert bench.way.texts == ["hi 0.25 2 false 5", "hi -1.0 1 false 5"]


def test_an_input_is_sent_in_the_unit_of_the_robot_and_logged_as_it_was_entered() -> None:
    way = {"id": "way", "kind": "slider", "label": "Way", "min": 0, "max": 500, "unit": "mm"}
    turn = {"id": "turn", "kind": "number", "label": "Turn", "min": 0, "max": 180, "unit": "°"}
    point = {"x": "{way}", "y": "-{way}", "z": "{turn}"}
    panel = panel_of(
        {**way, "send_unit": "m"},
        {**turn, "send_unit": "rad"},
        {**FREE, "type": "geometry_msgs/msg/Point", "message": point},
    )
    bench = Bench(panel)
    receipt = bench.press(inputs={"way": 40, "turn": 180})
    assert receipt.inputs == {"way": 40, "turn": 180}
    ((_, payload),) = bench.way.sent
    sent = INTERFACES.decode("geometry_msgs/msg/Point", payload)
    assert (sent.x, sent.y, sent.z) == (0.04, -0.04, math.pi)
    too_far = bench.press(inputs={"way": 501, "turn": 0}, press_id="p2")
    assert too_far.outcome == "refused"
    assert "0 to 500 mm" in english(too_far.reason)


def test_a_whole_number_stays_whole_where_each_step_does() -> None:
    way = {"id": "way", "kind": "number", "label": "Way", "min": -1.0, "max": 1.0, "step": 0.1}
    table = {**FREE, "type": "std_msgs/msg/Int16", "message": {"data": "{way}"}}
    bench = Bench(panel_of({**way, "scale": 1000, "offset": -20}, table))
    bench.press(inputs={"way": 0.3})
    ((_, payload),) = bench.way.sent
    assert INTERFACES.decode("std_msgs/msg/Int16", payload).data == 280


@pytest.mark.parametrize("table", [MESSAGE, REACH, MODE, ON, COUNT])
def test_an_input_without_a_default_in_the_file_may_not_be_left_out(table: Table) -> None:
    plain = {key: value for key, value in table.items() if key != "default"}
    bench = Bench(panel_of(plain, {**FREE, "message": {"data": f"a {{{table['id']}}}"}}))
    cause, reason = refused(bench, bench.press(inputs={}))
    assert (cause, reason) == ("input", f'the input "{table["id"]}" is missing')


def test_a_message_may_need_no_input() -> None:
    bench = Bench(panel_of({**FREE, "message": {"data": "start"}}))
    assert bench.press(inputs={}).outcome == "published"
    assert bench.way.texts == ["start"]


@pytest.mark.parametrize("widget", ["none", "message", "heard", "operation", ""])
def test_widget_that_is_not_a_command_is_not_found(bench: Bench, widget: str) -> None:
    with pytest.raises(NotFound, match=f'there is no widget "{widget}" that can be pressed'):
        bench.press(widget)
    assert bench.receipt("p1") is None


def test_the_same_id_again_is_the_same_press(bench: Bench) -> None:
    first = bench.press()
    assert bench.press() is first
    assert bench.receipt("p1") is first
    assert len(bench.way.sent) == 1


def test_a_press_over_the_limit_is_no_press_and_may_be_made_again(bench: Bench) -> None:
    press = press_of(bench.command("free"), {"message": "hello"}, "p1")
    limited = bench.limited(press)
    assert (limited.id, limited.outcome, limited.cause) == ("p1", "refused", "limit")
    assert bench.receipt("p1") is None
    shown = bench.limited(press, shown=True)  # a page without scripts reads it
    assert shown.id != "p1"
    assert bench.receipt(shown.id) == shown
    assert bench.press().outcome == "published"


SOON: Final = say("press_too_soon")
OTHER: Final = say("press_in_progress")


@pytest.mark.parametrize(
    ("text", "does"),
    [
        (SOON, True),
        (OTHER, False),
        ("press_too_soon", False),
        (joined([OTHER, SOON]), True),
        (joined([SOON, OTHER]), False),
        (joined([OTHER, joined([OTHER, SOON])]), True),
        (say("press_last_result", label="Go", said=SOON), False),
    ],
)
def test_a_sentence_is_not_said_twice_in_a_reason(text: TextLike, does: bool) -> None:
    assert ends_with(text, SOON) is does


def test_another_id_is_another_press(bench: Bench) -> None:
    bench.press(press_id="p1")
    bench.press(press_id="p2")
    assert len(bench.way.sent) == 2


def test_a_refused_press_stays_refused(bench: Bench) -> None:
    permits(bench.robot, False)
    first = bench.press("guarded")
    permits(bench.robot)
    assert bench.press("guarded") is first
    assert bench.way.sent == []


@pytest.mark.parametrize(
    ("widget", "inputs"),
    [("free", {"message": "other"}), ("free", {}), ("guarded", {"message": "hello"})],
)
def test_an_id_that_was_used_for_another_press_is_refused(
    bench: Bench, widget: str, inputs: Table
) -> None:
    first = bench.press()
    again = bench.press(widget, inputs)
    assert (again.outcome, again.cause) == ("refused", "input")
    assert coded(again.reason, "id") == ("press_id_reused", "p1")
    assert (again.widget, len(bench.way.sent)) == (widget, 1)
    assert bench.receipt("p1") is first


def test_a_receipt_keeps_the_inputs_that_it_came_with(bench: Bench) -> None:
    inputs = {"message": "hello"}
    receipt = bench.press(inputs=inputs)
    inputs["message"] = "other"
    assert receipt.inputs == {"message": "hello"}


def test_an_unknown_id_has_no_receipt(bench: Bench) -> None:
    assert bench.receipt("p1") is None


def test_the_oldest_receipts_are_forgotten() -> None:
    bench = Bench(panel_of(MESSAGE, HEARD, FREE))
    for number in range(RECEIPTS_KEPT + 1):
        bench.press(press_id=f"p{number}")
    assert bench.receipt("p0") is None
    assert bench.receipt("p1") is not None
    assert bench.receipt(f"p{RECEIPTS_KEPT}") is not None
    sent = len(bench.way.sent)
    again = bench.press(press_id="p0")
    assert coded(again.reason, "id") == ("press_already_made", "p0")
    assert (again.outcome, len(bench.way.sent)) == ("refused", sent)


@pytest.mark.parametrize(("permitted", "level"), [(True, logging.INFO), (False, logging.WARNING)])
def test_log_names_client_widget_and_result_of_each_press(
    bench: Bench, caplog: pytest.LogCaptureFixture, permitted: bool, level: int
) -> None:
    permits(bench.robot, permitted)
    with caplog.at_level(logging.INFO, "kiosk.presses"):
        receipt = bench.press("guarded")
    (record,) = caplog.records
    assert record.levelno == level
    for part in ("p1", "guarded", "127.0.0.1", "'hello'", receipt.outcome, str(receipt.reason)):
        assert part in record.getMessage()


class Locked:
    """Presses of a robot that another browser has control of."""

    def __init__(self) -> None:
        self.other = Principal(Clients().identify("0" * 32, "192.0.2.7"))
        control = ControlAuthority(ControlRules(required=True), "", monotonic=lambda: NOW)
        control.take(self.other)
        self.bench = Bench(control=control)


def test_press_without_control_is_refused_with_the_holders_name() -> None:
    bench = Locked().bench
    cause, reason = refused(bench, bench.press())
    assert cause == "interlock"
    assert coded(reason, "name", "robot") == ("control_held", "Panel 1 (192.0.2.7)", "the robot")


def test_press_of_the_client_in_control_is_sent() -> None:
    locked = Locked()
    assert locked.bench.press(who=locked.other).outcome == "published"


def test_the_reason_is_the_link_before_control_and_control_before_an_interlock() -> None:
    bench = Locked().bench
    permits(bench.robot, False)
    _, reason = refused(bench, bench.press("guarded", press_id="p1"))
    assert coded(reason) == ("control_held",)
    bench.robot.link_up = False
    cause, reason = refused(bench, bench.press("guarded", press_id="p2"))
    assert (cause, coded(reason)) == ("link", ("link_unreachable",))


HOME = {
    "id": "home",
    "kind": "action",
    "label": "Home",
    "action": "/count",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": 1},
}


def test_a_cancel_that_could_not_be_sent_has_a_receipt(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuses(*_: Any) -> None:
        raise LinkError("can't ask home/_action/cancel_goal: closed")

    bench = Bench(panel_of(HOME))
    monkeypatch.setattr("app.cell.commands.goals.GoalTracker.cancel", refuses)
    receipt = bench.cancel("home")
    assert (receipt.outcome, receipt.cause) == ("refused", "link")
    assert "can't ask home/_action/cancel_goal" in str(receipt.reason)


def test_cancelling_needs_no_control() -> None:
    control = ControlAuthority(ControlRules(required=True), "", monotonic=lambda: NOW)
    bench = Bench(panel_of(MESSAGE, HOME), control)
    assert bench.press("home").code == "control_free"
    assert bench.cancel("home").code == "cancel_nothing_in_progress"


SPEED = {
    "id": "speed", "kind": "slider", "label": "Speed", "min": -1, "max": 1, "step": 0.5, "unit": "m/s",
}  # fmt: skip
LIGHT = {"id": "light", "kind": "toggle", "label": "Light"}
MOVE = {**FREE, "type": "geometry_msgs/msg/Point", "message": {"x": "{speed}", "y": 0, "z": 0}}


def test_a_number_arrives_as_a_number() -> None:
    bench = Bench(panel_of(SPEED, MOVE))
    assert bench.press(inputs={"speed": -0.5}).outcome == "published"
    ((_, payload),) = bench.way.sent
    assert INTERFACES.decode("geometry_msgs/msg/Point", payload).x == -0.5


@pytest.mark.parametrize("entered", [1.5, 0.3, math.nan, "0.5", True])
def test_a_number_out_of_its_limits_is_refused_with_them(entered: Any) -> None:
    bench = Bench(panel_of(SPEED, MOVE))
    cause, reason = refused(bench, bench.press(inputs={"speed": entered}))
    assert cause == "input"
    code, *about = coded(reason, "label", "limits")
    assert code in ("input_outside_limits", "input_not_a_number")
    assert about == ["Speed", "−1 to 1 m/s, in steps of 0.5"]


def test_a_forms_texts_are_typed_by_their_inputs() -> None:
    panel = panel_of(SPEED, LIGHT, MESSAGE, MOVE)
    form = {"speed": "0.5", "light": "false", "message": "1", "other": "x"}
    assert Bench(panel).typed(form) == {"speed": 0.5, "light": False, "message": "1", "other": "x"}
