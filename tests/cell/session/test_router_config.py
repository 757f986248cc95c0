"""The real router with what `operator-panel router-config` writes: the panel works through it, and
whoever connects where the panel does can send nothing else. The robot is on hiroz."""

import asyncio
import json
import tempfile
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
import zenoh

from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.panel import load_panel
from app.records import NullLog
from app.ros.zenoh.config import config_to
from tests.cell.session.test_rmw_zenoh import asked, enabled
from tests.support.builders import press_widget
from tests.support.parts import Process, until
from tests.support.rmw import RmwNode, Router, configured_router
from tests.support.waiting import when

PANEL: Final = """
title = "Cell"
dialect = "rmw_zenoh"
interlock = [{ id = "operation", topic = "/operation_enabled" }]
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "message"
kind = "text"
label = "Message"
[[page.widget]]
id = "say"
kind = "publish"
label = "Say"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "{message}" }
interlock = "operation"
[[page.widget]]
id = "order"
kind = "publish"
label = "Order"
topic = "/operation"
type = "std_msgs/msg/String"
message = { data = "{message}" }
[[page.widget]]
id = "mode"
kind = "publish"
label = "Mode"
topic = "/mode"
type = "std_msgs/msg/String"
message = { data = "manual" }
qos = { durability = "transient_local" }
[[page.widget]]
id = "last"
kind = "readout"
label = "Heard"
topic = "/last_heard"
type = "std_msgs/msg/String"
[[page.widget]]
id = "add"
kind = "call"
label = "Add"
service = "/add"
type = "example_interfaces/srv/AddTwoInts"
request = { a = 40, b = 2 }
answer = "the sum is {sum}"
[[page.widget]]
id = "count"
kind = "action"
label = "Count"
action = "/count"
type = "example_interfaces/action/Fibonacci"
goal = { order = 5 }
[[page.widget]]
id = "speed"
kind = "parameter"
label = "Speed"
node = "/system_controller"
parameter = "max_speed"
type = "integer"
min = 0
max = 60
"""
TEXT: Final = "std_msgs::msg::dds_::String_"
ATTACHMENT: Final = bytes.fromhex("01000000000000000100000000000000") + b"\x10" + bytes(16)
FORGED: Final = b"\x00\x01\x00\x00\x01"


@pytest.fixture
def door() -> Iterator[str]:
    """Where the panel connects: a socket, whose path must be short."""
    with tempfile.TemporaryDirectory(dir="/tmp", prefix="panel-") as folder:
        yield f"unixsock-stream/{folder}/panel.sock"


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(PANEL)
    return path


# A session sends only what it knows a subscriber of. With this rule it is told of all.
TOLD_OF_ALL: Final = {
    "id": "told",
    "permission": "allow",
    "flows": ["egress"],
    "messages": ["declare_subscriber", "declare_queryable"],
    "key_exprs": ["**"],
}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "router.json5"


@pytest.fixture
def stopped_router(zenohd: None, panel: Path, file: Path, door: str) -> Iterator[Router]:
    """The configuration is in `file`."""
    mine = configured_router(panel, file, door)
    yield mine
    mine.end()


@pytest.fixture
def router(stopped_router: Router) -> Router:
    stopped_router.start()
    return stopped_router


@pytest.fixture
def telling_router(stopped_router: Router, file: Path) -> Router:
    """The same, but it tells everyone of all subscribers and servers."""
    config = zenoh.Config.from_file(file)
    access = json.loads(config.get_json("access_control"))
    access["rules"].append(TOLD_OF_ALL)
    access["policies"].append({"rules": ["told"], "subjects": ["panel"]})
    config.insert_json5("access_control", json.dumps(access))
    file.write_text(str(config))
    stopped_router.start()
    return stopped_router


# Messages of a topic that come within 100 s of one are dropped, as where a connection is slow: neither
# what their publisher says of their numbers, nor answers.
DROPPED: Final = {
    "messages": ["put"],
    "flows": ["egress"],
    "rules": [{"key_expr": "0/operation_enabled/*/*", "freq": 0.01}],
}


@pytest.fixture
def dropping_router(stopped_router: Router, file: Path) -> Router:
    text = file.read_text().rstrip().removesuffix("}")
    file.write_text(f"{text}  downsampling: [{json.dumps(DROPPED)}],\n}}\n")
    stopped_router.start()
    return stopped_router


