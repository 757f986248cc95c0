"""What the doctor makes of a graph, of samples and of answers that real parts give only by accident."""

import asyncio
import json
import socket
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import pytest

from app.panel import load_panel
from app.ros.graph.model import (
    Bridge,
    BridgeRoute,
    EndpointQos,
    GraphSnapshot,
    Node,
    RobotGraph,
    Server,
    SurveyedTopic,
    TopicEndpoint,
    denies,
)
from app.ros.messages import load_interfaces
from app.ros.zenoh.sample import Sample
from app.tools.cli.doctor import as_text
from app.tools.doctor import robot as link
from app.tools.doctor.findings import Report
from app.tools.doctor.names import PanelNames, PanelRobot
from app.tools.doctor.received import ReceivedSamples
from app.tools.doctor.robot import check_clocks, check_copies, check_graph
from app.tools.doctor.topics import TopicChecks, check_permissions
from tests.tools.doctor.setups import (
    BOOL,
    STRING,
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

LOG_TYPE = "rcl_interfaces/msg/Log"
LOG_WIDGET = '[[page.widget]]\nid = "log"\nkind = "log"\nlabel = "Log"\n'
QOS = EndpointQos(reliable=True)
BRIDGE = Bridge(zid="b1", version="v1.10.2", config={"namespace": "/", "domain": 0})
INTERFACES = load_interfaces("jazzy")
SENT = INTERFACES.encode(STRING, {"data": "x"})


def robot(folder: Path, text: str) -> PanelRobot:
    path = folder / "cell1.toml"
    path.write_text(text)
    return PanelRobot(load_panel(path))


def topic(name: str, type_name: str = STRING, qos: EndpointQos = QOS) -> SurveyedTopic:
    publisher = TopicEndpoint(type=type_name, qos=qos, bridge="b1")
    return SurveyedTopic(name=name, key=name[1:], publishers=(publisher,))


def judged(robot: PanelRobot, **graph: Any) -> Report:
    report = Report()
    behind = PanelNames.for_robot(
        robot, GraphSnapshot(robots=(RobotGraph(bridges=(BRIDGE,), **graph),))
    )
    TopicChecks(report, behind, INTERFACES).check()
    return report


def test_an_action_of_another_type(tmp_path: Path) -> None:
    server = Server(name="/count", key="count", type="cell_msgs/action/Count", bridge="b1")
    report = judged(robot(tmp_path, panel_of(action("/count"))), actions=(server,))
    assert named(report.findings) == [("action_type", "/count")]


@pytest.mark.parametrize(
    ("endpoint", "remote", "expected"),
    [("", ("us:words",), ["topic_unrouted"]), ("0110aa", ("us:words",), []), ("", (), [])],
)
def test_a_route_without_its_reader(
    endpoint: str, remote: tuple[str, ...], expected: list[str], tmp_path: Path
) -> None:
    route = BridgeRoute(
        bridge="b1",
        kind="topic",
        direction="pub",
        name="/words",
        key="words",
        type=STRING,
        remote=remote,
        endpoint=endpoint,
    )
    here = robot(tmp_path, panel_of(readout("/words")))
    assert judged(here, topics=(topic("/words"),), routes=(route,)).codes() == expected


def test_a_publisher_that_the_bridge_has_lost(tmp_path: Path) -> None:
    here = robot(tmp_path, panel_of(readout("/words")))
    lost = replace(topic("/words"), announced=False)
    assert judged(here, topics=(lost,)).codes() == ["topic_unrouted"]
    new = PanelNames.for_robot(
        here, GraphSnapshot(robots=(RobotGraph(bridges=(BRIDGE,), topics=(lost,)),))
    )
    report, before = (
        Report(),
        PanelNames.for_robot(here, GraphSnapshot(robots=(RobotGraph(bridges=(BRIDGE,)),))),
    )
    TopicChecks(report, new, INTERFACES, before).check()
    assert report.codes() == []


PARAMETERS = [f"/arm/{name}_parameters" for name in ("get", "describe", "set")]


@pytest.mark.parametrize(
    ("config", "code"),
    [
        ({}, "server_unrouted"),
        ({"deny": {"service_servers": ".*", "action_servers": ".*"}}, "bridge_denies"),
    ],
)
def test_servers_that_the_bridge_has_lost_or_denies(
    config: dict[str, Any], code: str, tmp_path: Path
) -> None:
    here = robot(
        tmp_path, panel_of(action("/count"), call("/home", "std_srvs/srv/Trigger"), parameter("/arm"))
    )
    node = Node(name="/arm", bridge="b1", services=("/home", *PARAMETERS), actions=("/count",))
    bridge = replace(BRIDGE, config=config)
    graph = GraphSnapshot(robots=(RobotGraph(bridges=(bridge,), nodes=(node,)),))
    report = Report()
    TopicChecks(report, PanelNames.for_robot(here, graph), INTERFACES).check()
    assert named(report.findings) == [(code, "/home"), (code, "/count"), (code, PARAMETERS[0])]


def test_a_permission_that_the_bridge_has_lost_is_not_called_stale(tmp_path: Path) -> None:
    here = robot(tmp_path, panel_of(interlock("/permission", max_age_s=1.0)))
    lost = replace(topic("/permission", BOOL), announced=False)
    behind = PanelNames.for_robot(
        here, GraphSnapshot(robots=(RobotGraph(bridges=(BRIDGE,), topics=(lost,)),))
    )
    report = Report()
    check_permissions(report, behind, ReceivedSamples(began=0.0, ended=5.0), INTERFACES)
    TopicChecks(report, behind, INTERFACES).check()
    assert named(report.findings) == [("topic_unrouted", "/permission")]


@pytest.mark.parametrize(
    ("there", "words"),
    [("/wrods", " Did you mean /wrods?"), ("/cell/words", " Did you mean /cell/words?"), ("/tf", "")],
)
def test_a_name_that_is_nearly_there_is_named(there: str, words: str, tmp_path: Path) -> None:
    report = judged(robot(tmp_path, panel_of(readout("/words"))), topics=(topic(there),))
    assert [finding.sentence for finding in report.findings] == [f"No node publishes /words.{words}"]


def test_advice_for_several_is_given_once(tmp_path: Path) -> None:
    here = robot(tmp_path, panel_of(readout("/a"), readout("/b"), button("/c")))
    lines = as_text(judged(here)).splitlines()
    assert [line.split()[0] for line in lines] == [
        "warning",
        "warning",
        "→",
        "warning",
        "→",
        "Something",
    ]


def test_a_namespace_of_the_bridge_is_before_the_robots_names(tmp_path: Path) -> None:
    text = panel_of(readout("/words"), more='namespace = "/robot1"\n')
    bridged = RobotGraph(namespace="/robot1", bridges=(BRIDGE,), topics=(topic("/words"),))
    other = RobotGraph(namespace="/robot2", bridges=(BRIDGE,), topics=(topic("/words", BOOL),))
    report = Report()
    behind = PanelNames.for_robot(robot(tmp_path, text), GraphSnapshot(robots=(bridged, other)))
    TopicChecks(report, behind, INTERFACES).check()
    assert report.codes() == []


def test_a_name_that_is_there_outside_of_the_namespace_is_named(tmp_path: Path) -> None:
    text = f'namespace = "/amr"\n{panel_of(readout("/words"))}'
    report = judged(robot(tmp_path, text), topics=(topic("/words"),))
    assert named(report.findings) == [("topic_no_publisher", "/words")]
    assert "Did you mean //words?" in as_text(report)


def test_names_outside_of_the_namespace_and_the_nodes_log_are_found(tmp_path: Path) -> None:
    """Behind a bridge without a namespace, and behind another robot's."""
    text = f'namespace = "/amr"\n{panel_of(readout("//cell/words"), LOG_WIDGET)}'
    topics = (topic("/cell/words"), topic("/rosout", LOG_TYPE))
    assert named(judged(robot(tmp_path, text), topics=topics).findings) == []
    own = RobotGraph(namespace="/amr", bridges=(BRIDGE,), topics=(topic("/rosout", LOG_TYPE),))
    cell = RobotGraph(namespace="/cell", bridges=(BRIDGE,), topics=(topic("/words"),))
    report = Report()
    behind = PanelNames.for_robot(robot(tmp_path, text), GraphSnapshot(robots=(own, cell)))
    TopicChecks(report, behind, INTERFACES).check()
    assert named(report.findings) == []


@pytest.mark.parametrize(
    ("config", "code"),
    [
        ({}, "bridge_domain"),
        ({"ros_automatic_discovery_range": "Subnet"}, "bridge_domain"),
        ({"ros_automatic_discovery_range": "Localhost"}, "bridge_localhost"),
        ({"ros_localhost_only": True}, "bridge_localhost"),
    ],
)
def test_a_bridge_that_reaches_no_node(config: dict[str, Any], code: str, tmp_path: Path) -> None:
    bridge = replace(BRIDGE, config={**BRIDGE.config, **config})
    graph = GraphSnapshot(robots=(RobotGraph(bridges=(bridge,)),))
    report = Report()
    behind = PanelNames.for_robot(robot(tmp_path, panel_of(readout("/words"))), graph)
    check_graph(report, graph, behind)
    assert [finding.code for finding in report.findings] == [code]
    assert ("CYCLONEDDS_URI" in as_text(report)) is (code == "bridge_localhost")


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        ({}, False),
        ({"allow": {"publishers": "^/words$|^/speed$"}}, False),
        ({"allow": {"publishers": "^/speed$"}}, True),
        ({"allow": {"subscribers": "^/words$"}}, True),  # nothing is said of publishers
        ({"deny": {"publishers": "^/wor.*$"}}, True),
        ({"deny": {"subscribers": "^/words$"}}, False),
        ({"deny": {"publishers": "^/(?<no python>"}}, True),
        ({"deny": {"publishers": "^(/?w*)*$x"}}, True),  # it might take for ever
        ({"deny": {"publishers": "^/.*/a.*b.*$|^/speed.*$"}}, False),
    ],
)
def test_topics_that_a_bridge_denies_are_found(config: dict[str, Any], expected: bool) -> None:
    assert denies([Bridge(zid="b1", config=config)], "publishers", "/words") is expected


