"""`operator-panel doctor` on broken set-ups of the real bridge and real nodes: each is named right, and
nothing else is."""

import json
import socket
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh

from app.ros.dialects.dialect import Dialect
from app.ros.graph import bridge_graph
from app.ros.zenoh.inbox import Changes
from app.ros.zenoh.session import ZenohSession
from app.tools.cli.command import main
from app.tools.cli.doctor import as_text
from app.tools.doctor import robot as link
from app.tools.doctor.received import ReceivedSamples, receive
from tests.support.cyclone import Client
from tests.support.parts import ENOUGH_S, Bridge, RosNode, free_port, publish_and_go, until
from tests.support.processes import command
from tests.support.processes.command import COMMAND
from tests.tools.doctor.setups import (
    BOOL,
    LONGEST_S,
    STRING,
    Setup,
    action,
    button,
    call,
    interlock,
    named,
    panel_of,
    parameter,
    readout,
)

pytestmark = pytest.mark.promise("doctor")

TRIGGER = "std_srvs/srv/Trigger"
LIST_PARAMETERS = "rcl_interfaces/srv/ListParameters"
JOINTS = "sensor_msgs/msg/JointState"
ANNOUNCED = (
    "/permission",
    "/words",
    "/stamped",
    "/simulated",
    "/lossy",
    "/once",
    "/refused",
    "/cell/elsewhere",
)


@pytest.fixture(scope="module")
def shared(domain: int) -> Iterator[Bridge]:
    mine = Bridge(domain + 3)
    mine.start()
    yield mine
    mine.end()


@pytest.fixture(scope="module")
def robot(shared: Bridge) -> Iterator[RosNode]:
    """A node whose topics the bridge has announced."""
    node, client = RosNode(shared.domain), Client(shared.endpoint)
    node.advertise("/permission", BOOL)
    node.every("/permission", {"data": True}, 0.1)
    node.advertise("/words", STRING)
    node.every("/words", {"data": "hello"}, 0.2)
    node.advertise("/stamped", JOINTS)
    node.every("/stamped", {"header": {"stamp": {"sec": 1_700_000_000}}}, 0.2)
    node.advertise("/simulated", JOINTS)
    node.every("/simulated", {"header": {"stamp": {"sec": 12}}}, 0.2)
    node.advertise("/lossy", STRING, reliability="best_effort")
    node.advertise("/once", BOOL)
    node.advertise("/refused", BOOL, durability="transient_local")
    node.publish("/refused", {"data": False})
    node.subscribe("/heard", STRING)
    node.advertise("/cell/elsewhere", STRING)
    offered = [f"/system_controller/{name}_parameters" for name in ("list", "get")]
    until(lambda: announced(client, *ANNOUNCED, "/heard", *offered), "the bridge has announced them")
    yield node
    client.close()
    node.end()