def test_the_last_value_of_a_latched_topic_is_asked_for_if_it_was_dropped(
    dropping_router: Router, door: str, panel: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A control stayed open for good: a node on rmw_zenoh does not send it again."""
    enables: Final = ("/operation_enabled", "std_msgs/msg/Bool")

    async def scene() -> None:
        robot = await asked(RmwNode, dropping_router, "system_controller")
        try:
            async with session_by(door, panel) as session:
                await asked(partial(robot.subscribe, "/operation", "std_msgs/msg/String"))
                latched = {"durability": "transient_local", "depth": 1}
                await asked(partial(robot.advertise, *enables, **latched))
                await when(partial(session.robot.graph.has_endpoint, "MP", enables[0][1:]))
                await asked(robot.publish, enables[0], {"data": True})
                await when(partial(enabled, session, "say"), "the first message is not dropped")
                await asked(robot.publish, enables[0], {"data": False})
                await when(lambda: not enabled(session, "say"), "the second is asked for")
                await asked(robot.publish, enables[0], {"data": True})
                await when(partial(enabled, session, "say"), "the third too")
        finally:
            await asked(robot.end)

    asyncio.run(scene())
    (line,) = (line for line in caplog.messages if "than has arrived" in line)
    assert "operation_enabled" in line, "one line a minute, though each change is lost"


def test_what_was_dropped_of_a_node_on_hiroz_is_asked_for(
    dropping_router: Router, door: str, panel: Path, hiroz: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Its makers number its messages by zenoh-ext, as rmw_zenoh_cpp does."""

    async def scene() -> None:
        async with session_by(door, panel) as session:
            with hiroz_robot(hiroz, dropping_router) as robot:

                async def order(word: str) -> None:
                    sent = await press_widget(session.presses, "order", {"message": word}, word)
                    assert sent.outcome == "published", sent.reason
                    await when(lambda: f"heard {word}" in robot.text, "the robot has it")

                await when(partial(enabled, session, "say"), "its latched permission came")
                await when(partial(enabled, session, "order"))
                await order("permit")  # the first that passes the router
                await order("forbid")
                await when(lambda: not enabled(session, "say"), "what was dropped is asked for")

    asyncio.run(scene())
    assert [line for line in caplog.messages if "operation_enabled than has arrived" in line]


@contextmanager
def hiroz_robot(hiroz: Path, router: Router) -> Iterator[Process]:
    mine = Process([str(hiroz), router.endpoint], {})
    until(lambda: "running" in mine.text or not mine.running, "it runs")
    assert mine.running, mine.text
    yield mine
    mine.kill()


@pytest.fixture
def robot(hiroz: Path, router: Router) -> Iterator[Process]:
    with hiroz_robot(hiroz, router) as mine:
        yield mine


@asynccontextmanager
async def session_by(door: str, panel: Path) -> AsyncIterator[RobotSession]:
    fleet = Fleet(load_panel(panel), lambda _: config_to(door), "r1", NullLog())
    await fleet.start()
    try:
        with fleet.first.publisher.watching(""):  # a client sees every page
            yield fleet.first
    finally:
        await fleet.stop()


def test_the_panel_works_through_the_router(
    router: Router, door: str, panel: Path, robot: Process
) -> None:
    async def scene() -> None:
        late = await asked(RmwNode, router, "late")
        try:
            async with session_by(door, panel) as session:
                shown = session.publisher
                for name in ("say", "add", "count", "speed"):
                    await when(partial(enabled, session, name), f"{name} is open")
                assert sorted(await asked(late.nodes)) == ["/late", "/system_controller", "/web_ui"]
                pressed = {
                    name: await press_widget(session.presses, name, inputs, name)
                    for name, inputs in (("say", {"message": "hi"}), ("add", {}), ("count", {}))
                }
                assert {name: receipt.outcome for name, receipt in pressed.items()} == {
                    "say": "published",
                    "add": "succeeded",
                    "count": "accepted",
                }
                await when(lambda: "heard hi" in robot.text, "the robot has it")
                await when(lambda: "hi" in str(shown.view["widgets"]["last"]), "it says it back")
                await when(lambda: shown.view["widgets"]["count"]["outcome"] == "succeeded")
                changed = await press_widget(session.presses, "speed", {"speed": 33}, "speed")
                assert changed.outcome == "succeeded", changed.reason

                await press_widget(session.presses, "mode", {}, "mode")
                latched = {"durability": "transient_local", "depth": 1}
                await asked(partial(late.subscribe, "/mode", "std_msgs/msg/String", **latched))
                await when(lambda: late.heard_data("/mode") == ["manual"], "its last message came")
        finally:
            await asked(late.end)

    asyncio.run(scene())


@pytest.fixture
def open_session() -> Iterator[Callable[[str], zenoh.Session]]:
    opened: list[zenoh.Session] = []

    def connect(endpoint: str) -> zenoh.Session:
        config = config_to(endpoint)
        config.insert_json5("mode", '"client"')
        opened.append(zenoh.open(config))
        return opened[-1]

    yield connect
    for session in opened:
        session.close()


class Wire:
    """What a node on the robot's side of the router receives."""

    def __init__(self, session: zenoh.Session) -> None:
        self.received: list[tuple[str, str]] = []
        self._held: list[Any] = [
            session.declare_subscriber("0/*/*/*", self._receive),
            session.liveliness().declare_subscriber("@ros2_lv/**", self._receive, history=True),
            session.declare_queryable("0/*/std_srvs::srv::dds_::Trigger_/*", self._asked),
        ]

    def _receive(self, sample: zenoh.Sample) -> None:
        self.received.append((str(sample.key_expr), str(sample.kind)))

    def _asked(self, query: zenoh.Query) -> None:
        with query:
            self.received.append((str(query.key_expr), "query"))

    def seen(self) -> set[str]:
        return {key for key, _ in self.received}


def test_a_stranger_at_the_panels_door_sends_and_reads_nothing_else(
    telling_router: Router, door: str, open_session: Callable[[str], zenoh.Session]
) -> None:
    """In the order of a connection: what is allowed and sent last arrives after what is not."""
    nodes, stranger = open_session(telling_router.endpoint), open_session(door)
    wire, read = Wire(nodes), list[str]()

    def hear(sample: zenoh.Sample) -> None:
        read.append(str(sample.key_expr))

    held: list[Any] = [
        *(
            stranger.declare_subscriber(key, hear, allowed_origin=zenoh.Locality.REMOTE)
            for key in ("**", "0/secret/*/*", f"0/last_heard/{TEXT}/H")
        ),
        stranger.declare_queryable("0/add/*/*", lambda query: query.drop()),
        *(
            stranger.liveliness().declare_token(f"@ros2_lv/0/1a/0/{place}")
            for place in (
                "0/NN/%/%/evil",
                "1/MP/%/%/web_ui/%operation_enabled/std_msgs::msg::dds_::Bool_/H/::,10:,:,:,,",
                "2/SS/%/%/web_ui/%add/example_interfaces::srv::dds_::AddTwoInts_/H/::,10:,:,:,,",
                "0/NN/%/%/web_ui",
            )
        ),
    ]
    for key in (
        "0/operation_enabled/std_msgs::msg::dds_::Bool_/H",
        f"0/last_heard/{TEXT}/H",
        f"0/operation/{TEXT.replace('String', 'Bool')}/H",
        f"1/operation/{TEXT}/H",
        "0/**",
    ):
        stranger.put(key, FORGED, attachment=ATTACHMENT)
    stranger.delete(f"0/operation/{TEXT}/H")
    asked_for = list(stranger.get("0/shutdown/std_srvs::srv::dds_::Trigger_/H", payload=FORGED))
    assert asked_for == []

    allowed = f"0/operation/{TEXT}/H"
    subscribed = nodes.declare_subscriber(allowed, wire._receive)  # a node subscribes to it by its name
    publisher: Any = stranger.declare_publisher(allowed)
    until(lambda: publisher.matching_status.matching, "it sees the subscriber of a command")
    publisher.put(FORGED, attachment=ATTACHMENT)
    until(lambda: allowed in wire.seen(), "what the panel may send arrives")
    until(lambda: any("web_ui" in key for key in wire.seen()), "its node is seen")
    assert wire.seen() == {allowed, "@ros2_lv/0/1a/0/0/NN/%/%/web_ui"}
    assert {kind for _, kind in wire.received} == {str(zenoh.SampleKind.PUT)}

    nodes.put("0/secret/std_msgs::msg::dds_::String_/H", b"x")
    nodes.put(f"0/last_heard/{TEXT}/H", b"x")
    until(lambda: read, "what the panel reads arrives")
    assert set(read) == {f"0/last_heard/{TEXT}/H"}
    del held, subscribed
