"""Hold-to-run, by the thousand: no message without a live holder and permission, one at the end."""

import logging
import math
import secrets
import time
from collections.abc import Callable, Mapping
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from app.cell.commands.holds import (
    LEASE_S,
    MAX_AHEAD_S,
    RELEASED,
    ActiveHold,
    HoldController,
    HoldMessages,
    Lease,
    sent_at,
)
from app.cell.commands.judge import PendingSamples, PressJudge
from app.cell.commands.receipts import Receipt
from app.cell.permission.interlocks import link_verdict
from app.cell.robot.clocks import CLOCK_TYPE
from app.cell.view.view import build_view
from app.panel.model import Panel
from app.ros.dialects import bridge_dialect
from app.system.errors import LinkError, NotFound
from app.system.texts import ENGLISH, TextLike, say, sentences
from app.web.routes.holds import END_REASONS
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    INTERFACES,
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
    robot_there,
    sending_of,
)
from tests.support.form import several
from tests.support.words import coded, why

pytestmark = pytest.mark.promise("hold")

POINT: Final = "geometry_msgs/msg/Point"
SPEED: Final[Table] = {
    "id": "speed", "kind": "slider", "label": "Speed", "min": 0.0, "max": 1.0, "step": 0.1,
}  # fmt: skip
JOG: Final[Table] = {
    "id": "jog",
    "kind": "hold",
    "label": "Jog",
    "topic": "/jog",
    "type": POINT,
    "message": {"x": "{speed}", "y": 0, "z": 0},
    "release": {"x": 0, "y": 0, "z": 0},
    "interlock": "operation",
}
BACK: Final[Table] = {**JOG, "id": "back", "label": "Back", "message": {"x": -1, "y": 0, "z": 0}}
ARM: Final[Table] = {**BACK, "id": "arm", "label": "Arm", "topic": "/arm"}
HALF: Final[Table] = {"speed": 0.5}
MOVES: Final = (0.5, 0.0, 0.0)
STOPS: Final = (0.0, 0.0, 0.0)
A_POINT: Final = INTERFACES.encode(POINT, {"x": 0, "y": 0, "z": 0})
WHO: Final = str(PROGRAM)
FORBIDS: Final = say("interlock_not_permitted", name="operation")


class Timer:
    def __init__(self, when: float, callback: Callable[[], object]) -> None:
        self.when, self.callback, self.cancelled = when, callback, False

    def cancel(self) -> None:
        self.cancelled = True


class Loop:
    """An event loop whose time is set: timers run in `pass_time`, late ones after a stall."""

    def __init__(self) -> None:
        self.now = NOW
        self.timers: list[Timer] = []

    def time(self) -> float:
        return self.now

    def call_at(self, when: float, callback: Callable[[], object]) -> Any:
        self.timers = [timer for timer in self.timers if not timer.cancelled]
        self.timers.append(Timer(when, callback))
        return self.timers[-1]

    def pass_time(self, seconds: float) -> None:
        end = self.now + seconds
        while timer := min((t for t in self.timers if not t.cancelled), key=_when, default=None):
            if timer.when > end:
                break
            self.now = max(self.now, timer.when)
            self.timers.remove(timer)
            timer.callback()
        self.now = end

    def stall(self, seconds: float) -> None:
        """Nothing runs; then what is due does."""
        self.now += seconds


def _when(timer: Timer) -> float:
    return timer.when


class Way(FakeTransport):
    """The way to the robot: it keeps what was put, and when."""

    def __init__(self, loop: Loop) -> None:
        self._loop = loop
        self.sent: list[tuple[float, tuple[float, float, float]]] = []
        self.payloads: list[bytes] = []
        self.fails = ""
        self.may_move: Callable[[], bool] = lambda: True

    def put(self, key: str, payload: bytes) -> None:
        if self.fails:
            raise LinkError(self.fails)
        assert key in ("jog", "arm")
        self.payloads.append(payload)
        if len(payload) == len(A_POINT):
            point = INTERFACES.decode(POINT, payload)
            self.sent.append((self._loop.now, (point.x, point.y, point.z)))
            assert self.sent[-1][1] == STOPS or self.may_move()


