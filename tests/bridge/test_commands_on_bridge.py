"""`operator-panel topics | echo | hz | scaffold` on the real bridge, with rclpy nodes on Fast DDS and a
robot on Cyclone DDS."""

import json
import re
import shlex
import subprocess
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from app.panel import check_panel
from app.ros.messages.definitions import Definitions
from app.ros.messages.derived import _describe_structure, type_hash
from app.ros.messages.parsing import parse_definition
from tests.support import cyclone
from tests.support.cyclone import CycloneRobot
from tests.support.parts import ENOUGH_S, ROOT, Bridge, RosNode, Server, free_port, until
from tests.support.processes import command
from tests.support.processes.command import COMMAND

BOOL = "std_msgs/msg/Bool"
GRIPPER = "gripper_msgs/msg/Gripper"
EXTREMES = {
    "/pressure_stamp": ("std_msgs/msg/UInt64", 2**64 - 1),
    "/speed_largest": ("std_msgs/msg/Float64", 1.7e308),
    "/speed_smallest": ("std_msgs/msg/Float64", 5e-324),
}


def run(bridge: Bridge, *words: str) -> subprocess.CompletedProcess[str]:
    done = command.run(COMMAND, *words, "--connect", bridge.endpoint, "--wait", str(ENOUGH_S))
    assert "Traceback" not in done.stderr, done.stderr
    return done


def output_of(bridge: Bridge, *words: str) -> str:
    done = run(bridge, *words)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def until_passed_on(bridge: Bridge, *names: str) -> None:
    """Waits until the bridge announces the topics: it discovers them a moment before."""

    def passed_on() -> bool:
        listed = run(bridge, "topics", "--json").stdout
        return {*names} <= {topic["name"] for topic in json.loads(listed or "[]") if topic["passed_on"]}

    until(passed_on, f"the bridge passes {', '.join(names)} on", every_s=0.2)


@pytest.fixture(scope="module")
def io(cyclone_bridge: Bridge) -> Iterator[RosNode]:
    """A cell's node, which publishes all the time."""
    node = RosNode(cyclone_bridge.domain, "cell_io")
    node.advertise("/operation_enabled", BOOL, durability="transient_local", depth=1)
    node.publish("/operation_enabled", {"data": True})
    node.advertise("/arm/joint_states", "sensor_msgs/msg/JointState")
    joints = {"name": ["j1", "j2"], "position": [0.5, -1.0]}
    node.every("/arm/joint_states", joints, 0.05)
    node.advertise("/arm/temperature", "sensor_msgs/msg/Temperature", reliability="best_effort")
    node.every("/arm/temperature", {"temperature": 41.5}, 0.2)
    node.advertise("/unknown", "test_msgs/msg/BasicTypes")
    node.subscribe("/start", BOOL)
    for name, (kind, value) in EXTREMES.items():
        node.advertise(name, kind, durability="transient_local", depth=1)
        node.publish(name, {"data": value})
    node.advertise("/odd_joints", "sensor_msgs/msg/JointState", durability="transient_local", depth=1)
    node.publish("/odd_joints", {"name": ["j1\x07"], "position": [0.5]})
    names = {"/operation_enabled", "/arm/joint_states", "/arm/temperature", "/unknown", "/start"}
    until_passed_on(cyclone_bridge, *names, *EXTREMES, "/odd_joints")
    yield node
    node.end()


def test_topics_are_listed_as_ros_lists_them(cyclone_bridge: Bridge, io: RosNode) -> None:
    listed = output_of(cyclone_bridge, "topics").split()
    assert listed == sorted(listed)
    typed = output_of(cyclone_bridge, "topics", "-t")
    assert "/operation_enabled [std_msgs/msg/Bool]\n" in typed
    assert int(output_of(cyclone_bridge, "topics", "--count-topics")) == len(listed)
    assert output_of(cyclone_bridge, "topics", "--namespace", "/arm") == "/joint_states\n/temperature\n"


