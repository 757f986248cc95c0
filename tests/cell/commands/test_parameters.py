"""Parameters that a node reports wrongly, late, twice or not at all: without a bridge, by hand."""

import asyncio
import math
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any

import pytest

from app.cell.commands import parameters
from app.cell.commands.parameters import ParameterSync, check_value
from app.cell.commands.press import PressHandle
from app.cell.commands.services import ServiceCalls
from app.cell.permission.press_permission import judged
from app.cell.robot.parameter_state import (
    UNKNOWN,
    ParameterState,
    allowed_range,
    encode_value,
    limits_text,
)
from app.cell.robot.state import Sample
from app.cell.view.parameter_values import parameter
from app.panel.model import Panel
from app.panel.numbers import Range, range_text
from app.panel.widgets.parameter import DESCRIBE, EVENT_TYPE, GET, SET, Parameter
from app.records.entry import Outcome
from app.ros.dialects import bridge_dialect
from app.system.errors import InputError
from app.system.texts import ENGLISH, TextLike, joined, say
from tests.support.builders import (
    BRIDGE,
    INTERFACES,
    NOW,
    TRAITS,
    FakeTransport,
    Table,
    panel_of,
    robot_there,
)
from tests.support.waiting import pass_time, turns, when
from tests.support.words import coded, english

SPEED: Table = {
    "id": "speed", "kind": "parameter", "label": "Speed", "node": "/arm", "parameter": "speed",
    "type": "double",
}  # fmt: skip
COUNT: Table = {**SPEED, "id": "count", "parameter": "count", "type": "integer"}
DOUBLE, INTEGER, STRING = 3, 2, 4


def widget(**more: Any) -> Parameter:
    return Parameter.model_validate({**SPEED, **more})


def value(kind: int, number: Any) -> dict[str, Any]:
    types = {DOUBLE: "double", INTEGER: "integer", STRING: "string"}
    return {**encode_value(widget(type="double"), 0.0), "type": kind, f"{types[kind]}_value": number}


def descriptor(name: str, kind: int, **more: Any) -> dict[str, Any]:
    empty = {"description": "", "additional_constraints": "", "floating_point_range": [],
             "integer_range": []}  # fmt: skip
    return {**empty, "name": name, "type": kind, **more}


# A node is queried at once; the confirming query is far away.
AT_ONCE = replace(TRAITS, server_settle_s=0.0, events_settle_s=60.0)


class Line(FakeTransport):
    """A link whose queries are answered by hand."""

    def __init__(self) -> None:
        self.queries: list[tuple[str, bytes, asyncio.Future[bytes | None]]] = []

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        future: asyncio.Future[bytes | None] = asyncio.get_running_loop().create_future()
        self.queries.append((key, payload, future))
        return future

    @property
    def keys(self) -> list[str]:
        return [key for key, _, _ in self.queries]


