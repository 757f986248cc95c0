"""A robot without a bridge: another dialect and another peer, on real Zenoh, and the same panel."""

import asyncio
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

import pytest
import zenoh
from zenoh.handlers import Callback

from app.cell.link.peer import RobotAccess, RobotContext
from app.cell.link.robot_access import ROBOT_ACCESS
from app.cell.session.fleet import Fleet
from app.records import NullLog
from app.ros.dialects.dialect import DialectName, Endpoint, PanelEndpoint, Role
from app.ros.dialects.peer_traits import BRIDGE_TRAITS, PEER_TRAITS
from app.ros.graph.model import (
    EndpointQos,
    GraphSnapshot,
    Node,
    RobotGraph,
    Server,
    SurveyedTopic,
    TopicEndpoint,
)
from app.ros.messages.names import Qos
from app.ros.zenoh.answers import GraphLink
from app.ros.zenoh.config import config_to
from app.system.texts import say
from app.tools.cli.robot.options import GONE
from app.tools.cli.robot.scaffold import main as scaffold
from app.tools.cli.robot.topics import main as topics
from app.tools.doctor.findings import Report
from app.tools.doctor.names import PanelRobot
from app.tools.doctor.robot import check_robot
from tests.support.builders import (
    BOOL,
    ENABLED,
    GUARDED,
    HEARD,
    INTERFACES,
    MESSAGE,
    panel_of,
    press_widget,
)
from tests.support.waiting import when

TRIGGER = "std_srvs/srv/Trigger"
CALL = {"id": "reset", "kind": "call", "label": "Reset", "service": "/reset", "type": TRIGGER}
PANEL = panel_of(MESSAGE, {**GUARDED, "id": "go", "topic": "/go"}, HEARD, CALL)
TINY_TRAITS = replace(
    BRIDGE_TRAITS,
    sentences=replace(BRIDGE_TRAITS.sentences, lamp="robot", absent="service_unavailable"),
)
ROLES: dict[str, Role] = {"MP": "MP", "MS": "MS", "SS": "SS"}


class TinyDialect:
    """Key expressions with their types, and messages with their numbers: as a robot's own nodes have
    them, but shorter."""

    tokens = ("tiny/*/**",)
    as_client = False
    keeps_log = False

    def topic(self, key: str, type_name: str) -> str:
        return f"7/{key}/{type_name.replace('/', '::')}/*"

    def service(self, key: str, type_name: str) -> str:
        return self.topic(key, type_name)

    def attachment(self, zid: str, expression: str, number: int, at_ns: int) -> bytes | None:
        return b"%d of %s" % (number, zid.encode())

    def is_whole(self, payload: bytes) -> bool:
        return bool(payload)

    def accepts(self, attachment: bytes | None) -> bool:
        return True

    def key_hash(self, type_name: str) -> str:
        return ""

    def own_tokens(self, zid: str, endpoints: Iterable[PanelEndpoint]) -> list[str]:
        topics = (self.token(zid, endpoint.role, endpoint.key, endpoint.type) for endpoint in endpoints)
        return [f"tiny/{zid}/node/web_ui", *topics]

    def token(self, zid: str, role: str, key: str, type_name: str) -> str:
        return f"tiny/{zid}/{role}/{key.replace('/', '%')}/{type_name.replace('/', '%')}"

    def endpoint(self, token: str) -> Endpoint | None:
        _, zid, role, *names = token.split("/")
        if role == "node":
            return Endpoint(zid)
        key, type_name = (name.replace("%", "/") for name in names)
        return Endpoint(zid, ROLES[role], key, type_name) if role in ROLES else None

    def panel_node(self, token: str) -> Endpoint | None:
        return None

    def name_in(self, token: str) -> str:
        parts = token.split("/")
        return "" if parts[2] == "node" else parts[3]

    def in_token(self, key: str) -> str:
        return key.replace("/", "%")


