"""`operator-panel scaffold` with two simulated robots: on rmw_zenoh, and behind one bridge."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.panel import check_panel
from app.tools.cli.robot.scaffold import main as scaffold
from tests.support.parts import ROOT, Process, free_port, until

PANEL = """
title = "Two arms"
{keys}
[[interlock]]
id = "operation"
topic = "/operation_enabled"

[[page]]
id = "main"
title = "Main"

[[page.widget]]
id = "speed"
kind = "readout"
label = "Speed"
topic = "/drive/speed"
type = "std_msgs/msg/Float64"

[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
interlock = "operation"
"""
ROBOTS = "".join(
    f'[[robot]]\nid = "{n}"\nname = "{n}"\nnamespace = "/{n}"\n' for n in ("left", "right")
)
BOTH = ["--robot", "/left", "--robot", "/right"]


@pytest.fixture(params=["rmw_zenoh", "bridge"])
def at(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[list[str]]:
    """The options that lead to two simulated robots."""
    path = tmp_path / "simulated.toml"
    path.write_text(PANEL.format(keys=ROBOTS))
    place = f"tcp/127.0.0.1:{free_port()}"
    command = ["-m", "app.simulator", "--dialect", request.param, str(path), place]
    simulator = Process([sys.executable, *command], {}, cwd=ROOT)
    try:
        until(lambda: "listening" in simulator.text, "it listens")
        yield ["--connect", place, "--dialect", request.param, "--listen", "0.1"]
    finally:
        simulator.end()


def test_each_robot_has_a_table_and_a_tile(at: list[str], tmp_path: Path) -> None:
    path = tmp_path / "draft.toml"
    assert scaffold([*at, *BOTH, "--controls", "-o", str(path)]) == 0
    panel = check_panel(path).panel
    assert [(robot.name, robot.namespace) for robot in panel.robots] == [
        ("Left", "/left"),
        ("Right", "/right"),
    ]
    overview, *others = panel.pages
    assert overview.overview
    widgets = [widget for page in others for widget in page.widgets]
    assert {getattr(widget, "topic", "") for widget in widgets} >= {"/drive/speed", "/start"}


def test_namespaces_with_the_same_topics_are_proposed_as_robots(
    at: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "draft.toml"
    assert scaffold([*at, "-o", str(path)]) == 0
    summary = capsys.readouterr().out
    panel = check_panel(path).panel
    assert not [robot for robot in panel.robots if robot.namespace]
    for text in (summary, path.read_text().replace("\n# ", " ")):
        assert "/left, /right have the same topics" in text
        assert "--robot /left --robot /right" in text


def test_one_robot_of_several_is_a_mistake_on_the_command_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for options in (["--robot", "/left"], [*BOTH, "--namespace", "/left"]):
        with pytest.raises(SystemExit) as ended:
            scaffold([*options, "-o", str(tmp_path / "draft.toml")])
        assert ended.value.code == 2
        assert "--robot is given for each of several robots" in capsys.readouterr().err