class Bench:
    """A robot with one node that offers its parameters."""

    def __init__(self, *widgets: Table) -> None:
        self.panel: Panel = panel_of(*(widgets or (SPEED,)))
        self.robot = robot_there(self.panel)
        self.robot.traits = AT_ONCE
        self.line = Line()
        calls = ServiceCalls(INTERFACES, self.robot, self.line, lambda _: None)
        self.parameters = ParameterSync(
            self.panel, INTERFACES, self.robot, self.line, calls, lambda: None
        )
        self.calls = calls

    def offer(self, alive: bool = True) -> None:
        for name, kind in (GET, DESCRIBE, SET):
            token = bridge_dialect.server_token(BRIDGE, "SS", f"arm/{name}", kind)
            if not alive:
                self.lose(token)
            self.robot.graph.apply_token(token, alive)
        self.parameters.on_graph_change()

    def lose(self, token: str) -> None:
        endpoint = bridge_dialect.parsed(token)
        assert endpoint is not None
        self.parameters.on_token_lost(endpoint)

    async def queried(self, count: int) -> None:
        await when(lambda: len(self.line.queries) >= count)

    async def answer(self, number: int, service: tuple[str, str], **fields: Any) -> None:
        """The answer to the query of this number, which must be of this service."""
        await self.queried(number)
        key, _, future = self.line.queries[number - 1]
        assert key == f"arm/{service[0]}"
        future.set_result(INTERFACES.encode(f"{service[1]}_Response", fields))
        for _ in range(5):
            await asyncio.sleep(0)

    async def tell(self, first: int, number: float, **more: Any) -> None:
        """What the node describes and holds, asked for by query number `first` and the next."""
        described = [descriptor("speed", DOUBLE, **more)]
        await self.answer(first, DESCRIBE, descriptors=described)
        await self.answer(first + 1, GET, values=[value(DOUBLE, number)])

    def event(self, node: str = "/arm", *, skipped: int = 0, **parts: Any) -> None:
        lists = {"new_parameters": [], "changed_parameters": [], "deleted_parameters": [], **parts}
        fields = {"stamp": {"sec": 0, "nanosec": 0}, "node": node, **lists}
        payload = INTERFACES.encode(EVENT_TYPE, fields)
        self.parameters.on_event("parameter_events", Sample(payload, 1, NOW, NOW, BRIDGE, skipped))

    @property
    def shown(self) -> dict[str, Any]:
        (speed,) = self.panel.parameters()
        return parameter(speed, self.robot)

    def known(self, name: str = "speed") -> ParameterState:
        return self.robot.parameters.get(name, UNKNOWN)

    def reason(self, name: str = "speed") -> TextLike:
        parameter_widget = next(w for w in self.panel.parameters() if w.id == name)
        return judged(parameter_widget, (), self.robot, NOW).reason or ""


def run(test: Callable[[Bench], Coroutine[Any, Any, None]], *widgets: Table) -> None:
    async def whole() -> None:
        bench = Bench(*widgets)
        try:
            await test(bench)
        finally:
            await bench.parameters.stop()

    asyncio.run(whole())


def change(number: float) -> list[dict[str, Any]]:
    return [{"name": "speed", "value": value(DOUBLE, number)}]


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pauses of a test's length."""
    monkeypatch.setattr(parameters, "AGAIN_S", 0.01)


def test_node_is_queried_once_when_it_appears() -> None:
    async def test(bench: Bench) -> None:
        bench.parameters.on_graph_change()
        assert bench.line.keys == []
        assert bench.reason() == say("parameter_node_unavailable", node="/arm")
        bench.offer()
        bench.parameters.on_graph_change()
        await bench.queried(1)
        assert coded(bench.reason(), "node", "name") == ("parameter_waiting", "/arm", "speed")
        await bench.tell(1, 0.5)
        assert (bench.known().state, bench.known().value, bench.reason()) == ("live", 0.5, "")
        await turns()
        assert bench.line.keys == ["arm/describe_parameters", "arm/get_parameters"]

    run(test)


def test_a_node_that_appeared_is_read_once_more_when_its_events_flow() -> None:
    async def test(bench: Bench) -> None:
        bench.robot.traits = replace(AT_ONCE, events_settle_s=0.02)
        bench.offer()
        await bench.tell(1, 0.5)
        await bench.tell(3, 0.6)
        assert bench.known().value == 0.6
        await pass_time(0.1)
        assert len(bench.line.queries) == 4

    run(test)


def test_event_of_the_node_counts_and_an_event_of_another_node_does_not() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.tell(1, 0.5)
        bench.event(changed_parameters=change(0.7))
        assert bench.known().value == 0.7
        for other in ("/arm2", "/cell/arm", "arm"):
            bench.event(other, changed_parameters=change(9.0))
        bench.parameters.on_event("parameter_events", Sample(b"\xff" * 9, 1, NOW, NOW, BRIDGE))
        assert bench.known().value == 0.7
        assert len(bench.line.queries) == 2

    run(test)


