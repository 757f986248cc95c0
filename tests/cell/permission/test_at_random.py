"""Verdicts and receipts through random orders of what can happen, with a clock that is set.

Never permitted without all its grounds, never two outcomes for a press, no way back from an end but by
an answer that came late.
"""

import asyncio
import math
from typing import Any, Final

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as some
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from app.cell.commands.receipts import Receipt
from app.cell.commands.services import ServiceCalls
from app.cell.permission.conditions import HISTORY_S
from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.graph import Route
from app.cell.robot.state import RobotState, Sample
from app.panel.model import Panel
from app.ros.dialects import bridge_dialect
from app.system.errors import LinkError
from tests.support.builders import (
    BOOL,
    BRIDGE,
    DIALECT,
    ENABLED,
    GUARDED,
    INTERFACES,
    KIOSK,
    MESSAGE,
    NOW,
    TEXT,
    TRAITS,
    FakeTransport,
    endpoint,
    panel_of,
    press_widget,
    presses_of,
)
from tests.support.form import several

pytestmark = pytest.mark.promise("locks")

MAX_AGE_S: Final = 2.0
TIMEOUT_S: Final = 0.01
SERVICE: Final = "example_interfaces/srv/AddTwoInts"
ADD: Final = {
    "id": "add",
    "kind": "call",
    "label": "Add",
    "service": "/add",
    "type": SERVICE,
    "request": {"a": 1, "b": 2},
    "timeout_s": TIMEOUT_S,
}
REQUEST, RESPONSE = INTERFACES.service_types(SERVICE)
ANSWER: Final = INTERFACES.encode(RESPONSE, {"sum": 3})
IDS: Final = some.sampled_from(["p1", "p2", "p3", "p4"])
BUTTONS: Final = some.sampled_from(["guarded", "add"])
GARBAGE: Final = some.binary(max_size=4) | some.binary().map(lambda data: b"\xff" + data)
CORRECTED: Final = frozenset({"timed_out", "unknown"})
FEW: Final = settings(
    max_examples=several(30, 200),
    stateful_step_count=40,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=list(HealthCheck),
)


class Way(FakeTransport):
    """The way to the robot: keeps what was put, and the queries until they are answered."""

    def __init__(self) -> None:
        self.put_texts: list[str] = []
        self.queries: list[asyncio.Future[bytes | None]] = []
        self.fails = False

    def put(self, key: str, payload: bytes) -> None:
        if self.fails:
            raise LinkError("no way")
        self.put_texts.append(INTERFACES.decode(TEXT, payload).data)

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        query: asyncio.Future[bytes | None] = asyncio.get_running_loop().create_future()
        self.queries.append(query)
        return query


class ServerConditions:
    """What must be so for a permission, kept beside the robot and by its simplest rules."""

    def __init__(self, strict: bool = True) -> None:
        """`strict`: of an interlock that wants a publisher, and a value that is not old."""
        self.strict = strict
        self.link = self.bridge = self.publisher = False
        self.silent = self.wrong_type = self.unheard = False
        self.settled_at: float | None = None
        self.value: bool | None = None  # None: nothing that counts, or nothing that can be read
        self.said_at = 0.0

    def hold(self, now: float) -> bool:
        permits = self.way(now) and not self.wrong_type and self.value is True
        if not permits or (self.unheard and self.publisher):
            return False
        return not self.strict or (self.publisher and self.fresh(now))

    def fresh(self, now: float) -> bool:
        since = math.inf if self.settled_at is None else self.settled_at + HISTORY_S
        return self.said_at >= since and now < self.said_at + MAX_AGE_S

    def way(self, now: float) -> bool:
        there = self.link and self.bridge and not self.silent
        return there and self.settled_at is not None and now >= self.settled_at


class SetLoop(asyncio.SelectorEventLoop):
    """An event loop whose time is set."""

    now = NOW

    def time(self) -> float:
        return self.now

    def spin(self) -> None:
        """Everything that is due."""
        for _ in range(12):
            self.run_until_complete(asyncio.sleep(0))


def one_panel(strict: bool) -> Panel:
    conditions = {"max_age_s": MAX_AGE_S, "require_publisher": True} if strict else {}
    return panel_of(MESSAGE, GUARDED, ADD, interlock=conditions)