class Bench:
    """Holds on a robot that is there and permits, at a time that is set."""

    def __init__(self, *widgets: Table, panel: Panel | None = None, **more: Any) -> None:
        self.panel = panel or panel_of(SPEED, *(widgets or (JOG, BACK, ARM)))
        self.loop = Loop()
        self.way = Way(self.loop)
        self.robot = robot_there(self.panel)
        permits(self.robot, at=NOW)
        checked = sending_of(self.panel, self.robot, self.way).check_inputs
        self.receipts: list[Receipt] = []
        self.pending: list[Callable[[], None]] = []  # what has come from the robot, not taken in yet
        self.news: Callable[[], bool] = lambda: bool(self.pending)
        arrivals = PendingSamples(self.take, lambda: self.news())
        judge = PressJudge(self.panel, self.robot, guard_of(self.panel, self.robot), arrivals)
        messages = HoldMessages(INTERFACES, self.robot, self.way, checked)
        self.holds = HoldController(
            self.panel, self.robot, judge, messages, self.loop, changed=lambda: None, **more
        )

    def take(self) -> None:
        pending, self.pending = self.pending, []
        for change in pending:
            change()

    def begin(
        self, widget: str = "jog", inputs: Mapping[str, Any] = HALF, age_s: float = 0.0
    ) -> Receipt | ActiveHold:
        sent = self.loop.now - age_s
        press = press_of(self.holds.widget(widget), inputs, secrets.token_hex(8))
        return self.holds.begin(press, sent, self.receipts.append)

    def begun(self, widget: str = "jog") -> ActiveHold:
        holding = self.begin(widget)
        assert isinstance(holding, ActiveHold)
        return holding

    def refused(self, *arguments: Any, **named: Any) -> tuple[str, TextLike]:
        before = list(self.way.sent)
        receipt = self.begin(*arguments, **named)
        assert isinstance(receipt, Receipt)
        assert (receipt.outcome, self.way.sent) == ("refused", before)
        return receipt.cause, why(receipt.reason)

    def keep(self, holding: ActiveHold, seconds: float, every_s: float = 0.08) -> None:
        """Heartbeats that come at once, for some time."""
        end = self.loop.now + seconds - 1e-9
        while self.loop.now < end:
            self.loop.pass_time(min(every_s, end - self.loop.now))
            self.holds.beat(holding, holding.lease.last + 1, self.loop.now)

    @property
    def points(self) -> list[tuple[float, float, float]]:
        return [point for _, point in self.way.sent]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_hold_sends_at_its_rate_and_one_message_at_the_end(bench: Bench) -> None:
    holding = bench.begun()
    bench.keep(holding, 1.0)
    bench.holds.end(holding, RELEASED)
    bench.loop.pass_time(10)
    assert bench.points == [MOVES] * 20 + [STOPS]
    times = [at - NOW for at, _ in bench.way.sent[:-1]]
    assert times == pytest.approx([n * 0.05 for n in range(20)])
    (receipt,) = bench.receipts
    assert (receipt.outcome, receipt.widget, receipt.cause) == ("published", "jog", "")
    assert coded(receipt.reason, "seconds") == ("hold_released", "1.0")


def test_heartbeat_without_permission_ends_the_hold_at_once(bench: Bench) -> None:
    holding = bench.begun()
    permits(bench.robot, False)
    assert not bench.holds.beat(holding, 1, bench.loop.now)
    assert bench.points == [MOVES, STOPS]
    assert [receipt.code for receipt in bench.receipts] == ["interlock_not_permitted"]


def test_end_of_a_hold_that_ends_others_ends_each_once(bench: Bench) -> None:
    def ended(receipt: Receipt) -> None:
        bench.receipts.append(receipt)
        bench.holds.judge()

    for widget in ("jog", "arm"):
        bench.holds.begin(press_of(bench.holds.widget(widget), HALF, widget), bench.loop.now, ended)
    permits(bench.robot, False)
    bench.holds.judge()
    assert sorted(receipt.widget for receipt in bench.receipts) == ["arm", "jog"]


