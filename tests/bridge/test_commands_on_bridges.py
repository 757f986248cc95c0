"""`operator-panel topics | echo | hz | scaffold | doctor` with two real bridges, and with a bridge that
has lost the topics of a node."""

import json
import subprocess
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from tests.support.parts import ENOUGH_S, Bridge, RosNode, until
from tests.support.processes import command
from tests.support.processes.command import COMMAND
from tests.tools.doctor.setups import panel_of, readout

BOOL = "std_msgs/msg/Bool"


def run(*words: str) -> subprocess.CompletedProcess[str]:
    done = command.run(COMMAND, *words)
    assert "Traceback" not in done.stderr, done.stderr
    return done


def forwarding(endpoint: str) -> dict[str, str]:
    """Of each topic."""
    listed = run("topics", "--json", "--connect", endpoint).stdout
    return {topic["name"]: topic["forwarding"] for topic in json.loads(listed or "[]")}


def until_announced(bridge: Bridge, name: str) -> None:
    until(lambda: forwarding(bridge.endpoint).get(name) == "forwarded", "it is announced")


@pytest.fixture
def robots(domain: int) -> Iterator[list[tuple[Bridge, RosNode]]]:
    """Two robots, each with its bridge, in domains of their own."""
    pairs = [(Bridge(domain + n, f"/r{n}"), RosNode(domain + n)) for n in (1, 2)]
    for bridge, node in pairs:
        bridge.start()
        node.advertise("/enabled", BOOL)
        node.every("/enabled", {"data": True}, 0.1)
    yield pairs
    for bridge, node in pairs:
        node.end()
        bridge.end()


def test_both_bridges_that_a_panel_names_are_waited_for(
    robots: list[tuple[Bridge, RosNode]], tmp_path: Path
) -> None:
    entries = ", ".join(
        f'{{ id = "r{n}", name = "R{n}", namespace = "/r{n}", connect = ["{bridge.endpoint}"] }}'
        for n, (bridge, _) in enumerate(robots, 1)
    )
    panel = tmp_path / "cells.toml"
    panel.write_text(panel_of(readout("/enabled", BOOL), more=f"robot = [{entries}]\n"))
    for n, (bridge, _) in enumerate(robots, 1):
        until_announced(bridge, f"/r{n}/enabled")
    place = ("--panel", str(panel))
    for _ in range(5):
        for name in ("/r1/enabled", "/r2/enabled"):
            done = run("echo", name, "--once", "--timeout", str(ENOUGH_S), *place)
            assert (done.returncode, done.stdout, done.stderr) == (0, "data: true\n---\n", "")
        listed = run("topics", *place)
        assert (listed.returncode, listed.stderr) == (0, "")
        assert {"/r1/enabled", "/r2/enabled"} <= {*listed.stdout.split()}
    robots[1][0].end()
    gone = run("echo", "/r2/enabled", "--once", *place)
    assert gone.returncode == 1
    assert "no bridge answers for the panel's namespace /r2" in gone.stderr
    robots[1][0].start()


@pytest.fixture
def lost(domain: int) -> Iterator[tuple[Bridge, RosNode]]:
    """A bridge that has lost a node's topics: the node was killed, and restarted at once. The bridge
    loses them when the lease of the killed node ends."""
    bridge = Bridge(domain + 1)
    bridge.start()
    other = RosNode(bridge.domain, "other")  # it runs all the time
    other.advertise("/other", BOOL)
    node = started(bridge)
    until_announced(bridge, "/enabled")
    until_announced(bridge, "/other")
    node.kill()
    node = started(bridge)
    until(lambda: forwarding(bridge.endpoint).get("/enabled") == "lost", "it is lost", every_s=1)
    yield bridge, node
    node.end()
    other.end()
    bridge.end()


def started(bridge: Bridge) -> RosNode:
    node = RosNode(bridge.domain, "cell_io")
    node.advertise("/enabled", BOOL)
    node.every("/enabled", {"data": True}, 0.1)
    node.subscribe("/start", BOOL)
    return node


LOST = "and the bridge does not forward it. Restart its node."


def commands(folder: Path) -> Sequence[tuple[str, ...]]:
    """All that read a robot's topics."""
    return (
        ("topics",),
        ("echo", "/enabled", "--once"),
        ("hz", "/enabled", "--for", "1"),
        ("scaffold", "-o", str(folder / "cell.toml"), "--listen", "0.1"),
    )


def test_lost_topics_are_one_finding_in_all_commands(
    lost: tuple[Bridge, RosNode], tmp_path: Path
) -> None:
    endpoint = lost[0].endpoint
    for words in commands(tmp_path):
        done = run(*words, "--connect", endpoint)
        assert (done.returncode, LOST in done.stderr, "deny" in done.stderr) == (1, True, False), words
    text = (tmp_path / "cell.toml").read_text()
    assert "# - /enabled: the bridge does not forward it: restart its node, or else the bridge" in text
    assert "`deny`" not in text
    panel = tmp_path / "readout.toml"
    panel.write_text(panel_of(readout("/enabled", BOOL)))
    (tmp_path / "zenoh.json5").write_text(
        json.dumps({"mode": "peer", "connect": {"endpoints": [endpoint]}})
    )
    words = ("--json", "--listen", "0.2", "--zenoh", str(tmp_path / "zenoh.json5"))

    def unrouted() -> list[str]:
        """On a busy machine the doctor may not reach the bridge in time, and says that."""
        findings = json.loads(run("doctor", str(panel), *words).stdout)["findings"]
        return [finding["about"] for finding in findings if finding["code"] == "topic_unrouted"]

    assert until(unrouted, "the doctor has looked") == ["/enabled"]