def test_an_event_by_a_bridge_that_is_gone_does_not_count() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.tell(1, 0.5)
        fields = {"stamp": {"sec": 0, "nanosec": 0}, "node": "/arm", "new_parameters": [],
                  "changed_parameters": change(0.7), "deleted_parameters": []}  # fmt: skip
        payload = INTERFACES.encode(EVENT_TYPE, fields)
        bench.parameters.on_event("parameter_events", Sample(payload, 1, NOW, NOW, "gone"))
        assert bench.known().value == 0.5

    run(test)


def test_an_event_while_the_node_is_asked_goes_over_its_answer() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.answer(1, DESCRIBE, descriptors=[descriptor("speed", DOUBLE)])
        bench.event(changed_parameters=change(0.7))
        await bench.answer(2, GET, values=[value(DOUBLE, 0.5)])
        assert bench.known().value == 0.7

    run(test)


@pytest.mark.parametrize("event", ["skipped", "new", "deleted", "too large"])
def test_parameter_events_that_may_hide_a_change_cause_a_query(event: str) -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.tell(1, 0.5)
        if event == "skipped":
            bench.event("/other", skipped=1)
        elif event == "too large":  # to be read at once
            texts = {**value(DOUBLE, 0.0), "type": 9, "string_array_value": [""] * 10_000}
            bench.event("/arm", changed_parameters=[*change(0.7), {"name": "list", "value": texts}])
        else:
            parts: dict[str, Any] = {f"{event}_parameters": change(0.7)}
            bench.event("/arm", **parts)
        await bench.tell(3, 0.8, read_only=True)
        assert (bench.known().value, bench.known().read_only) == (0.8, True)

    run(test)


def test_an_answer_of_before_a_cut_does_not_count() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.answer(1, DESCRIBE, descriptors=[descriptor("speed", DOUBLE)])
        await bench.queried(2)
        bench.offer(alive=False)
        bench.offer()
        await bench.queried(3)
        old = bench.line.queries[1][2]
        if not old.done():
            old.set_result(INTERFACES.encode(f"{GET[1]}_Response", {"values": [value(DOUBLE, 9.0)]}))
        await turns()
        assert bench.known().state == "waiting"
        await bench.tell(3, 0.5)
        assert bench.known().value == 0.5

    run(test)


def test_briefly_replaced_node_is_queried_again() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.tell(1, 0.5)
        bench.lose(bridge_dialect.bridge_token(BRIDGE))
        assert (bench.known().state, bench.known().value) == ("cut", 0.5)
        assert coded(bench.reason(), "node", "name") == ("parameter_waiting", "/arm", "speed")
        bench.parameters.on_graph_change()
        await bench.tell(3, 0.6)
        assert (bench.known().state, bench.known().value) == ("live", 0.6)

    run(test)