def test_reason_against_a_hold_is_known_before_its_begin_and_not_recorded(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    press = press_of(bench.holds.widget("jog"), HALF, "p1")
    assert bench.holds.refusal(press, bench.loop.now) is None
    bench.pending.append(lambda: permits(bench.robot, False))
    with caplog.at_level("INFO"):
        receipt = bench.holds.refusal(press, bench.loop.now)
    assert receipt is not None
    assert (receipt.outcome, receipt.cause, why(receipt.reason)) == ("refused", "interlock", FORBIDS)
    assert caplog.text == ""
    assert bench.points == []


def test_each_hold_message_has_its_own_sending_time() -> None:
    stamped = "geometry_msgs/msg/PointStamped"
    header = {"header": {"stamp": "{now}"}}
    jog = {**JOG, "type": stamped, "message": {**header, "point": {"x": "{speed}"}}, "release": header}
    bench = Bench(jog)
    before = time.time_ns()
    holding = bench.begun()
    bench.keep(holding, 0.2)
    bench.holds.end(holding, RELEASED)
    after = time.time_ns()
    sent = [INTERFACES.decode(stamped, payload) for payload in bench.way.payloads]
    assert [message.point.x for message in sent] == [0.5] * 4 + [0.0]
    stamps = [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for message in sent]
    assert stamps == sorted(set(stamps))
    assert before <= stamps[0]
    assert stamps[-1] <= after


def test_a_hold_has_simulated_time_and_its_stop_is_sent_without_it() -> None:
    stamped = "geometry_msgs/msg/PointStamped"
    header = {"header": {"stamp": "{now}"}}
    jog = {**JOG, "type": stamped, "message": {**header, "point": {"x": "{speed}"}}, "release": header}
    bench = Bench(jog)
    clock = bench.robot.clock
    clock.begin_simulated().put(INTERFACES.encode(CLOCK_TYPE, {"clock": {"sec": 7}}), 0.0)
    bench.begun()
    clock.begin_simulated()  # another simulation, of which no time has arrived
    bench.holds.judge()
    sent = [INTERFACES.decode(stamped, payload) for payload in bench.way.payloads]
    assert [(message.point.x, message.header.stamp.sec) for message in sent] == [(0.5, 7), (0.0, 0)]
    (receipt,) = bench.receipts
    assert (receipt.outcome, why(receipt.reason)) == ("aborted", say("clock_awaited_lock"))


def test_lost_certainty_ends_the_hold_and_still_sends_the_stop_message(bench: Bench) -> None:
    """Another node takes the topic for another type: who moves by it has to hear the stop."""
    bench.begun()
    endpoint(bench.robot, "MS", "/jog", TEXT)
    bench.holds.judge()
    assert bench.points == [MOVES, STOPS]
    (receipt,) = bench.receipts
    assert receipt.outcome == "aborted"
    assert coded(receipt.reason, "topic", "found") == ("topic_wrong_type", "/jog", TEXT)


@pytest.mark.parametrize("code", sorted(set(END_REASONS.values()) - {RELEASED} | {"hold_by_closing"}))
def test_every_other_end_says_why_and_wants_a_new_press(bench: Bench, code: str) -> None:
    holding = bench.begun()
    bench.holds.end(holding, code)
    assert bench.points == [MOVES, STOPS]
    (receipt,) = bench.receipts
    assert receipt.outcome == "aborted"
    assert f": {sentences(ENGLISH)[code]} Release and press again." in str(receipt.reason)
    assert bench.holds.beat(holding, 2, bench.loop.now) is False
    bench.loop.pass_time(10)
    assert bench.points == [MOVES, STOPS]


def test_missing_heartbeat_ends_a_hold_after_a_quarter_of_a_second(
    bench: Bench,
) -> None:
    holding = bench.begun()
    bench.loop.pass_time(0.12)
    bench.holds.beat(holding, 1, bench.loop.now - 0.04)  # 40 ms under way
    bench.loop.pass_time(10)
    stopped_at, point = bench.way.sent[-1]
    assert point == STOPS
    assert stopped_at - NOW == pytest.approx(0.08 + LEASE_S)
    assert max(at for at, point in bench.way.sent if point == MOVES) < stopped_at
    assert bench.receipts[0].code == "hold_by_heartbeat"


def test_a_late_heartbeat_prolongs_nothing(bench: Bench) -> None:
    holding = bench.begun()
    bench.loop.pass_time(0.2)
    assert bench.holds.beat(holding, 1, NOW - 0.1)  # older than the press itself
    bench.loop.pass_time(0.049)
    assert bench.holds.beat(holding, 2, NOW - 0.1)
    bench.loop.pass_time(0.002)
    assert bench.holds.beat(holding, 3, bench.loop.now) is False
    assert bench.points[-1] == STOPS


def test_a_heartbeat_that_was_there_already_prolongs_nothing(bench: Bench) -> None:
    holding = bench.begun()
    assert bench.holds.beat(holding, 5, NOW)
    bench.loop.pass_time(0.1)
    for number in (5, 4, 0, -1):
        assert bench.holds.beat(holding, number, bench.loop.now)
    bench.loop.pass_time(0.16)
    assert bench.points.count(STOPS) == 1


def test_lost_permission_ends_the_hold_at_once(bench: Bench) -> None:
    bench.begun()
    bench.loop.pass_time(0.01)
    permits(bench.robot, False)
    bench.holds.judge()
    assert bench.way.sent == [(NOW, MOVES), (NOW + 0.01, STOPS)]
    assert why(bench.receipts[0].reason) == FORBIDS
    permits(bench.robot, True)
    bench.loop.pass_time(10)
    assert bench.points == [MOVES, STOPS]


def test_samples_in_the_inbox_count_before_the_next_hold_message(bench: Bench) -> None:
    bench.begun()
    bench.pending.append(lambda: permits(bench.robot, False))
    bench.loop.pass_time(0.05)
    assert bench.points == [MOVES, STOPS]


def test_samples_during_encoding_count_before_the_hold_message_is_sent(bench: Bench) -> None:
    bench.begun()
    looks: list[bool] = []

    def news() -> bool:
        """It arrives between the verdict and the final check."""
        looks.append(True)
        if len(looks) == 1:
            bench.pending.append(lambda: permits(bench.robot, False))
        return bool(bench.pending)

    bench.news = news
    bench.loop.pass_time(0.05)
    assert looks
    assert bench.points == [MOVES, STOPS]
    assert why(bench.receipts[0].reason) == FORBIDS


def test_news_without_an_end_end_a_hold(bench: Bench) -> None:
    bench.begun()
    bench.news = lambda: True
    bench.loop.pass_time(0.05)
    assert bench.points == [MOVES, STOPS]


def test_stale_permission_ends_the_hold_at_its_expiry() -> None:
    bench = Bench(panel=panel_of(SPEED, JOG, interlock={"max_age_s": 0.5}))
    bench.robot.settled_at = NOW - 10
    endpoint(bench.robot, "MP", ENABLED, BOOL)
    holding = bench.begun()
    bench.keep(holding, 0.7)
    stopped_at, point = bench.way.sent[-1]
    assert point == STOPS
    assert stopped_at - NOW == pytest.approx(0.5)
    assert coded(bench.receipts[0].reason, "topic", "limit") == ("interlock_stale", ENABLED, "0.5")


def test_without_a_way_nothing_is_said_and_nothing_is_said_later(bench: Bench) -> None:
    bench.begun()
    bench.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), False)
    bench.holds.judge()
    (receipt,) = bench.receipts
    assert receipt.outcome == "unknown"
    assert why(receipt.reason) == say(
        "hold_stop_not_sent", why=link_verdict(bench.robot, NOW).reason or ""
    )
    bench.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), True)
    bench.holds.judge()
    bench.loop.pass_time(10)
    assert bench.points == [MOVES]