def test_topics_are_described_with_qos_and_nodes(cyclone_bridge: Bridge, io: RosNode) -> None:
    lines = output_of(cyclone_bridge, "topics", "-v").splitlines()
    at = lines.index("/operation_enabled [std_msgs/msg/Bool]")
    assert lines[at + 1] == "  publisher: /cell_io, reliable, transient local, Fast DDS"
    at = lines.index("/start [std_msgs/msg/Bool]")
    assert lines[at + 1] == "  subscriber: /cell_io, reliable, volatile, Fast DDS"
    plain = json.loads(output_of(cyclone_bridge, "topics", "--json"))
    enabled = next(topic for topic in plain if topic["name"] == "/operation_enabled")
    assert (enabled["types"], enabled["publishers"][0]["nodes"]) == ([BOOL], ["/cell_io"])


def test_echo_shows_the_last_value_of_a_latched_topic(cyclone_bridge: Bridge, io: RosNode) -> None:
    assert output_of(cyclone_bridge, "echo", "/operation_enabled", "--once") == "data: true\n---\n"


@pytest.mark.long("every screen")
@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--field", "position"], "- 0.5\n- -1.0\n---\n"),
        (["--field", "position[name=j2]"], "-1.0\n---\n"),
        (["--csv"], "0,0,,j1,j2,0.5,-1.0,,\n"),
        (["--field", "name", "--json"], '["j1", "j2"]\n'),
    ],
)
def test_echo_shows_messages_whole_or_a_field(
    cyclone_bridge: Bridge, io: RosNode, options: Sequence[str], text: str
) -> None:
    assert output_of(cyclone_bridge, "echo", "/arm/joint_states", "--once", *options) == text


def test_echo_receives_best_effort_publishers(cyclone_bridge: Bridge, io: RosNode) -> None:
    assert output_of(
        cyclone_bridge, "echo", "/arm/temperature", "--once", "--field", "temperature"
    ) == ("41.5\n---\n")


def test_hz_measures_the_rate(cyclone_bridge: Bridge, io: RosNode) -> None:
    def measured() -> bool:
        """Not where the machine stood still in between."""
        done = run(cyclone_bridge, "hz", "/arm/joint_states", "--for", "2")
        rates = [line for line in done.stdout.splitlines() if line.startswith("average rate: ")]
        return bool(rates) and 5 < float(rates[-1].removeprefix("average rate: ")) < 40

    until(measured, "it publishes at 20 Hz")


def test_hz_of_a_silent_topic_has_no_rate(cyclone_bridge: Bridge, io: RosNode) -> None:
    done = run(cyclone_bridge, "hz", "/unknown", "--for", "1.5")
    assert done.returncode == 1
    assert "no rate: 0 message(s) in 1.5 s" in done.stdout


@pytest.mark.long("every screen")
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (
            ("echo", "/operation_enable"),
            "no topic /operation_enable is there: did you mean /operation_en",
        ),
        (("hz", "/joint_states"), "no topic /joint_states is there: did you mean /arm/joint_states?"),
        (("echo", "/start", BOOL, "--once", "--timeout", "0.5"), "no message on /start in 0.5 s"),
        (
            ("echo", "/start", "a_msgs/msg/B"),
            "/start is std_msgs/msg/Bool on the robot, not a_msgs/msg",
        ),
        (("echo", "/operation_enabled", "--field", "x"), 'there is no "x"'),
        (("topics", "--namespace", "/robot9"), "there are no topics below /robot9"),
        (
            ("echo", "/unknown"),
            "there is no package test_msgs: its folder must be among the panel's `interfaces`; give the"
            " folder of its package with --interfaces",
        ),
    ],
)
def test_missing_topic_is_reported_with_a_sentence(
    cyclone_bridge: Bridge, io: RosNode, words: Sequence[str], sentence: str
) -> None:
    done = run(cyclone_bridge, *words)
    assert (done.returncode, done.stdout) == (1, "")
    assert sentence in done.stderr


@pytest.mark.parametrize(
    ("host", "more"),
    [
        ("127.0.0.1", ""),
        # An address of this machine too, but not one that says so.
        (
            "127.0.0.2",
            ". As shipped, the bridge accepts connections from its own machine only: put this address"
            " into `listen` of its file",
        ),
    ],
)
def test_missing_router_is_reported_with_the_remedy(host: str, more: str) -> None:
    endpoint = f"tcp/{host}:{free_port()}"
    done = command.run(COMMAND, "topics", "--connect", endpoint, "--wait", "0.3")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"no Zenoh router or bridge answers at {endpoint} within 0.3 s: start zenoh-bridge-ros2dds on"
        " the robot, or name its place with --connect tcp/HOST:7447; if the robot's nodes run on"
        f" rmw_zenoh, start its Zenoh router and its nodes{more}\n"
    )