def observed(*samples: tuple[float, float | None]) -> ReceivedSamples:
    """Of /words: (when it came, by the sender's clock)."""
    received = ReceivedSamples(began=0.0, ended=3.0)
    received.samples["words"] = [Sample(SENT, 0, at, at, "b1", sent=sent) for at, sent in samples]
    return received


@pytest.mark.parametrize(
    ("ahead_s", "expected"), [(0.3, []), (-75.0, ["clock_differs"]), (90.0, ["clock_differs"])]
)
def test_the_clock_of_the_bridges_machine(ahead_s: float, expected: list[str], tmp_path: Path) -> None:
    report = Report()
    came = observed(*((at, at + ahead_s) for at in (0.1, 1.1, 2.1)))
    check_clocks(report, robot(tmp_path, panel_of(readout("/words"))), came, INTERFACES)
    assert report.codes() == expected
    for finding in report.findings:
        assert f"{abs(ahead_s):.1f} s {'ahead of' if ahead_s > 0 else 'behind'}" in finding.sentence


def test_a_clock_that_nothing_is_known_of(tmp_path: Path) -> None:
    report = Report()
    here = robot(tmp_path, panel_of(readout("/words")))
    check_clocks(report, here, observed((0.1, None)), INTERFACES)
    assert report.codes() == ["clock_unknown"]