@pytest.fixture
def setup(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Setup:
    """Waits for a bridge that is slow on a busy machine."""
    monkeypatch.setattr(link, "HANDSHAKE_S", ENOUGH_S)
    monkeypatch.setattr(link, "ASK_S", ENOUGH_S)
    monkeypatch.setattr(bridge_graph, "ANNOUNCED_WITHIN_S", ENOUGH_S)
    return Setup(tmp_path)


@pytest.fixture
def short_setup(tmp_path: Path) -> Setup:
    """Waits no longer than the command does: nothing comes."""
    return Setup(tmp_path)


def announced(client: Client, *names: str) -> bool:
    tokens = client.tokens()
    return all(any(f"{name}/" in token for token in tokens) for name in names)


WELL = panel_of(interlock("/permission"), readout("/words"), readout("/lossy"), button("/heard"))
# What is broken, and what is said of it: (code, name) of each finding.
BROKEN: list[tuple[str, str, list[tuple[str, str]]]] = [
    (
        "a topic of another type",
        panel_of(readout("/words", BOOL)),
        [("topic_type", "/words")],
    ),
    (
        "a topic that no node publishes",
        panel_of(readout("/wrods")),
        [("topic_no_publisher", "/wrods")],
    ),
    (
        "a press without a subscriber",
        panel_of(button("/unheard")),
        [("topic_no_subscriber", "/unheard")],
    ),
    (
        "a permission that no node publishes",
        panel_of(interlock("/nowhere")),
        [("permission_no_publisher", "/nowhere")],
    ),
    (
        "a volatile permission that is not repeated",
        panel_of(interlock("/once")),
        [("permission_not_latched", "/once")],
    ),
    (
        "a permission that comes too seldom",
        panel_of(interlock("/once", max_age_s=0.5)),
        [("permission_stale", "/once")],
    ),
    (
        "a robot with a namespace that the panel does not have",
        panel_of(readout("/elsewhere")),
        [("robot_elsewhere", ""), ("topic_no_publisher", "/elsewhere")],
    ),
    (
        "another QoS",
        panel_of(readout("/lossy", qos={"reliability": "reliable"})),
        [("topic_qos", "/lossy")],
    ),
    (
        "a service that no node offers",
        panel_of(call("/no_service", TRIGGER)),
        [("service_absent", "/no_service")],
    ),
    (
        "a service of another type",
        panel_of(call("/system_controller/list_parameters", TRIGGER)),
        [("service_type", "/system_controller/list_parameters")],
    ),
    (
        "a service of a node on Fast DDS",
        panel_of(call("/system_controller/list_parameters", LIST_PARAMETERS)),
        [("wrong_rmw", "/system_controller/list_parameters")],
    ),
    (
        "parameters of a node on Fast DDS",
        panel_of(parameter("/system_controller")),
        [("wrong_rmw", "/system_controller")],
    ),
    (
        "parameters of a node that does not run",
        panel_of(parameter("/arm")),
        [("parameters_absent", "/arm")],
    ),
    (
        "an action that no node offers",
        panel_of(action("/no_action")),
        [("action_absent", "/no_action")],
    ),
    (
        "a clock that is years behind",
        panel_of(readout("/stamped", JOINTS, field="header.stamp.sec")),
        [("other_time", "/stamped")],
    ),
    (
        "simulated time",
        panel_of(readout("/simulated", JOINTS, field="header.stamp.sec")),
        [("simulated_time", "/simulated")],
    ),
]


async def receive_all(
    session: ZenohSession,
    dialect: Dialect,
    topics: Mapping[str, str],
    _: Iterable[str],
    longest_s: float,
) -> ReceivedSamples:
    """Waits for messages on every topic."""
    return await receive(session, dialect, topics, topics, longest_s)


@pytest.mark.long("every screen")
@pytest.mark.parametrize(("text", "expected"), [b[1:] for b in BROKEN], ids=[b[0] for b in BROKEN])
def test_what_is_broken_is_named_and_nothing_else(
    text: str,
    expected: list[tuple[str, str]],
    shared: Bridge,
    robot: RosNode,
    setup: Setup,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    listen_s = 0.2
    if expected[0][0] in {"permission_not_latched", "permission_stale"}:
        listen_s = LONGEST_S
    elif expected[0][0] in {"other_time", "simulated_time"}:
        listen_s = ENOUGH_S
        monkeypatch.setattr("app.tools.doctor.robot.receive", receive_all)
    findings = setup.findings(text, shared.endpoint, listen_s)
    assert named(findings) == expected
    assert all(finding.sentence and finding.do for finding in findings)


def test_where_all_is_well_nothing_is_named(shared: Bridge, robot: RosNode, setup: Setup) -> None:
    diagnosis = setup.diagnose(WELL, shared.endpoint, listen_s=ENOUGH_S)
    assert diagnosis.report.findings == []
    facts = "\n".join(diagnosis.report.facts)
    assert f"domain {shared.domain}" in facts
    assert "Zenoh 1.10" in facts
    assert "clock of the bridge's machine is within 1 s" in facts


def test_a_publisher_that_ends_after_its_message_is_no_absent_one(
    shared: Bridge, robot: RosNode, setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    drain, heard = ZenohSession.drain, threading.Event()

    def drained(session: ZenohSession) -> Changes:
        changes = drain(session)
        if changes.recorded_samples:
            heard.set()
        return changes

    monkeypatch.setattr(ZenohSession, "drain", drained)
    # It waits for the end of the publisher.
    monkeypatch.setattr("app.tools.doctor.received.ENOUGH", 1000)
    with ThreadPoolExecutor() as pool:
        published = pool.submit(publish_and_go, robot, "/hasty", BOOL, {"data": True}, heard.is_set)
        findings = setup.findings(panel_of(interlock("/hasty")), shared.endpoint, listen_s=ENOUGH_S)
        published.result()
    assert named(findings) == [("permission_ends", "/hasty")]


def test_a_permission_that_says_no_is_a_note(shared: Bridge, robot: RosNode, setup: Setup) -> None:
    diagnosis = setup.diagnose(panel_of(interlock("/refused")), shared.endpoint)
    assert diagnosis.report.is_well
    assert "permission_refused" in diagnosis.report.codes()


def test_a_definition_that_is_another_one_is_named(
    shared: Bridge, robot: RosNode, setup: Setup
) -> None:
    messages = setup.folder / "std_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "String.msg").write_text("string data\nint32 length\n")
    text = panel_of(readout("/words"), more='interfaces = ["std_msgs"]\n')
    assert named(setup.findings(text, shared.endpoint)) == [("definition_differs", "/words")]


def test_of_several_robots_each_is_looked_at(shared: Bridge, robot: RosNode, setup: Setup) -> None:
    lost = f"tcp/127.0.0.1:{free_port()}"
    entries = (
        f'{{ id = "left", name = "Left", connect = ["{shared.endpoint}"] }},'
        f' {{ id = "right", name = "Right", namespace = "/right", connect = ["{lost}"] }}'
    )
    text = panel_of(readout("/wrods"), more=f"robot = [{entries}]\n")
    diagnosis = setup.diagnose(text, shared.endpoint, listen_s=0.2)
    said = [
        (finding.robot, finding.code)
        for finding in diagnosis.report.findings
        if finding.severity != "note"
    ]
    assert said == [("left", "topic_no_publisher"), ("right", "no_router")]
    assert set(diagnosis.graphs) == {"left"}


def test_a_topic_without_a_subscriber(setup: Setup) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    assert named(setup.findings(WELL, endpoint)) == [("no_router", endpoint)]


def test_a_name_that_is_unknown(setup: Setup) -> None:
    endpoint = "tcp/robot.invalid:7447"
    assert named(setup.findings(WELL, endpoint)) == [("host_unknown", endpoint)]


def test_a_port_where_no_zenoh_speaks(short_setup: Setup) -> None:
    with closing(socket.create_server(("127.0.0.1", 0))) as silent:
        endpoint = f"tcp/127.0.0.1:{silent.getsockname()[1]}"
        assert named(short_setup.findings(WELL, endpoint)) == [("not_zenoh", endpoint)]


def test_a_router_without_a_bridge(short_setup: Setup, peer: tuple[str, zenoh.Session]) -> None:
    endpoint, _ = peer
    assert named(short_setup.findings(WELL, endpoint)) == [("link_no_peer", endpoint)]


def test_a_bridge_with_another_namespace(domain: int, setup: Setup) -> None:
    with started(Bridge(domain + 4, "/robot1")) as bridge:
        (finding,) = setup.findings(WELL, bridge.endpoint)
        assert (finding.code, finding.details["theirs"]) == ("bridge_namespace", "/robot1")


def test_a_bridge_in_a_domain_without_nodes(domain: int, setup: Setup) -> None:
    """The tests' bridges are limited to their machine."""
    with started(Bridge(domain + 4)) as bridge:
        (finding,) = setup.findings(WELL, bridge.endpoint)
        assert (finding.code, finding.details["domain"]) == ("bridge_localhost", str(domain + 4))


def test_a_bridge_that_drops_in_silence(domain: int, setup: Setup) -> None:
    option = "plugins/ros2dds/reliable_routes_blocking=false"
    with started(Bridge(domain + 4, options=[option])) as bridge:
        findings = setup.findings(WELL, bridge.endpoint)
        assert [finding.code for finding in findings] == ["bridge_drops", "bridge_localhost"]


def test_a_frozen_bridge(domain: int, short_setup: Setup) -> None:
    with started(Bridge(domain + 4)) as bridge:
        bridge.freeze()
        assert named(short_setup.findings(WELL, bridge.endpoint)) == [("not_zenoh", bridge.endpoint)]


@pytest.mark.long("every screen")
@pytest.mark.parametrize(("frozen_s", "expected"), [(2.0, "wrong_rmw"), (60.0, "link_bridge_silent")])
def test_a_bridge_that_stops_answering_does_not_make_a_service_absent(
    shared: Bridge,
    robot: RosNode,
    setup: Setup,
    monkeypatch: pytest.MonkeyPatch,
    frozen_s: float,
    expected: str,
) -> None:
    thaw = threading.Timer(frozen_s, shared.thaw)

    async def received(*arguments: Any) -> ReceivedSamples:
        received_samples = await receive(*arguments)
        shared.freeze()
        thaw.start()
        return received_samples

    monkeypatch.setattr("app.tools.doctor.robot.receive", received)
    text = panel_of(call("/system_controller/list_parameters", LIST_PARAMETERS))
    try:
        findings = setup.findings(text, shared.endpoint, listen_s=0.2)
    finally:
        thaw.cancel()
        shared.thaw()
    assert [finding.code for finding in findings] == [expected]


def test_two_bridges_for_one_robot_are_found(shared: Bridge, robot: RosNode, setup: Setup) -> None:
    other = Bridge(shared.domain, options=[f'connect/endpoints=["{shared.endpoint}"]'])
    with started(other), closing(Client(other.endpoint)) as client:
        until(lambda: both(client), "both bridges forward it")
        codes = [finding.code for finding in setup.findings(WELL, shared.endpoint)]
        assert codes[0] == "bridges_two"


def both(client: Client) -> bool:
    return sum("MP/words/" in token for token in client.tokens()) == 2


def test_a_bridge_that_holds_a_topic_back(
    shared: Bridge, robot: RosNode, domain: int, setup: Setup
) -> None:
    setup.panel.write_text(panel_of(interlock("/permission")))
    file, mine = setup.folder / "bridge.json5", Bridge(shared.domain)
    options = ["--domain", str(mine.domain), "--listen", mine.endpoint, "-o", str(file)]
    assert main(["bridge-config", str(setup.panel), *options]) == 0
    mine.configure(file)
    with started(mine), closing(Client(mine.endpoint)) as client:
        until(lambda: announced(client, "/permission"), "announced")
        text = panel_of(interlock("/permission"), readout("/words"), button("/heard"))
        findings = setup.findings(text, mine.endpoint)
        others = [
            finding for finding in findings if finding.code != "permission_publishers"
        ]  # a bridge is another
        assert named(others) == [
            ("bridge_denies", "/words"),
            ("bridge_denies", "/heard"),
        ]


def test_a_bridge_of_another_version(setup: Setup, peer: tuple[str, zenoh.Session]) -> None:
    endpoint, session = peer
    zid = session.zid()
    answers = {"version": '"v1.4.0"', "config": '{"namespace": "/", "domain": 3}'}
    node = '{"publishers": [], "subscribers": [], "service_servers": []}'
    served = [
        session.declare_queryable(f"@/{zid}/ros2/{name}", said(f"@/{zid}/ros2/{name}", text))
        for name, text in {**answers, "node/0110aa/arm": node}.items()
    ]
    token = session.liveliness().declare_token(f"@/{zid}/@ros2_lv")
    (first, *_) = setup.findings(panel_of(), endpoint, listen_s=0.1)
    assert (first.code, first.details["theirs"]) == ("bridge_version", "1.4.0")
    token.undeclare()
    for queryable in served:
        queryable.undeclare()


def test_a_bridge_that_is_there_and_does_not_respond(
    setup: Setup, peer: tuple[str, zenoh.Session]
) -> None:
    endpoint, session = peer
    token = session.liveliness().declare_token(f"@/{session.zid()}/@ros2_lv")
    assert named(setup.findings(WELL, endpoint)) == [("link_bridge_silent", str(session.zid()))]
    token.undeclare()


MANY = 1000
WITHIN_S = 30  # on a busy machine; it was 75 s


@pytest.mark.long("flood")
def test_a_thousand_false_bridges_are_a_few_lines_in_a_short_time(domain: int, setup: Setup) -> None:
    """Half of them answer, each with a namespace of its own that would forge a line."""
    with started(Bridge(domain + 4)) as bridge, false_bridges(bridge.endpoint):
        with closing(Client(bridge.endpoint)) as client:
            until(lambda: len(client.tokens()) >= MANY, "they are announced")
        began = time.monotonic()
        report = setup.diagnose(WELL, bridge.endpoint, listen_s=0.2).report
        listed = command.run(COMMAND, "topics", "-v", "--connect", bridge.endpoint)
        assert time.monotonic() - began < WITHIN_S
    lines = as_text(report, verbose=True).splitlines()
    assert report.count("error") >= MANY / 2
    assert len(lines) < 400
    for line in (*lines, *listed.stdout.splitlines(), *listed.stderr.splitlines()):
        assert not line.startswith("error    forged")


@contextmanager
def false_bridges(endpoint: str) -> Iterator[None]:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    zids = [f"{number:032x}" for number in range(1, MANY + 1)]

    def answer(query: zenoh.Query) -> None:
        part = str(query.key_expr).rpartition("/")[2]
        for zid in zids[::2]:
            namespace = json.dumps(f"/x{zid}\nerror    forged: by {zid}")
            text = f'{{"namespace": {namespace}}}' if part == "config" else '"v1.10.2"'
            query.reply(f"@/{zid}/ros2/{part}", text)
        query.reply(f"@/{zids[1]}/ros2/{part}", "[" * 100_000)

    with zenoh.open(config) as session:
        held = [session.liveliness().declare_token(f"@/{zid}/@ros2_lv") for zid in zids]
        held += [
            session.liveliness().declare_token(f"@/{zid}/@ros2_lv/MP/x{zid}/a§msg§B/:1::0,10:")
            for zid in zids
        ]
        answers = [
            session.declare_queryable(f"@/*/ros2/{part}", answer) for part in ("version", "config")
        ]
        yield
        assert held
        assert answers


def said(key: str, text: str) -> Callable[[zenoh.Query], None]:
    return lambda query: query.reply(key, text)


class started:
    """A bridge that runs while it is entered."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge

    def __enter__(self) -> Bridge:
        self._bridge.start()
        return self._bridge

    def __exit__(self, *_: Any) -> None:
        self._bridge.end()