def test_router_without_a_bridge_is_a_separate_finding(peer: tuple[str, Any]) -> None:
    endpoint, _ = peer
    done = command.run(COMMAND, "topics", "--connect", endpoint)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"Zenoh answers at {endpoint}, but no bridge to ROS 2 is there" in done.stderr


def test_a_type_is_decoded_by_the_definition_that_its_node_gives(
    cyclone_bridge: Bridge, cyclone_robots: Any, client: Any
) -> None:
    robot: CycloneRobot = cyclone_robots(cyclone_bridge.domain)
    whole = Definitions()
    for name, text in (("Gripper", "float64 width\nJaw[] jaws"), ("Jaw", "string name\nfloat32 force")):
        whole |= parse_definition(text, "gripper_msgs", "msg", name, Path("x.msg"))
    types = [_describe_structure(whole.structures[f"gripper_msgs/msg/{n}"]) for n in ("Gripper", "Jaw")]
    hash_ = type_hash(whole.structures[GRIPPER], whole.structures.__getitem__)
    robot.describe_gripper(types=types, hash=hash_)
    until(lambda: not robot.unmatched(), "the bridge found the service")

    def shown() -> str:
        done = run(cyclone_bridge, "echo", "/gripper", "--once", "--field", "jaws", "--timeout", "20")
        return done.stdout

    assert until(shown, "its type is known", every_s=0.2) == (
        "- name: left\n  force: 2.5\n- name: right\n  force: 3.0\n---\n"
    )


def test_a_scaffold_is_a_good_panel_that_is_alive_at_once(
    cyclone_bridge: Bridge, io: RosNode, cyclone_robots: Any, tmp_path: Path
) -> None:
    robot: CycloneRobot = cyclone_robots(cyclone_bridge.domain)
    until(lambda: not robot.unmatched(), "the bridge found the services")
    until(
        lambda: "cyclone_robot/get_parameters" in str(client_tokens(cyclone_bridge)),
        "the services are announced",
    )
    path = tmp_path / "cell.toml"
    said = output_of(cyclone_bridge, "scaffold", "-o", str(path), "--listen", "20")
    assert re.search(r"interlock candidate", said)
    text = path.read_text()
    panel = check_panel(path).panel
    assert panel.commands == ()  # each control is commented out
    for name in ("/start", "/reset", "/set_enabled", "/fibonacci"):
        assert f'"{name}"' in text
    assert '# parameter = "speed"' in text
    assert "# - /odd_joints (joints): joint[0].name: " in text
    assert all(f'topic = "{name}"' in text for name in EXTREMES)
    assert "parameters of /cell_io: the bridge reaches services on Cyclone DDS only" in text
    widgets = {
        widget["id"]: widget
        for page in tomllib.loads(text)["page"]
        for widget in page.get("widget", ())
    }
    assert [joint["name"] for joint in widgets["arm_joint_states"]["joint"]] == ["j1", "j2"]
    assert widgets["arm_temperature"]["qos"] == {"reliability": "best_effort"}
    server = Server(ROOT, KIOSK_PANEL=str(path), KIOSK_MODE="live")
    try:
        shown = server.robot("robot")
        until(
            lambda: (
                {
                    shown.widget(name)["state"]
                    for name in ("operation_enabled", "arm_joint_states", "arm_temperature")
                }
                == {"live"}
            ),
            "its displays are live",
        )
        assert shown.widget("arm_temperature")["text"].startswith("41.5")
    finally:
        server.end()
    refused = run(cyclone_bridge, "scaffold", "-o", str(path))
    assert refused.returncode == 1
    assert f"{path} exists: give another name with -o, or --force to replace it" in refused.stderr
    assert path.read_text() == text


def test_scaffold_waits_for_a_starting_bridge_and_has_all_topics(domain: int, tmp_path: Path) -> None:
    bridge = Bridge(domain + 1)
    node = RosNode(bridge.domain)
    path = tmp_path / "cell.toml"
    try:
        node.advertise("/operation_enabled", "std_msgs/msg/Bool", durability="transient_local")
        bridge.start()
        said = output_of(bridge, "scaffold", "-o", str(path), "--listen", "0.1")
        assert said.startswith(f"{path}: ")
        assert 'topic = "/operation_enabled"' in path.read_text()
        assert "holds it back" not in path.read_text()
    finally:
        node.end()
        bridge.end()