JOINTS = "sensor_msgs/msg/JointState"


@pytest.mark.parametrize(
    ("ahead_s", "has_clock", "expected"),
    [
        (-0.3, False, []),
        (-41.0, False, [("clock_differs", "the stamps on /joints")]),
        (-200 * 86_400.0, False, [("other_time", "/joints")]),
        (-1.8e9, False, [("simulated_time", "/joints")]),
        (-1.8e9, True, [("simulated_clock", "/clock")]),
        (0.0, True, [("simulated_clock", "/clock")]),
    ],
)
def test_the_stamps_of_a_topic(
    ahead_s: float, has_clock: bool, expected: list[tuple[str, str]], tmp_path: Path
) -> None:
    received = ReceivedSamples(began=0.0, ended=3.0)
    for at in (1.8e9 + 0.1, 1.8e9 + 1.1):
        seconds, rest = divmod(at + ahead_s, 1)
        stamp = {"sec": int(seconds), "nanosec": int(rest * 1e9)}
        data = INTERFACES.encode(JOINTS, {"header": {"stamp": stamp}})
        received.samples["joints"].append(Sample(data, 0, at, at, "b1", sent=at))
    report, here = Report(), robot(tmp_path, panel_of(readout("/joints", JOINTS, field="position[0]")))
    check_clocks(report, here, received, INTERFACES, has_clock=has_clock)
    assert named(report.findings) == expected