def test_unresponsive_node_is_queried_again_when_touched_or_new(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each question makes a node on Fast DDS print an error."""
    monkeypatch.setattr(parameters, "ANSWER_S", 0.01)

    async def test(bench: Bench) -> None:
        (speed,) = bench.panel.parameters()
        assert bench.parameters.read_again(speed) == say("parameter_node_unavailable", node="/arm")
        bench.offer()
        await bench.queried(1)
        assert bench.parameters.read_again(speed) == ""  # it is being asked
        await when(lambda: bench.known().state == "silent")
        assert bench.shown["askable"] is False
        assert coded(bench.shown["note"], "node") == ("parameter_waiting_for_node", "/arm")
        await bench.answer(1, DESCRIBE, descriptors=[descriptor("speed", DOUBLE)])  # late
        await when(lambda: bench.shown["askable"])
        assert bench.known().state == "silent"
        assert coded(bench.shown["note"], "node") == ("parameter_no_response", "/arm")
        silent = say("parameter_no_reply", node="/arm", name="speed")
        assert bench.reason() == joined([silent, say("service_cyclone_hint")])
        for _ in range(3):  # whatever it says by itself
            bench.event(skipped=1, changed_parameters=change(0.7), new_parameters=change(0.7))
            bench.parameters.on_graph_change()
            await pass_time(0.03)
        assert len(bench.line.queries) == 1
        assert bench.parameters.read_again(speed) == ""
        assert bench.parameters.read_again(speed) == ""
        await bench.queried(2)
        await pass_time(0.03)
        bench.line.queries[1][2].set_result(None)  # after its time
        await when(lambda: bench.shown["askable"])
        await pass_time(0.03)
        assert len(bench.line.queries) == 2
        monkeypatch.setattr(parameters, "ANSWER_S", 5.0)
        bench.offer(alive=False)
        assert bench.shown["askable"] is False
        bench.offer()
        await bench.tell(3, 0.5)
        assert bench.known().value == 0.5

    run(test)


def test_node_that_has_just_responded_is_not_queried_again_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A program that read again and again had the node asked hundreds of times a second."""

    async def test(bench: Bench) -> None:
        (speed,) = bench.panel.parameters()
        monkeypatch.setattr(parameters, "AGAIN_S", 60.0)
        bench.offer()
        await bench.tell(1, 0.5)
        for _ in range(20):
            assert bench.parameters.read_again(speed) == ""
            await turns()
        assert len(bench.line.queries) == 2
        monkeypatch.setattr(parameters, "AGAIN_S", 0.0)
        assert bench.parameters.read_again(speed) == ""
        await bench.tell(3, 0.6)
        assert bench.known().value == 0.6

    run(test)


def test_a_question_that_the_bridge_dropped_is_asked_again() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.queried(1)
        bench.line.queries[0][2].set_result(None)  # at once: it never got to the node
        await bench.tell(2, 0.5)
        assert bench.known().value == 0.5

    run(test)


def test_node_cut_off_during_a_query_is_queried_after_its_return() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.queried(1)
        bench.offer(alive=False)
        bench.offer()
        await bench.queried(2)
        assert bench.robot.querying == {"speed"}
        await bench.tell(2, 0.5)
        await when(lambda: bench.shown["askable"])

    run(test)


def test_node_without_the_parameter_is_queried_ever_more_rarely(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(parameters, "AGAIN_MOST_S", 0.04)
    paused: list[float | None] = []

    async def within(event: asyncio.Event, longest_s: float | None) -> None:
        paused.append(longest_s)
        await asyncio.sleep(0)

    monkeypatch.setattr(parameters, "within", within)

    async def test(bench: Bench) -> None:
        bench.offer()
        for number in range(1, 9, 2):
            await bench.answer(number, DESCRIBE, descriptors=[])
            await bench.answer(number + 1, GET, values=[])
        await bench.queried(9)
        assert paused[1:8:2] == [0.01, 0.02, 0.04, 0.04]  # the others are between any two readings

    run(test)


def test_undeclared_parameter_does_not_affect_the_others() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.answer(1, DESCRIBE, descriptors=[])
        await bench.answer(2, DESCRIBE, descriptors=[descriptor("speed", DOUBLE)])
        await bench.answer(3, DESCRIBE, descriptors=[])
        await bench.answer(4, GET, values=[])
        await bench.answer(5, GET, values=[value(DOUBLE, 0.5)])
        await bench.answer(6, GET, values=[])
        assert (bench.known().value, bench.known("count").state) == (0.5, "undeclared")
        assert coded(bench.reason("count"), "node", "name") == ("parameter_undeclared", "/arm", "count")

    run(test, SPEED, COUNT)


@pytest.mark.parametrize(
    ("described", "held", "state", "reason"),
    [
        (descriptor("", 0), value(DOUBLE, 0) | {"type": 0}, "undeclared", ("undeclared",)),
        (descriptor("speed", INTEGER), value(INTEGER, 1), "mistyped", ("mistyped", "integer")),
        (descriptor("speed", 8), value(DOUBLE, 0) | {"type": 8}, "mistyped", ("mistyped", "double[]")),
        (descriptor("speed", DOUBLE), value(DOUBLE, 0) | {"type": 0}, "missing", ()),
        (descriptor("speed", 0, dynamic_typing=True), value(DOUBLE, 1), "live", ()),
        (descriptor("speed", INTEGER, dynamic_typing=True), value(DOUBLE, 1), "live", ()),
        (descriptor("speed", DOUBLE, read_only=True), value(DOUBLE, 1), "live", ("read_only",)),
    ],
)
def test_parameters_state_decides_the_lock(
    described: dict[str, Any], held: dict[str, Any], state: str, reason: tuple[str, ...]
) -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.answer(1, DESCRIBE, descriptors=[described])
        await bench.answer(2, GET, values=[held])
        assert bench.known().state == state
        code, found_type = coded(bench.reason(), "found")
        assert (code.removeprefix("parameter_"), found_type)[: len(reason)] == reason
        assert bool(reason) == bool(bench.reason())

    run(test)


def test_unreadable_response_locks_the_parameter() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.queried(1)
        bench.line.queries[0][2].set_result(b"\0\1\0\0\xff\xff")
        await when(lambda: bench.known().state == "unreadable")
        assert coded(bench.reason(), "node", "name") == ("parameter_unreadable", "/arm", "speed")

    run(test)


def test_parameter_is_read_back_after_setting() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.tell(1, 0.5)
        (speed,) = bench.panel.parameters()
        corrected: list[tuple[str, Outcome]] = []
        setting = asyncio.create_task(
            bench.parameters.set(
                speed, 0.7, PressHandle("p1", lambda answer: corrected.append(("p1", answer)))
            )
        )
        await bench.queried(3)
        assert bench.reason() == say("press_in_progress")
        request = INTERFACES.decode(f"{SET[1]}_Request", bench.line.queries[2][1])
        (sent,) = request.parameters
        assert (sent.name, sent.value.type, sent.value.double_value) == ("speed", DOUBLE, 0.7)
        await bench.answer(3, SET, results=[{"successful": False, "reason": "too fast"}])
        answer = await setting
        assert (answer.outcome, str(answer.text)[-10:]) == ("rejected", ": too fast")
        await bench.tell(4, 0.5)
        assert bench.known().value == 0.5

    run(test)


def test_an_empty_answer_to_a_set_is_unknown() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        await bench.tell(1, 0.5)
        (speed,) = bench.panel.parameters()
        setting = asyncio.create_task(
            bench.parameters.set(speed, 0.7, PressHandle("p1", lambda _: None))
        )
        await bench.answer(3, SET, results=[])
        assert (await setting).outcome == "unknown"

    run(test)


@pytest.mark.parametrize(
    ("entered", "kind", "value"),
    [
        (1, "double", 1.0),
        (0.30000000000000004, "double", 0.30000000000000004),
        (5.0, "integer", 5),
        ("9007199254740993", "integer", 2**53 + 1),
        ("", "string", ""),
        (True, "bool", True),
    ],
)
def test_a_value_is_typed(entered: Any, kind: str, value: Any) -> None:
    checked = check_value(
        widget(type=kind), ParameterState("live", range=Range(None, None, None)), entered
    )
    assert (checked, type(checked)) == (value, type(value))


@pytest.mark.parametrize(
    ("entered", "kind"),
    [
        (math.nan, "double"),
        (math.inf, "double"),
        (10**400, "double"),
        (True, "double"),
        ("1", "double"),
        (True, "integer"),
        (2**63, "integer"),
        ("9" * 30, "integer"),
        ("1.5", "integer"),
        (None, "integer"),
        (0, "bool"),
        ("true", "bool"),
        ("x" * 1001, "string"),
        (["x"], "string"),
    ],
)
def test_a_value_of_another_type_is_refused(entered: Any, kind: str) -> None:
    with pytest.raises(InputError, match="Speed"):
        check_value(widget(type=kind), ParameterState("live"), entered)


@pytest.mark.parametrize(
    ("own", "theirs", "limits", "good", "bad"),
    [
        ({}, Range(0.0, 2.0, 0.1), "0 to 2, in steps of 0.1", [0.3, 2.0], [0.35, 2.1, -0.1]),
        ({}, Range(0.0, 1.0, 0.3), "0 to 1, in steps of 0.3", [0.9, 1.0], [0.95]),
        ({"max": 1.0}, Range(0.0, 2.0, None), "0 to 1", [0.05], [1.1]),
        ({"min": 0.25}, Range(0.0, 2.0, 0.1), "0.3 to 2, in steps of 0.1", [0.3], [0.2, 0.25]),
        ({"step": 0.5}, Range(0.0, 2.0, 0.1), "0 to 2, in steps of 0.5", [1.5], [0.1]),
        ({"step": 0.25}, Range(0.0, 2.0, 0.1), "0 to 2, in steps of 0.25", [0.5], [0.25]),
        ({"min": 1}, Range(), "1 or more", [1, 9.5], [0.5]),
        ({"max": 1}, Range(), "1 or less", [-1e9], [1.5]),
        ({"unit": "m"}, Range(), "a number", [1e300], []),
    ],
)
def test_panel_narrows_the_limits_of_the_node(
    own: dict[str, Any], theirs: Range, limits: str, good: list[float], bad: list[float]
) -> None:
    speed, known = widget(**own), ParameterState("live", range=theirs)
    assert english(limits_text(speed, allowed_range(speed, known))) == limits
    assert [check_value(speed, known, number) for number in good] == good
    for number in bad:
        with pytest.raises(InputError) as refused:
            check_value(speed, known, number)
        assert coded(refused.value.text, "label") == ("input_outside_limits", "Speed")


def test_no_value_that_both_allow_locks() -> None:
    async def test(bench: Bench) -> None:
        bench.offer()
        limits = [{"from_value": 0.0, "to_value": 2.0, "step": 0.0}]
        await bench.tell(1, 0.5, floating_point_range=limits)
        about = coded(bench.reason(), "node", "name", "theirs", "ours")
        assert about == ("parameter_no_common_value", "/arm", "speed", "0 to 2", "3 or more")

    run(test, {**SPEED, "min": 3.0})


def test_integers_are_exact_to_the_last_step() -> None:
    count = widget(type="integer")
    known = ParameterState("live", range=Range(-(2**63), 2**63 - 1, 2))
    assert check_value(count, known, str(2**53 + 2)) == 2**53 + 2
    assert check_value(count, known, str(2**63 - 1)) == 2**63 - 1  # the highest is always right
    with pytest.raises(InputError):
        check_value(count, known, str(2**53 + 1))


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        ("double", "1.5", 1.5),
        ("double", "nan", "nan"),
        ("double", "1_0", "1_0"),
        ("integer", "7", 7),
        ("bool", "true", True),
        ("bool", "maybe", "maybe"),
        ("string", "true", "true"),
    ],
)
def test_a_forms_text_is_typed(kind: str, text: str, value: Any) -> None:
    assert widget(type=kind).parse_text(text, ENGLISH) == value