def test_a_scaffold_of_a_domain_without_nodes_says_so_and_writes_no_file(
    domain: int, tmp_path: Path
) -> None:
    bridge = Bridge(domain + 1)
    bridge.start()
    path = tmp_path / "cell.toml"
    try:
        done = run(bridge, "scaffold", "-o", str(path))
        listed = run(bridge, "topics")
    finally:
        bridge.end()
    assert (done.returncode, done.stdout, path.exists()) == (1, "", False)
    for each in (done, listed):
        assert (each.returncode, each.stdout) == (1, "")
        assert f"the bridge sees no topic in domain {bridge.domain}: start the rob" in each.stderr


def client_tokens(bridge: Bridge) -> list[str]:
    made = cyclone.Client(bridge.endpoint)
    try:
        return made.tokens()
    finally:
        made.close()


def shown_commands() -> list[list[str]]:
    """The commands of the how-to page, but for the server's own and the completion."""
    page = (ROOT / "docs/how-to/scaffold.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    lines = [shlex.split(line) for block in blocks for line in block.splitlines()]
    return [words[1:] for words in lines if words[0] == "operator-panel" and words[1] != "run"]


@pytest.mark.long("documents")
def test_each_command_of_the_page_works(domain: int, tmp_path: Path) -> None:
    bridge = Bridge(domain + 1)
    bridge.start()
    node = RosNode(bridge.domain)
    try:
        node.advertise("/speed", "std_msgs/msg/Float64")
        node.every("/speed", {"data": 0.5}, 0.1)
        node.advertise("/joint_states", "sensor_msgs/msg/JointState")
        node.every("/joint_states", {"name": ["joint_1"], "position": [0.25]}, 0.1)
        until_passed_on(bridge, "/speed", "/joint_states")
        commands = shown_commands()
        assert [words[0] for words in commands] == [
            *("scaffold", "check", "topics", "topics", "echo", "echo", "hz")
        ]
        place = {"tcp/robot1:7447": bridge.endpoint, "cell1.toml": str(tmp_path / "cell1.toml")}
        for words in commands:
            done = command.run(COMMAND, *(place.get(word, word) for word in words))
            late = [line for line in done.stderr.splitlines() if line.startswith("no new messages")]
            assert (done.returncode, done.stderr.splitlines()) == (0, late), words
    finally:
        node.end()
        bridge.end()


def test_scaffold_of_a_robot_with_a_namespace_has_the_namespace(domain: int, tmp_path: Path) -> None:
    bridge = Bridge(domain + 1, "/robot1")
    bridge.start()
    node = RosNode(bridge.domain)
    path = tmp_path / "cell.toml"
    try:
        node.advertise("/speed", "std_msgs/msg/Float64")
        until_passed_on(bridge, "/robot1/speed")
        output_of(bridge, "scaffold", "-o", str(path), "--listen", "0.1")
    finally:
        node.end()
        bridge.end()
    panel = check_panel(path).panel
    assert [robot.namespace for robot in panel.robots] == ["/robot1"]
    assert 'topic = "/speed"' in path.read_text()


def test_live_controls_need_a_permission(domain: int, tmp_path: Path) -> None:
    bridge = Bridge(domain + 1)
    bridge.start()
    node = RosNode(bridge.domain)
    path = tmp_path / "cell.toml"
    try:
        node.subscribe("/start", BOOL)
        until_passed_on(bridge, "/start")
        done = run(bridge, "scaffold", "-o", str(path), "--controls")
        assert done.returncode == 1
        assert "no topic looks like a permission of the robot" in done.stderr
        assert not path.exists()
        node.advertise("/enabled", BOOL, durability="transient_local", depth=1)
        until_passed_on(bridge, "/enabled")
        output_of(bridge, "scaffold", "-o", str(path), "--controls", "--listen", "0.1")
    finally:
        node.end()
        bridge.end()
    (start,) = check_panel(path).panel.commands
    assert (start.id, start.interlocks) == ("start", ("enabled",))