def test_refused_put_ends_the_hold(bench: Bench) -> None:
    bench.begun()
    bench.way.fails = "can't send on jog: gone"
    bench.loop.pass_time(0.05)
    assert bench.receipts[0].outcome == "unknown"
    assert str(bench.receipts[0].reason).count("can't send on jog: gone.") == 2
    bench.way.fails = ""
    bench.loop.pass_time(10)
    assert bench.points == [MOVES]


def test_stalled_server_ends_the_hold_and_sends_no_missed_messages(bench: Bench) -> None:
    holding = bench.begun()
    bench.loop.stall(0.4)
    assert bench.holds.beat(holding, 1, bench.loop.now) is False  # heartbeats waited in the socket
    bench.loop.pass_time(10)
    assert bench.way.sent == [(NOW, MOVES), (NOW + 0.4, STOPS)]
    assert bench.receipts[0].code == "hold_by_stall"


def test_after_a_short_stall_missed_messages_are_passed_over(bench: Bench) -> None:
    holding = bench.begun()
    bench.holds.beat(holding, 1, NOW)
    bench.loop.stall(0.22)
    bench.holds.beat(holding, 2, bench.loop.now)
    bench.loop.pass_time(0.06)
    times = [at - NOW for at, _ in bench.way.sent]
    assert times == pytest.approx([0, 0.22, 0.27])


