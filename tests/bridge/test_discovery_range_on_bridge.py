"""Nodes that are limited to their machine, on a machine with a second network interface: the setting of
the documentation, with the default RMW."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.faults.net import Namespace
from tests.support.parts import BRIDGE, ROOT, Process, RosNode, until, zenoh_file
from tests.tools.doctor.setups import STRING, panel_of, readout

PORT: Final = 7447  # in a network of its own
ENDPOINT: Final = f"tcp/127.0.0.1:{PORT}"
GUIDE: Final = (ROOT / "docs/how-to/bridge.md").read_text()
LIMITED: Final = 'plugins/ros2dds/ros_automatic_discovery_range="LOCALHOST"'


def of_guide() -> str:
    """The value of CYCLONEDDS_URI in the documentation."""
    match = re.search(r"export CYCLONEDDS_URI='(.*)'", GUIDE)
    assert match
    return match[1]


@pytest.fixture
def machine() -> Iterator[Namespace]:
    """A machine with a loopback and an Ethernet interface; the test runs on it."""
    mine = Namespace()
    mine.run("ip", "link", "add", "eth9", "type", "veth", "peer", "name", "far9")
    for end in ("eth9", "far9"):
        mine.run("ip", "link", "set", end, "up")
    mine.run("ip", "address", "add", "10.98.0.1/24", "dev", "eth9")
    with mine.inside():
        yield mine
    mine.end()


def started(domain: int, uri: str) -> Process:
    """The bridge of the documentation."""
    options = [f'listen/endpoints=["{ENDPOINT}"]', f"plugins/ros2dds/domain={domain}", LIMITED]
    command = [str(BRIDGE), str(ROOT / "deploy/bridge.json5"), *options]
    bridge = Process(command, {"CYCLONEDDS_URI": uri, "ROS_DISTRO": "jazzy"})
    until(lambda: "running" in bridge.text, "the bridge runs")
    return bridge


@pytest.fixture
def robot(machine: Namespace, domain: int) -> Iterator[RosNode]:
    node = RosNode(domain)
    node.advertise("/words", STRING)
    node.every("/words", {"data": "hello"}, 0.1)
    yield node
    node.end()


def said(*words: str | Path, **env: str) -> str:
    """What a command prints. A new process: Zenoh keeps the network of its first use."""
    command = [sys.executable, "-m", "app.cli", *map(str, words)]
    whole = {**os.environ, **env}
    done = subprocess.run(command, cwd=ROOT, env=whole, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def bridge_findings(panel: Path, places: dict[str, str]) -> list[dict[str, str]]:
    """What the doctor finds about the bridge. None if a busy machine delays an answer."""
    findings = json.loads(said("doctor", panel, "--json", **places))["findings"]
    return [finding for finding in findings if finding["code"].startswith("bridge_")]


@pytest.mark.usefixtures("robot")
def test_the_documented_setting_reaches_nodes_on_fast_dds(domain: int) -> None:
    bridge = started(domain, of_guide())
    try:
        echo = ["echo", "/words", "--once", "--timeout", "5", "--connect", ENDPOINT]
        until(lambda: "data: hello" in said(*echo), "its messages arrive")
    finally:
        bridge.end()


@pytest.mark.long("real time")
@pytest.mark.usefixtures("robot")
def test_doctor_names_the_setting_that_the_discovery_range_lacks(domain: int, tmp_path: Path) -> None:
    bridge = started(domain, "")
    panel = tmp_path / "cell1.toml"
    panel.write_text(panel_of(readout("/words")))
    places = {"KIOSK_ZENOH": str(zenoh_file(tmp_path, ENDPOINT)), "KIOSK_DATA": str(tmp_path)}
    try:
        limited = until(lambda: bridge_findings(panel, places), "the bridge has been asked")
        assert [finding["code"] for finding in limited] == ["bridge_localhost"]
        assert of_guide() in limited[0]["do"]
    finally:
        bridge.end()