class TinyPeer:
    """Of a robot whose nodes are its peers: joined as soon as one is there."""

    def __init__(self, context: RobotContext) -> None:
        self._context = context
        self.said: list[str] = []

    def start(self) -> None: ...

    async def stop(self) -> None: ...

    def appeared(self, zids: Iterable[str]) -> None:
        self.said += [f"found {zid}" for zid in zids]

    def lost(self, zids: Iterable[str]) -> None:
        self.said += [f"lost {zid}" for zid in zids]

    def on_graph_change(self, peer_appeared: bool) -> None:
        robot, link = self._context.robot, self._context.link
        if peer_appeared:
            own = PanelEndpoint("MP", robot.key("/go"), "std_msgs/msg/String", Qos())
            link.declare_tokens(robot.dialect.own_tokens(link.zid, [own]))
            robot.settled_at = time.monotonic()

    def check_stall(self) -> None: ...

    async def flushed(self) -> bool:
        return True

    async def answers(self) -> bool:
        return True


async def observe_tiny(
    link: GraphLink, zid: str, earlier: GraphSnapshot | None = None
) -> GraphSnapshot:
    """One robot, of all nodes on the link. Their tokens arrive some time after the connection."""
    end = time.monotonic() + 3.0
    while not (graph := tiny_graph(await link.tokens(), zid)).robots and time.monotonic() < end:
        await asyncio.sleep(0.02)
    return graph


def tiny_graph(tokens: Sequence[str], zid: str) -> GraphSnapshot:
    endpoints = [e for e in map(TinyDialect().endpoint, tokens) if e is not None and e.zid != zid]
    names = [token.rpartition("/")[2] for token in tokens if "/node/" in token]
    nodes = [Node(name=f"/{name}", bridge="") for name in sorted(names)]
    topics = [
        SurveyedTopic(
            name=f"/{e.key}",
            key=e.key,
            publishers=(TopicEndpoint(type=e.type, qos=EndpointQos(), bridge=e.zid),),
        )
        for e in endpoints
        if e.role == "MP"
    ]
    servers = [
        Server(name=f"/{e.key}", key=e.key, type=e.type, bridge=e.zid)
        for e in endpoints
        if e.role == "SS"
    ]
    robot = RobotGraph(nodes=tuple(nodes), topics=tuple(topics), services=tuple(servers))
    return GraphSnapshot(robots=(robot,) if nodes else ())


TINY = RobotAccess(lambda _domain, _hash: TinyDialect(), TINY_TRAITS, TinyPeer, observe_tiny)


