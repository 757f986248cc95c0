"""What leaves the server for a robot, by every kind of command with drawn inputs, on both dialects:
whole messages that another library decodes, with whole attachments, and never a `delete`.

A node on rmw_zenoh ends at anything else. The Zenoh session is a real one that records.
"""

import asyncio
import logging
import struct
import threading
import time
from collections.abc import Coroutine, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, Final, NamedTuple, TypeVar

import pytest
import zenoh
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zenoh.ext import declare_advanced_publisher

from app.cell.commands.holds import RELEASED, ActiveHold
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.panel.model import Panel
from app.panel.template import input_ids
from app.records import NullLog
from app.ros.zenoh.config import config_to, open_session
from app.tools.simulator.in_process import in_process
from tests.cell.session.test_rmw_zenoh import enabled
from tests.support.builders import MESSAGE, Table, panel_of, press_of, press_widget
from tests.support.parts import ENOUGH_S
from tests.support.waiting import when

Result = TypeVar("Result")

GATED: Final[Table] = {"interlock": "operation"}
SPEED: Final[Table] = {
    "id": "speed",
    "kind": "number",
    "label": "v",
    "min": -5,
    "max": 5,
    "step": 0.001,
}
NUMBER: Final[Table] = {"id": "number", "kind": "number", "label": "n", "min": 0, "max": 40}
SURE: Final[Table] = {"id": "sure", "kind": "toggle", "label": "Sure"}
COMMANDS: Final[tuple[Table, ...]] = (
    {
        "id": "say",
        "kind": "publish",
        "topic": "/say",
        "type": "std_msgs/msg/String",
        "message": {"data": "{message}"},
        **GATED,
    },
    {
        "id": "kept",
        "kind": "publish",
        "topic": "/kept",
        "type": "std_msgs/msg/Bool",
        "message": {"data": "{sure}"},
        "qos": {"durability": "transient_local"},
    },
    {
        "id": "drive",
        "kind": "publish",
        "topic": "/cmd_vel",
        "type": "geometry_msgs/msg/TwistStamped",
        "message": {
            "header": {"stamp": "{now}", "frame_id": "{message}"},
            "twist": {"linear": {"x": "{speed}"}},
        },
    },
    {
        "id": "path",
        "kind": "publish",
        "topic": "/path",
        "type": "nav_msgs/msg/Path",
        "message": {
            "poses": [
                {"header": {"frame_id": "a"}, "pose": {"position": {"x": "{speed}"}}},
                {"header": {"frame_id": "{message}"}},
            ]
        },
    },
    {
        "id": "rate",
        "kind": "step",
        "topic": "/rate",
        "type": "std_msgs/msg/Int8",
        "message": {"data": "{value}"},
        "min": 10,
        "max": 90,
        "step": 10,
        "value": {"topic": "/rated", "type": "std_msgs/msg/Int8", "field": "data"},
    },
    {
        "id": "lamps",
        "kind": "switch",
        "topic": "/lamps/set",
        "type": "std_msgs/msg/Bool",
        "on_message": {"data": True},
        "off_message": {"data": False},
        "reported": {"topic": "/lamps", "type": "std_msgs/msg/Bool", "field": "data"},
    },
    {
        "id": "add",
        "kind": "call",
        "service": "/add",
        "type": "example_interfaces/srv/AddTwoInts",
        "request": {"a": "{number}", "b": 2},
    },
    {
        "id": "count",
        "kind": "action",
        "action": "/count",
        "type": "example_interfaces/action/Fibonacci",
        "goal": {"order": "{number}"},
    },
    {"id": "feed", "kind": "parameter", "node": "/arm", "parameter": "feed", "type": "double"},
    {"id": "name", "kind": "parameter", "node": "/arm", "parameter": "name", "type": "string"},
)
HOLDS: Final[tuple[Table, ...]] = (
    {
        "id": "jog",
        "kind": "hold",
        "topic": "/jog",
        "type": "geometry_msgs/msg/Point",
        "message": {"x": "{speed}", "y": 0, "z": 0},
        "release": {"x": 0, "y": 0, "z": 0},
        **GATED,
    },
    {
        "id": "stick",
        "kind": "joystick",
        "topic": "/stick",
        "type": "geometry_msgs/msg/TwistStamped",
        "message": {"twist": {"linear": {"x": "{y}"}, "angular": {"z": "{x}"}}},
        "x_axis": {"max": 1.0},
        "y_axis": {"max": 0.5},
        **GATED,
    },
)
INPUTS: Final = {
    "message": st.text("aäß漢字😀 \"\\'{}", max_size=5).map(lambda text: f"x{text}x"),
    "speed": st.integers(-5000, 5000).map(lambda thousandths: thousandths / 1000),
    "number": st.integers(0, 40),
    "sure": st.booleans(),
}