def test_a_second_browser_is_refused_and_changes_nothing(bench: Bench) -> None:
    holding = bench.begun()
    assert bench.refused() == ("interlock", say("hold_elsewhere", label="Jog", topic="/jog"))
    bench.holds.end(holding, RELEASED)
    assert isinstance(bench.begin(), ActiveHold)


def test_no_two_holds_send_on_one_topic(bench: Bench) -> None:
    bench.begun()
    assert bench.refused("back") == ("interlock", say("hold_same_topic", label="Jog", topic="/jog"))
    assert isinstance(bench.begin("arm"), ActiveHold)


def test_a_press_that_comes_late_is_refused(bench: Bench) -> None:
    for age_s in (LEASE_S, math.inf):
        assert bench.refused(age_s=age_s) == ("interlock", say("hold_press_too_late"))


def test_a_lock_bad_input_and_a_lost_way_refuse_as_with_a_press(bench: Bench) -> None:
    assert bench.refused(inputs={"speed": 7})[0] == "input"
    assert bench.refused(inputs={})[0] == "input"
    permits(bench.robot, False)
    assert bench.refused() == ("interlock", FORBIDS)
    bench.robot.link_up = False
    assert bench.refused()[0] == "link"
    with pytest.raises(NotFound, match="speed"):
        bench.begin("speed")
    assert bench.robot.held_since == {}


def test_the_end_of_the_server_ends_all_and_refuses_more(bench: Bench) -> None:
    bench.begun()
    bench.begun("arm")
    bench.holds.close()
    assert sorted(bench.points) == sorted([MOVES, (-1, 0, 0), STOPS, STOPS])
    assert bench.refused() == ("interlock", say("hold_by_shutdown"))
    bench.holds.close()
    assert all(timer.cancelled for timer in bench.loop.timers)


def test_every_browser_sees_that_the_button_is_held(bench: Bench) -> None:
    def shown() -> Any:
        return build_view(bench.panel, bench.robot, bench.loop.now).view["widgets"]["jog"]

    assert shown() == {"enabled": True, "reason": None, "held": False, "holding": ""}
    holding = bench.begun()
    assert (shown()["held"], shown()["holding"]) == (True, holding.since)
    bench.holds.end(holding, RELEASED)
    assert (shown()["held"], shown()["holding"]) == (False, "")


REGION: Final[Table] = {
    **JOG,
    "type": "sensor_msgs/msg/RegionOfInterest",
    "message": {"x_offset": 1, "y_offset": 0, "do_rectify": True},
    "release": {"x_offset": 0, "y_offset": 0, "do_rectify": False},
    "deadline_field": "height",
    "counter_field": "width",
}


@pytest.mark.parametrize(("rate_hz", "deadline_ms"), [(1.0, 3000), (20.0, 150), (100.0, 100)])
def test_each_message_has_its_deadline_and_the_count(rate_hz: float, deadline_ms: int) -> None:
    bench = Bench({**REGION, "rate_hz": rate_hz})
    for _ in range(2):
        bench.keep(bench.begun(), 2 / rate_hz)
        bench.loop.pass_time(1)
    sent = [
        INTERFACES.decode("sensor_msgs/msg/RegionOfInterest", payload) for payload in bench.way.payloads
    ]
    assert [message.width for message in sent] == list(range(1, len(sent) + 1))
    assert {(message.x_offset, message.height) for message in sent} == {(1, deadline_ms), (0, 0)}
    assert [message.height for message in sent].count(0) == 2


