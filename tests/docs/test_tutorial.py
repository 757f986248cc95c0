"""The tutorial works as it stands there: its panel grows block by block, and its commands run."""

import re
import shlex
import subprocess
from collections.abc import Callable
from itertools import accumulate
from pathlib import Path
from typing import Final

import pytest

from app.panel import load_panel
from tests.support.parts import ROOT, Bridge, RosNode, Server, until, zenoh_file
from tests.support.processes import command

pytestmark = pytest.mark.promise("documents")

TEXT: Final = (ROOT / "docs/tutorial.md").read_text()
BLOCKS: Final = re.findall(r"^```toml\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
# An empty line between them, as one would leave it: what the check prints has the line's number.
STEPS: Final = list(accumulate(BLOCKS, "{}\n{}".format))
COMMANDS: Final = [
    line.strip()
    for block in re.findall(r"^ *```sh\n(.*?)^ *```", TEXT, re.DOTALL | re.MULTILINE)
    for line in block.splitlines()
]
CHECK: Final = ".venv/bin/python -m app.check cell1.toml"
# Those that a test below runs, or whose part is played by the tests' own bridge and node.
RUN: Final = {CHECK, "make run", "KIOSK_PANEL=cell1.toml make run"}
PLAYED: Final = ("curl ", "ROS_DISTRO=jazzy zenoh-bridge", "ros2 topic ")


@pytest.fixture
def panel(tmp_path: Path) -> Path:
    path = tmp_path / "cell1.toml"
    path.write_text(STEPS[-1])
    return path


def loads(server: Server) -> bool:
    """Whether a press of "Load part" is published; it is made again until the robot permits it."""
    answer: dict[str, object] = server.http.post("/widgets/load", json={"inputs": {}}).json()
    return answer.get("outcome") == "published"


def checked(folder: Path) -> subprocess.CompletedProcess[str]:
    """The tutorial's check, in a folder that has the file."""
    return command.run(*shlex.split(CHECK)[2:], folder=folder, env={})


def test_each_command_of_the_tutorial_is_tested() -> None:
    assert [
        command for command in COMMANDS if command not in RUN and not command.startswith(PLAYED)
    ] == []
    assert set(COMMANDS) >= RUN
    made = subprocess.run(
        ["make", "--dry-run", "run"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    assert ".venv/bin/python -m app.cli run" in made


@pytest.mark.parametrize("text", STEPS)
def test_the_panel_is_good_after_each_step(tmp_path: Path, text: str) -> None:
    path = tmp_path / "cell1.toml"
    path.write_text(text)
    assert load_panel(path).title == "My cell"


def test_check_prints_the_output_in_the_tutorial(tmp_path: Path) -> None:
    (tmp_path / "cell1.toml").write_text(STEPS[0])
    good = checked(tmp_path)
    assert (good.returncode, good.stderr) == (0, "")
    assert f"```\n{good.stdout}```" in TEXT


def test_the_mistake_is_named_as_the_tutorial_shows(tmp_path: Path) -> None:
    (tmp_path / "cell1.toml").write_text(STEPS[-1].replace('"/operation1"', '"operation1"'))
    faulty = checked(tmp_path)
    assert faulty.returncode == 1
    shown = TEXT.split("```\ncell1.toml can't be used:\n")[1].split("…")[0]
    assert faulty.stderr.startswith(f"cell1.toml can't be used:\n{shown}")


@pytest.mark.long("documents")
def test_the_demo_robot_hears_the_buttons(panel: Path, servers: Callable[[Server], Server]) -> None:
    mine = servers(Server(ROOT, KIOSK_PANEL=str(panel)))
    until(mine.ready, "ready")
    assert "SIMULATED" in mine.http.get("/").text
    (curl,) = (shlex.split(command) for command in COMMANDS if command.startswith("curl "))
    assert curl[:2] == ["curl", "-s"]
    path = curl[2].removeprefix("http://127.0.0.1:8000")
    kind, _, value = curl[4].partition(": ")
    answer = mine.http.post(path, content=curl[-1], headers={kind: value})
    assert answer.json()["outcome"] == "published"
    until(lambda: mine.widget("heard")["text"] == "start (/operation)", "the readout shows it")
    until(lambda: mine.widget("air")["state"] == "live", "the gauge has the air pressure")
    until(lambda: mine.widget("air_history")["state"] == "live", "the trend has it, too")
    until(lambda: mine.snapshot()["alarms"]["line"], "the alarm is raised", within_s=60, every_s=0.5)
    assert mine.snapshot()["alarms"]["line"]["text"] == "Air pressure too high"
    assert mine.widget("permitted")["text"] in {"Permitted", "Not permitted"}
    until(lambda: loads(mine), "the robot permits", within_s=40, every_s=0.2)
    until(lambda: mine.widget("heard")["text"] == "A-17 (/operation1)", "the readout shows it")


def test_a_robot_behind_the_bridge_hears_the_button(
    panel: Path,
    tmp_path: Path,
    own_bridge: Bridge,
    own_node: RosNode,
    servers: Callable[[Server], Server],
) -> None:
    panel.write_text(STEPS[-1].replace('mode = "demo"', 'mode = "live"'))
    own_node.subscribe("/operation1", "std_msgs/msg/String")
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    zenoh = str(zenoh_file(tmp_path, own_bridge.endpoint))
    mine = servers(Server(ROOT, KIOSK_PANEL=str(panel), KIOSK_ZENOH=zenoh))
    until(mine.ready, "ready")
    assert not mine.widget("load")["enabled"]
    assert "SIMULATED" not in mine.http.get("/").text
    own_node.every("/operation_enabled", {"data": True}, 0.5)
    until(lambda: loads(mine), "the robot permits", within_s=40, every_s=0.2)
    until(lambda: own_node.heard_data("/operation1"), "the robot hears it")
    assert set(own_node.heard_data("/operation1")) == {"A-17"}