def test_readers_that_a_bridge_has_piled_up(tmp_path: Path) -> None:
    report = Report()
    here = robot(tmp_path, panel_of(readout("/words")))
    check_copies(report, here, observed(*((at + c / 1000, at) for at in (0.1, 1.1) for c in range(3))))
    assert named(report.findings) == [("bridge_piled_readers", "/words")]
    assert report.findings[0].details["times"] == 3


@pytest.mark.parametrize(
    ("theirs", "expected"),
    [("v1.4.0-12-gabc", []), ("v0.11.0", ["zenoh_version"]), (f"v{version('eclipse-zenoh')}", [])],
)
def test_another_version_of_zenoh(theirs: str, expected: list[str]) -> None:
    class Session:
        zid = "us"

        async def query_all(self, selector: str, timeout_s: float = 1.0) -> list[tuple[str, bytes]]:
            far = {"sessions": [{"peer": "them"}], "version": "v0.5.0"}
            near = {"sessions": [{"peer": "us"}], "version": theirs}
            answers = [b"no JSON", json.dumps(far).encode(), json.dumps(near).encode()]
            return [(selector, answer) for answer in answers] if "router" in selector else []

    report = Report()
    asyncio.run(link.check_version(report, Session(), "tcp/robot:7447", ""))
    assert report.codes() == expected
    assert len(report.facts) == 1 - len(expected)


@pytest.mark.parametrize("error", [TimeoutError(), OSError(113, "No route to host")])
def test_a_host_that_does_not_answer(error: OSError, monkeypatch: pytest.MonkeyPatch) -> None:
    def connect(*_: Any) -> socket.socket:
        raise error

    monkeypatch.setattr(socket, "create_connection", connect)
    report = Report()
    assert not link.connects(report, "tcp/192.0.2.1:7447", "")
    assert report.codes() == ["no_route"]


def test_permission_by_name_is_of_the_last_message_with_the_name(tmp_path: Path) -> None:
    """Another node publishes other joints on the same topic."""
    state = "sensor_msgs/msg/JointState"
    lock = interlock("/joints", type=state, field="position[name=lift]", max=0.5)
    here = robot(tmp_path, panel_of(lock, button("/go")))
    graph = GraphSnapshot(robots=(RobotGraph(bridges=(BRIDGE,), topics=(topic("/joints", state),)),))
    behind = PanelNames.for_robot(here, graph)
    for lift, codes in ((0.25, []), (0.75, ["permission_refused"])):
        report, observed = Report(), ReceivedSamples()
        for name, position in (("lift", lift), ("finger", 0.9)):
            payload = INTERFACES.encode(state, {"name": [name], "position": [position]})
            observed.samples["joints"].append(Sample(payload, 1, 0.0, 0.0, "b1"))
        check_permissions(report, behind, observed, INTERFACES)
        assert report.codes() == codes


@pytest.mark.parametrize(
    ("field", "publishers", "nodes"),
    [
        ("", [("b1", "/door"), ("b1", "/robot")], "/door, /robot"),
        ("", [("b1", "/door"), ("b1", "")], "/door"),
        ("", [("b1", "/door"), ("b2", "/door")], None),
        ("position[name=lift]", [("b1", "/door"), ("b1", "/robot")], None),
    ],
)
def test_the_publishers_of_a_permission_are_named_if_there_are_several(
    field: str, publishers: list[tuple[str, str]], nodes: str | None, tmp_path: Path
) -> None:
    more = {"type": "sensor_msgs/msg/JointState", "field": field, "max": 1} if field else {}
    here = robot(tmp_path, panel_of(interlock("/permit", **more), button("/go")))
    ends = tuple(
        TopicEndpoint(type=BOOL, qos=QOS, bridge=bridge, nodes=(node,) if node else ())
        for bridge, node in publishers
    )
    known = (SurveyedTopic(name="/permit", key="permit", publishers=ends),)
    graph = GraphSnapshot(robots=(RobotGraph(bridges=(BRIDGE,), topics=known),))
    report = Report()
    check_permissions(report, PanelNames.for_robot(here, graph), ReceivedSamples(), INTERFACES)
    nodes_named = [
        finding.details["nodes"]
        for finding in report.findings
        if finding.code == "permission_publishers"
    ]
    assert nodes_named == ([] if nodes is None else [nodes])