# The requests of the services, which rosbags lacks; the messages in them are its own.
REQUESTS: Final = {
    "example_interfaces/msg/AddTwoInts_Request": "int64 a\nint64 b",
    "example_interfaces/msg/Fibonacci_SendGoal_Request": "uint8[16] goal_id\nint32 order",
    "example_interfaces/msg/Fibonacci_GetResult_Request": "uint8[16] goal_id",
    "action_msgs/msg/CancelGoal_Request": (
        "uint8[16] goal_id\nbuiltin_interfaces/Time stamp"  # of a GoalInfo
    ),
    "rcl_interfaces/msg/SetParameters_Request": "rcl_interfaces/Parameter[] parameters",
    "rcl_interfaces/msg/GetParameters_Request": "string[] names",
    "rcl_interfaces/msg/DescribeParameters_Request": "string[] names",
}
TYPES: Final = get_typestore(Stores.ROS2_JAZZY)
for _name, _text in REQUESTS.items():
    TYPES.register(get_types_from_msg(_text, _name))
TYPE_OF: Final = {
    "rosout": "rcl_interfaces/msg/Log",
    "say": "std_msgs/msg/String",
    "kept": "std_msgs/msg/Bool",
    "cmd_vel": "geometry_msgs/msg/TwistStamped",
    "path": "nav_msgs/msg/Path",
    "rate": "std_msgs/msg/Int8",
    "lamps/set": "std_msgs/msg/Bool",
    "jog": "geometry_msgs/msg/Point",
    "stick": "geometry_msgs/msg/TwistStamped",
    "add": "example_interfaces/msg/AddTwoInts_Request",
    "count/_action/send_goal": "example_interfaces/msg/Fibonacci_SendGoal_Request",
    "count/_action/get_result": "example_interfaces/msg/Fibonacci_GetResult_Request",
    "count/_action/cancel_goal": "action_msgs/msg/CancelGoal_Request",
    "arm/set_parameters": "rcl_interfaces/msg/SetParameters_Request",
    "arm/get_parameters": "rcl_interfaces/msg/GetParameters_Request",
    "arm/describe_parameters": "rcl_interfaces/msg/DescribeParameters_Request",
}


class Sent(NamedTuple):
    """A message or a query, as Zenoh got it."""

    expression: str
    payload: bytes | None
    attachment: bytes | None

    @property
    def key(self) -> str:
        """The ROS name without its first slash."""
        parts = self.expression.split("/")
        return "/".join(parts[1:-2] if parts[0] == "0" else parts)


class Wire:
    def __init__(self) -> None:
        self.sent: list[Sent] = []
        self.deleted: list[str] = []

    def of_key(self, key: str) -> list[Any]:
        """The decoded messages on a key."""
        return [decoded(sent) for sent in list(self.sent) if sent.key == key]


class RecordedPublisher:
    def __init__(self, publisher: Any, wire: Wire) -> None:
        self._publisher, self._wire = publisher, wire

    def put(self, payload: bytes, **options: Any) -> None:
        expression = str(self._publisher.key_expr)
        self._wire.sent.append(Sent(expression, payload, options.get("attachment")))
        self._publisher.put(payload, **options)

    def delete(self, **options: Any) -> None:
        self._wire.deleted.append(str(self._publisher.key_expr))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._publisher, name)