def test_small_counter_wraps_around() -> None:
    empty = {"message": {}, "release": {}, "counter_field": "data"}
    bench = Bench({**JOG, **empty, "type": "std_msgs/msg/UInt8", "rate_hz": 100.0})
    bench.keep(bench.begun(), 3.0)
    sent = [INTERFACES.decode("std_msgs/msg/UInt8", payload).data for payload in bench.way.payloads]
    assert sent[:300] == [n % 256 for n in range(1, 301)]


def test_log_lines_of_a_hold_have_client_duration_and_reason(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "kiosk.holds")
    holding = bench.begun()
    bench.keep(holding, 0.5)
    bench.holds.end(holding, "hold_by_sliding")
    bench.refused(inputs={"speed": 7})
    begun, ended, refused = (record.getMessage() for record in caplog.records)
    assert begun == f"hold {holding.lease.id} of jog by {WHO} with {{'speed': 0.5}} begins"
    assert f"of jog by {WHO} ended after 0.500 s and 10 messages (hold_by_sliding): " in ended
    assert f"hold of jog by {WHO} with {{'speed': 7}}: Not sent at " in refused


@pytest.mark.parametrize(
    ("stamp_ms", "after_ms", "age_s"),
    [
        (0, 0, 1.0),
        (900, 80, 0.02),
        (1000, 0, 0.0),
        (1000, 1000 * MAX_AHEAD_S, 0.0),
        (1500, 0, math.inf),
    ],
)
def test_heartbeats_age_is_measured_by_the_servers_clock(
    stamp_ms: float, after_ms: float, age_s: float
) -> None:
    assert 101.0 - sent_at(100.0, stamp_ms, after_ms, 101.0) == pytest.approx(age_s)


def test_a_lease_that_is_over_is_over() -> None:
    lease = Lease.begin("one", 0.05, NOW, NOW)
    assert lease.end_code(NOW + LEASE_S - 0.001) == ""
    assert lease.end_code(NOW + LEASE_S) == "hold_by_heartbeat"
    assert lease.end_code(NOW + LEASE_S + 0.2) == "hold_by_stall"
    assert not lease.beat(1, NOW + LEASE_S, NOW + LEASE_S)
    assert not lease.take_due(NOW + LEASE_S)


def test_a_late_message_is_not_followed_by_another_at_once() -> None:
    lease = Lease.begin("one", 0.125, 0.0, 0.0)
    assert lease.take_due(0.125)  # the message of 0.0, a whole period late
    assert not lease.take_due(0.125)
    assert lease.take_due(0.25 - 2**-20) is False
    assert lease.next_at == 0.25