class TinyRobot:
    """A node on Zenoh that permits, listens to `/go` and serves `/reset`."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self.zid = str(session.zid())
        self.heard: list[tuple[str, bytes]] = []
        self.attachments: list[bytes] = []
        self._declared: list[Any] = [
            session.declare_subscriber(
                "7/go/std_msgs::msg::String/h1", Callback(self._hear, indirect=False)
            ),
            session.declare_queryable(
                "7/reset/std_srvs::srv::Trigger/h2",
                Callback(self._serve, indirect=False),
                complete=True,
            ),
        ]

    def appear(self) -> None:
        tiny, declare = TinyDialect(), self._session.liveliness().declare_token
        own = [("MP", "operation_enabled", BOOL), ("SS", "reset", TRIGGER)]
        self._declared += [declare(tiny.token(self.zid, *arguments)) for arguments in own]
        self.nodes_alive = [declare(f"tiny/{self.zid}/node/{name}") for name in ("arm", "gripper")]

    def say(self, permitted: bool) -> bool:
        payload = INTERFACES.encode(BOOL, {"data": permitted})
        self._session.put("7/operation_enabled/std_msgs::msg::Bool/h3", payload)
        return permitted

    def has_heard(self, number: int) -> bool:
        return len(self.heard) == number

    def nodes(self) -> set[str]:
        """All tokens that are there."""
        replies = self._session.liveliness().get("tiny/**", timeout=2)
        return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}

    def _hear(self, sample: zenoh.Sample) -> None:
        text = INTERFACES.decode("std_msgs/msg/String", sample.payload.to_bytes()).data
        assert sample.attachment is not None
        self.heard.append((text, sample.attachment.to_bytes()))

    def _serve(self, query: zenoh.Query) -> None:
        with query:
            assert query.attachment is not None
            self.attachments.append(query.attachment.to_bytes())
            answer = INTERFACES.encode(f"{TRIGGER}_Response", {"success": True, "message": "done"})
            query.reply("7/reset/std_srvs::srv::Trigger/h2", answer)


def test_each_dialect_that_a_panel_may_have_is_reached() -> None:
    assert set(ROBOT_ACCESS) == set(PEER_TRAITS) == set(get_args(DialectName))
    assert all(access.traits is PEER_TRAITS[name] for name, access in ROBOT_ACCESS.items())


def test_a_robot_without_a_bridge_is_reached_by_its_own_keys(
    peer: tuple[str, zenoh.Session], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seen, joined, heard, commanded and called, with not one of the bridge's key expressions."""
    endpoint, there = peer
    robot = TinyRobot(there)
    monkeypatch.setitem(ROBOT_ACCESS, PANEL.dialect, TINY)

    async def scene() -> None:
        fleet = Fleet(PANEL, lambda _: config_to(endpoint), "r1", NullLog())
        session = fleet.first
        await session.start()
        await when(lambda: session.robot.link_up)
        await when(lambda: session.link_verdict.code != "link_starting")
        assert (
            session.link_verdict.code == "service_unavailable"
        )  # by the sentences of this kind of peer
        assert session.publisher.view["link"]["bridge"]["name"] == say("robot")
        assert session.publisher.view["link"]["bridge"]["text"] == say("absent")
        robot.appear()
        await when(lambda: session.link_verdict.permitted)
        assert isinstance(session.peer, TinyPeer)
        assert session.peer.said == [f"found {robot.zid}"]
        assert (await session.check_readiness()).permitted

        shown = session.publisher
        await when(lambda: robot.say(True) and shown.view["interlocks"]["operation"]["enabled"])
        await when(lambda: session.link.has_reader("go"))
        for number, text in enumerate(("one", "two"), 1):
            receipt = await press_widget(session.presses, "go", {"message": text}, text)
            assert receipt.outcome == "published", receipt.reason
            await when(partial(robot.has_heard, number))
        zid = session.link.zid.encode()
        assert robot.heard == [("one", b"1 of " + zid), ("two", b"2 of " + zid)]

        await when(lambda: session.publisher.view["widgets"]["reset"]["enabled"])
        receipt = await press_widget(session.presses, "reset", {}, "p3")
        assert receipt.outcome == "succeeded", receipt.reason
        assert robot.attachments == [b"1 of " + zid]
        own = {
            f"tiny/{session.link.zid}/node/web_ui",
            f"tiny/{session.link.zid}/MP/go/std_msgs%msg%String",
        }
        assert own <= await asyncio.to_thread(robot.nodes)

        robot.nodes_alive.pop().undeclare()  # one of the two nodes of this session ends
        robot.say(False)  # arrives after that
        await when(lambda: not shown.view["interlocks"]["operation"]["enabled"])
        assert session.robot.reading(ENABLED).value("data") is False
        assert session.link_verdict.permitted
        assert session.peer.said == [f"found {robot.zid}"]
        assert shown.view["widgets"]["reset"]["enabled"]
        robot.nodes_alive.pop().undeclare()
        await when(lambda: session.link_verdict.code == "service_unavailable")
        assert session.peer.said == [f"found {robot.zid}", f"lost {robot.zid}"]
        await session.stop()

    asyncio.run(scene())


@pytest.mark.long("detail")
def test_commands_and_doctor_read_a_robot_without_a_bridge(
    peer: tuple[str, zenoh.Session],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    endpoint, there = peer
    monkeypatch.setitem(ROBOT_ACCESS, PANEL.dialect, TINY)
    assert topics(["--connect", endpoint]) == GONE
    assert f"no {TINY_TRAITS.title} is there: {TINY_TRAITS.start_hint}" in capsys.readouterr().err
    robot = TinyRobot(there)
    robot.appear()
    assert topics(["--connect", endpoint, "-t"]) == 0
    assert capsys.readouterr().out == f"/operation_enabled [{BOOL}]\n"
    panel = tmp_path / "cell.toml"
    assert scaffold(["--connect", endpoint, "--listen", "0.1", "-o", str(panel)]) == 0
    assert ENABLED in panel.read_text()

    zenoh_file = tmp_path / "zenoh.json5"
    zenoh_file.write_text(f'{{ mode: "client", connect: {{ endpoints: ["{endpoint}"] }} }}')
    report = Report()
    graph = asyncio.run(check_robot(report, PanelRobot(PANEL), zenoh_file, 0.2))
    assert graph is not None
    assert [node.name for node in graph.robots[0].nodes] == ["/arm", "/gripper"]
    assert "the robot has nodes: 2, and topics: 1" in report.facts
    assert not [code for code in report.codes() if code.startswith("bridge")]