class RecordedSession:
    def __init__(self, session: zenoh.Session, wire: Wire) -> None:
        self.real, self._wire = session, wire

    def declare_publisher(self, expression: str, **options: Any) -> RecordedPublisher:
        return RecordedPublisher(self.real.declare_publisher(expression, **options), self._wire)

    def get(self, selector: str, *arguments: Any, **options: Any) -> Any:
        sent = Sent(str(selector), options.get("payload"), options.get("attachment"))
        self._wire.sent.append(sent)
        return self.real.get(selector, *arguments, **options)

    def put(self, expression: str, payload: bytes, **options: Any) -> None:
        self._wire.sent.append(Sent(str(expression), payload, options.get("attachment")))
        self.real.put(expression, payload, **options)

    def delete(self, expression: str, **options: Any) -> None:
        self._wire.deleted.append(str(expression))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.real, name)


class Running:
    """A session with its simulated robot, on a loop of its own: examples of hypothesis share it."""

    def __init__(self, panel: Panel, endpoint: str, wire: Wire) -> None:
        self.wire = wire
        self.loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self.loop.run_forever)
        self._thread.start()
        self._fleet = self.run(self._start(panel, endpoint))

    @property
    def session(self) -> RobotSession:
        return self._fleet.first

    def run(self, work: Coroutine[Any, Any, Result]) -> Result:
        return asyncio.run_coroutine_threadsafe(work, self.loop).result(3 * ENOUGH_S)

    async def _start(self, panel: Panel, endpoint: str) -> Fleet:
        fleet = Fleet(panel, lambda _: config_to(endpoint), "r1", NullLog())
        await fleet.start()
        return fleet

    def end(self) -> None:
        self.run(self._fleet.stop())
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join()
        self.loop.close()


@pytest.fixture(scope="module", params=["bridge", "rmw_zenoh"])
def running(request: pytest.FixtureRequest) -> Iterator[Running]:
    wire = Wire()

    def recorded(config: zenoh.Config, as_client: bool) -> tuple[Any, bool]:
        session, is_final = open_session(config, as_client)
        return RecordedSession(session, wire), is_final

    def latched(session: RecordedSession, expression: str, **options: Any) -> RecordedPublisher:
        return RecordedPublisher(declare_advanced_publisher(session.real, expression, **options), wire)

    labelled = ({"label": each["id"], **each} for each in (*COMMANDS, *HOLDS))
    dialect = str(request.param)
    panel = panel_of(
        MESSAGE, SPEED, NUMBER, SURE, *labelled, dialect=dialect, demo={"/count": {"duration_s": 20.0}}
    )
    with pytest.MonkeyPatch.context() as patch, in_process(panel) as endpoint:
        patch.setattr("app.ros.zenoh.session.open_session", recorded)
        patch.setattr("app.ros.zenoh.session.declare_advanced_publisher", latched)
        mine = Running(panel, endpoint, wire)
        yield mine
        mine.end()
    assert wire.deleted == []


def decoded(sent: Sent) -> Any:
    """The message, by rosbags: it is whole, and nothing is behind it."""
    assert sent.payload is not None, sent.expression
    payload, type_name = bytes(sent.payload), TYPE_OF[sent.key]
    message = TYPES.deserialize_cdr(payload, type_name)
    assert bytes(TYPES.serialize_cdr(message, type_name)) == payload, sent.expression
    return message


async def press_all(session: RobotSession, inputs: dict[str, Any], example: str) -> None:
    for command in COMMANDS:
        name = command["id"]
        await when(partial(enabled, session, name), f"{name} is open")
        entered = {**inputs, "feed": inputs["speed"], "name": inputs["message"]}
        entered |= {
            "rate": next_step(session) if name == "rate" else None,
            "lamps": other_position(session),
        }
        widget = session.presses.widget(name)
        taken = {key: entered[key] for key in (*input_ids(widget), name) if key in entered}
        receipt = await press_widget(session.presses, name, taken, f"{example}-{name}")
        assert receipt.outcome != "refused", (name, receipt)
        if name == "count":
            await when(lambda: session.publisher.view["widgets"]["count"]["stoppable"], "it runs")
            canceled = await session.presses.cancel(press_of(widget, {}, f"{example}-cancel"))
            assert canceled.outcome == "accepted", canceled
    for hold in HOLDS:
        await hold_once(session, hold["id"], inputs, f"{example}-{hold['id']}")