class Recorder:
    """Keeps the events that a recording of holds receives."""

    def __init__(self) -> None:
        self.events: list[tuple[str, str]] = []

    def record_press(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None:
        assert (widget, who) == ("jog", WHO)
        self.events.append(("press", press_id))

    def record_receipt(self, receipt: Receipt) -> None:
        self.events.append((receipt.outcome, receipt.id))


def test_begin_end_and_refusal_of_a_hold_are_recorded() -> None:
    recorder = Recorder()
    bench = Bench(recorder=recorder)
    holding = bench.begun()
    again = bench.begin()
    bench.holds.end(holding, RELEASED)
    hold_id = holding.press.id
    assert isinstance(again, Receipt)
    assert recorder.events == [
        ("press", hold_id),
        ("press", again.id),
        ("refused", again.id),
        ("published", hold_id),
    ]


AGES: Final = st.sampled_from([0.0, 0.0, 0.01, 0.1, 0.2, 0.249, 0.25, 0.4])  # seconds
TIMES: Final = st.sampled_from([0.001, 0.02, 0.05, 0.08, 0.08, 0.2, 0.249, 0.25, 0.4, 1.0])


class Orders(RuleBasedStateMachine):
    """Whatever comes in whatever order."""

    def __init__(self) -> None:
        super().__init__()
        logging.getLogger("kiosk.holds").setLevel(logging.CRITICAL)
        self.bench = Bench(JOG)
        self.all: list[ActiveHold] = []
        self.permitted = True
        self.beats: dict[str, float] = {}  # lease → when its newest sign of life was sent
        self.checked = 0
        self.bench.way.may_move = lambda: self.permitted

    @property
    def now(self) -> float:
        return self.bench.loop.now

    @property
    def holding(self) -> ActiveHold | None:
        return self.all[-1] if len(self.all) > len(self.bench.receipts) else None

    @rule(age_s=AGES)
    def begin(self, age_s: float) -> None:
        held = self.holding
        # A lease that has run out while the loop stood still is no reason to refuse.
        free = held is None or self.now >= self.beats[held.lease.id] + LEASE_S
        sent = self.now - age_s
        answer = self.bench.begin(age_s=age_s)
        allowed = free and self.permitted and self.now < sent + LEASE_S
        assert isinstance(answer, ActiveHold) == allowed
        if isinstance(answer, ActiveHold):
            self.all.append(answer)
            self.beats[answer.lease.id] = sent

    @precondition(lambda self: self.all)
    @rule(data=st.data(), late_s=AGES, step=st.integers(-2, 3))
    def beat(self, data: st.DataObject, late_s: float, step: int) -> None:
        holding = data.draw(st.sampled_from(self.all))
        sent, last = self.now - late_s, holding.lease.last
        ended = holding is not self.holding or self.now >= self.beats[holding.lease.id] + LEASE_S
        goes_on = self.bench.holds.beat(holding, last + step, sent)
        assert not (goes_on and ended), "a hold was revived"
        if goes_on and step > 0:
            self.beats[holding.lease.id] = max(self.beats[holding.lease.id], sent)

    @precondition(lambda self: self.all)
    @rule(data=st.data(), code=st.sampled_from([RELEASED, "hold_by_closing", "hold_by_second_finger"]))
    def end(self, data: st.DataObject, code: str) -> None:
        holding = data.draw(st.sampled_from(self.all))
        self.bench.holds.end(holding, code)
        if holding is self.all[-1]:
            assert self.holding is None

    @rule(permitted=st.booleans(), noticed=st.booleans())
    def permission(self, permitted: bool, noticed: bool) -> None:
        """What the robot says now; `noticed`: the loop runs at once, or is still to take it in."""
        self.permitted = permitted
        self.bench.pending.append(lambda: permits(self.bench.robot, permitted))
        if noticed:
            self.bench.take()
            self.bench.holds.judge()
            assert permitted or self.holding is None

    @rule(seconds=TIMES)
    def time_passes(self, seconds: float) -> None:
        self.bench.loop.pass_time(seconds)

    @rule(seconds=TIMES)
    def stall(self, seconds: float) -> None:
        self.bench.loop.stall(seconds)

    @invariant()
    def nothing_is_sent_without_a_live_holder(self) -> None:
        for at, point in self.bench.way.sent[self.checked :]:
            if point == MOVES:
                assert at < self.beats_of_now + LEASE_S
        self.checked = len(self.bench.way.sent)

    @property
    def beats_of_now(self) -> float:
        return self.beats[self.all[-1].lease.id]

    @invariant()
    def each_hold_ends_with_one_last_message(self) -> None:
        """Its messages, one after another: some that move, then exactly one that stops."""
        points = self.bench.points
        assert points.count(STOPS) == len(self.bench.receipts)
        assert len(self.all) - len(self.bench.receipts) in (0, 1)
        runs = [run for run in _split(points) if run]
        assert len(runs) == len(self.all)
        counts = [holding.sent for holding in self.all]
        assert [run.count(MOVES) for run in runs] == counts

    @invariant()
    def at_most_one_timer_runs(self) -> None:
        assert len([t for t in self.bench.loop.timers if not t.cancelled]) <= 1


def _split(points: list[tuple[float, float, float]]) -> list[list[tuple[float, float, float]]]:
    runs: list[list[tuple[float, float, float]]] = [[]]
    for point in points:
        runs[-1].append(point)
        if point == STOPS:
            runs.append([])
    return runs


TestOrders = Orders.TestCase
TestOrders.settings = settings(
    max_examples=several(40, 300),
    stateful_step_count=40,
    deadline=None,
    database=None,
    suppress_health_check=list(HealthCheck),
)