def test_a_range_that_is_open_has_no_words() -> None:
    assert range_text(Range(), "m") == ""
    assert english(range_text(Range(step=0.5), "m")) == "in steps of 0.5"


@pytest.mark.parametrize(
    ("kind", "value", "text", "entry"),
    [
        ("double", 0.5, "0.5 mm", "0.5"),
        ("double", math.nan, "NaN mm", ""),
        ("double", 1e22, "1e+22 mm", "1e+22"),
        ("integer", 2**53 + 1, "9007199254740993 mm", "9007199254740993"),
        ("string", "two\nlines", "two\nlines", ""),
        ("string", "x" * 2000, "x" * 199 + "…", ""),
        ("bool", True, "On", True),
    ],
)
def test_a_value_shows_and_its_input_starts_from_it(
    kind: str, value: Any, text: str, entry: Any
) -> None:
    unit = "mm" if kind in ("double", "integer") else ""
    panel = panel_of({**SPEED, "type": kind, "unit": unit})
    robot = robot_there(panel)
    robot.parameters["speed"] = ParameterState("live", value)
    (speed,) = panel.parameters()
    shown = parameter(speed, robot)
    assert english((shown["text"], shown["entry"])) == (text, entry)
    assert coded(shown["note"]) == (
        "parameter_read_without_events",
    )  # no one publishes /parameter_events