def next_step(session: RobotSession) -> int:
    """The next value of `rate`, or the one before."""
    now = int(session.robot.reading("/rated").value("data"))
    return now + 10 if now <= 80 else now - 10


def other_position(session: RobotSession) -> bool:
    """The position of `lamps` that the robot does not report: a switch is not sent the other one."""
    return not session.robot.reading("/lamps").value("data")


async def hold_once(session: RobotSession, name: str, inputs: dict[str, Any], press_id: str) -> None:
    await when(partial(enabled, session, name), f"{name} is open")
    press = press_of(session.holds.widget(name), inputs, press_id)
    holding = session.holds.begin(press, time.monotonic(), lambda _: None)
    if isinstance(holding, ActiveHold):  # else the loop stalled for longer than a lease
        session.holds.end(holding, RELEASED)


def check_wire(wire: Wire, dialect: str) -> None:
    """All that was sent so far."""
    numbers: dict[str, list[int]] = {}
    gids: dict[str, set[bytes]] = {}
    last_ns = 0
    for sent in list(wire.sent):
        if "@" in sent.expression:  # the admin space and caches: no node gets it
            assert sent.payload is None
            continue
        decoded(sent)
        if dialect == "bridge":
            assert sent.attachment is None
            continue
        assert sent.attachment is not None, sent.expression
        number, at_ns, length, gid = struct.unpack("<qqB16s", sent.attachment)
        numbers.setdefault(sent.expression, []).append(number)
        gids.setdefault(sent.expression, set()).add(gid)
        assert (length, at_ns >= last_ns - 10**9) == (16, True)
        last_ns = max(last_ns, at_ns)
    for expression, counted in numbers.items():
        assert counted == list(range(1, len(counted) + 1)), expression
        assert len(gids[expression]) == 1
    assert len({gid for several in gids.values() for gid in several}) == len(gids)


# An example is not made smaller: what was sent before it stays.
@settings(max_examples=12, phases=[Phase.generate], suppress_health_check=list(HealthCheck))
@given(inputs=st.fixed_dictionaries(INPUTS))
def test_every_command_leaves_whole(running: Running, inputs: dict[str, Any]) -> None:
    wire, session = running.wire, running.session
    running.run(press_all(session, inputs, f"p{len(wire.sent)}"))
    dialect = str(session.panel.dialect)
    check_wire(wire, dialect)
    assert wire.of_key("say")[-1].data == inputs["message"]
    assert wire.of_key("kept")[-1].data is inputs["sure"]
    drive = wire.of_key("cmd_vel")[-1]
    assert (drive.header.frame_id, drive.twist.linear.x) == (inputs["message"], inputs["speed"])
    first, second = wire.of_key("path")[-1].poses
    assert (first.pose.position.x, second.header.frame_id) == (inputs["speed"], inputs["message"])
    assert (wire.of_key("add")[-1].a, wire.of_key("add")[-1].b) == (inputs["number"], 2)
    assert wire.of_key("count/_action/send_goal")[-1].order == inputs["number"]
    texts = [
        parameter.value.string_value
        for request in wire.of_key("arm/set_parameters")
        for parameter in request.parameters
        if parameter.name == "name"
    ]
    assert texts[-1] == inputs["message"]


def test_every_kind_has_been_sent(running: Running) -> None:
    running.run(
        press_all(running.session, {"message": "m", "speed": 1.5, "number": 3, "sure": True}, "e")
    )

    logging.getLogger("kiosk.test").warning("a line of the log")

    def missing() -> set[str]:
        return TYPE_OF.keys() - {sent.key for sent in list(running.wire.sent)}

    with suppress(AssertionError):
        running.run(when(lambda: not missing(), "each kind of message and request"))
    assert missing() == set()
    check_wire(running.wire, str(running.session.panel.dialect))
    stops = running.wire.of_key("jog")[-1]
    assert (stops.x, stops.y, stops.z) == (0.0, 0.0, 0.0)