class Panels(RuleBasedStateMachine):
    """One robot, one panel, whatever happens."""

    @initialize(strict=some.booleans(), well=some.booleans())
    def begins(self, strict: bool, well: bool) -> None:
        self.panel = one_panel(strict)
        self.loop = SetLoop()
        self.way = Way()
        self.grounds = ServerConditions(strict)
        self.robot = RobotState(self.panel, INTERFACES, DIALECT, TRAITS, KIOSK)
        self.key = self.robot.key(ENABLED)
        self.calls = ServiceCalls(INTERFACES, self.robot, self.way, lambda _: None)
        self.presses = presses_of(
            self.panel,
            self.robot,
            self.way,
            calls=self.calls,
            monotonic=lambda: self.now,
        )
        self.seq = 0
        self.sent: list[str] = []  # press ids, once for each put or query
        self.last: dict[str, Receipt] = {}
        self.pending: list[asyncio.Task[Receipt]] = []
        self.pressed_last = ("p1", "add", "a")
        if well:
            self.all_is_well()

    @property
    def now(self) -> float:
        return self.loop.now

    def teardown(self) -> None:
        for query in self.way.queries:
            if not query.done():
                query.set_result(None)
        for task in self.pending:
            task.cancel()
        self.loop.spin()
        self.loop.close()

    # What the robot and the way to it do.

    @rule()
    def all_is_well(self) -> None:
        """Each ground there is: without this no order of events would ever permit."""
        self.link_comes()
        self.bridge_comes()
        self.publisher_comes()
        self.robot.graph.update_routes(())
        self.robot.graph.update_versions({BRIDGE: "1"})
        self.type_is(wrong=False)
        self.joined()
        self.grounds.silent = self.grounds.unheard = False
        self.loop.now += HISTORY_S
        self.says(True)
        assert self.permitted()

    @rule()
    def link_comes(self) -> None:
        self.robot.link_up = self.grounds.link = True

    @rule()
    def link_goes(self) -> None:
        self.robot.mark_link_lost()
        self.grounds = ServerConditions(self.grounds.strict)
        self.calls.on_graph_change()

    @precondition(lambda self: self.grounds.link and not self.grounds.bridge)
    @rule()
    def bridge_comes(self) -> None:
        self.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), True)
        self.robot.graph.apply_token(bridge_dialect.server_token(BRIDGE, "SS", "add", SERVICE), True)
        self.grounds.bridge, self.grounds.silent = True, False

    @precondition(lambda self: self.grounds.bridge)
    @rule()
    def bridge_goes(self) -> None:
        self.publisher_goes()
        self.type_is(wrong=False)
        self.robot.graph.apply_token(bridge_dialect.server_token(BRIDGE, "SS", "add", SERVICE), False)
        self.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), False)
        self.seq += 1
        self.robot.mark_peer_lost(BRIDGE, self.seq)
        self.robot.update_publishers()
        self.robot.settled_at = float("inf")
        self.grounds.bridge, self.grounds.settled_at, self.grounds.value = False, None, None
        self.calls.on_graph_change()

    @precondition(lambda self: self.grounds.bridge)
    @rule()
    def bridge_restarts(self) -> None:
        self.bridge_goes()
        self.bridge_comes()
        self.joined()

    @precondition(lambda self: self.grounds.bridge)
    @rule()
    def joined(self) -> None:
        self.robot.settled_at = self.grounds.settled_at = self.now

    @precondition(lambda self: self.grounds.bridge)
    @rule(silent=some.booleans())
    def bridge_is_queried(self, silent: bool) -> None:
        self.robot.graph.update_versions({} if silent else {BRIDGE: "1"})
        self.grounds.silent = silent

    @precondition(lambda self: self.grounds.bridge)
    @rule(deaf=some.booleans())
    def bridge_reports_its_routes(self, deaf: bool) -> None:
        self.robot.graph.update_routes([Route(BRIDGE, "pub", self.key, BOOL, has_reader=not deaf)])
        self.grounds.unheard = deaf

    @precondition(lambda self: self.grounds.bridge)
    @rule()
    def publisher_comes(self) -> None:
        endpoint(self.robot, "MP", ENABLED, BOOL)
        self.robot.update_publishers()
        self.grounds.publisher = True

    @precondition(lambda self: self.grounds.bridge)
    @rule()
    def publisher_goes(self) -> None:
        endpoint(self.robot, "MP", ENABLED, BOOL, alive=False)
        self.robot.update_publishers()
        if self.grounds.strict and self.grounds.publisher and not self.grounds.wrong_type:
            self.grounds.value = None
        self.grounds.publisher = False

    @precondition(lambda self: self.grounds.bridge)
    @rule(wrong=some.booleans())
    def type_is(self, wrong: bool) -> None:
        endpoint(self.robot, "MP", ENABLED, TEXT, alive=wrong)
        self.robot.update_publishers()
        if self.grounds.strict and self.grounds.wrong_type and not wrong and not self.grounds.publisher:
            self.grounds.value = None
        self.grounds.wrong_type = wrong

    @rule(value=some.booleans())
    def says(self, value: bool) -> None:
        self.hears(INTERFACES.encode(BOOL, {"data": value}))
        self.grounds.value, self.grounds.said_at = value, self.now

    @rule(garbage=GARBAGE)
    def says_garbage(self, garbage: bytes) -> None:
        self.hears(garbage)
        self.grounds.value = None

    def hears(self, payload: bytes) -> None:
        self.seq += 1
        self.robot.update(self.key, Sample(payload, self.seq, self.now, self.now, BRIDGE))

    @rule(seconds=some.sampled_from([0.004, 0.5, 1.0, MAX_AGE_S]))
    def time_passes(self, seconds: float) -> None:
        self.loop.now += seconds
        self.loop.spin()

    # What operators do.

    @rule(fails=some.booleans())
    def link_fails(self, fails: bool) -> None:
        self.way.fails = fails

    @rule(press_id=IDS, widget=BUTTONS, text=some.sampled_from(["a", "b"]))
    def pressed(self, press_id: str, widget: str, text: str) -> None:
        self.pressed_last = (press_id, widget, text)
        puts, queries = len(self.way.put_texts), len(self.way.queries)
        inputs = {"message": text}
        self.pending.append(self.loop.create_task(press_widget(self.presses, widget, inputs, press_id)))
        self.loop.spin()
        if len(self.way.put_texts) > puts:
            assert self.grounds.hold(self.now), "sent without its grounds"
        if len(self.way.queries) > queries:
            assert self.grounds.way(self.now), "asked without a way"
        self.sent += [press_id] * (len(self.way.put_texts) - puts + len(self.way.queries) - queries)

    @rule()
    def pressed_again(self) -> None:
        self.pressed(*self.pressed_last)

    @precondition(lambda self: any(not query.done() for query in self.way.queries))
    @rule(answered=some.booleans(), which=some.integers(0, 100))
    def robot_answers(self, answered: bool, which: int) -> None:
        """In time or long after it."""
        waiting = [query for query in self.way.queries if not query.done()]
        waiting[which % len(waiting)].set_result(ANSWER if answered else None)
        self.loop.spin()

    # What must be true whatever happens.

    def permitted(self) -> bool:
        interlock = self.panel.interlocks[0]
        return interlock_verdict(interlock, self.robot, self.now).permitted

    @invariant()
    def permitted_only_with_all_its_grounds(self) -> None:
        assert not self.permitted() or self.grounds.hold(self.now)

    @invariant()
    def sent_at_most_once(self) -> None:
        assert len(self.sent) == len(set(self.sent))

    @invariant()
    def no_receipt_goes_back(self) -> None:
        for press_id in ("p1", "p2", "p3", "p4"):
            old, new = self.last.get(press_id), self.presses.receipt(press_id)
            if new is None:
                assert old is None, "a receipt is lost"
                continue
            if old is not None and old.outcome != new.outcome:
                assert old.outcome in CORRECTED, f"{old.outcome} became {new.outcome}"
                assert new.outcome in {"succeeded", "rejected"}
            if old is not None and old.outcome == "refused":
                assert new == old
            self.last[press_id] = new

    @invariant()
    def what_was_refused_was_not_sent(self) -> None:
        for press_id, receipt in self.last.items():
            assert (receipt.outcome == "refused") <= (press_id not in self.sent)

    @invariant()
    def who_waits_gets_what_is_kept(self) -> None:
        done = [task for task in self.pending if task.done()]
        self.pending = [task for task in self.pending if not task.done()]
        for task in done:
            receipt: Any = task.result()
            kept = self.presses.receipt(receipt.id)
            assert kept is not None
            assert receipt.outcome == kept.outcome or receipt.outcome in CORRECTED


Panels.TestCase.settings = FEW
TestAtRandom = Panels.TestCase
