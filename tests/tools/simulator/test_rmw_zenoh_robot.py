"""The simulated robot on rmw_zenoh as a program of its own, and the commands that read such a robot."""

import asyncio
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.panel import load_panel
from app.tools.cli.robot.echo import main as echo
from app.tools.cli.robot.options import GONE
from app.tools.cli.robot.scaffold import main as scaffold
from app.tools.cli.robot.topics import main as topics
from app.tools.doctor.findings import Report
from app.tools.doctor.names import PanelRobot
from app.tools.doctor.robot import check_robot
from tests.support.parts import ROOT, SHIPPED, Process, Server, free_port, until, zenoh_file

REACHED = ["--dialect", "rmw_zenoh", "--domain", "7"]


@pytest.fixture(scope="module")
def endpoint() -> Iterator[str]:
    """Where the shipped panel's robot listens, in domain 7."""
    place = f"tcp/127.0.0.1:{free_port()}"
    command = [sys.executable, "-m", "app.simulator", *REACHED, str(SHIPPED), place]
    simulator = Process(command, {}, cwd=ROOT)
    until(lambda: "listening" in simulator.text, "it listens")
    yield place
    assert simulator.end() == 0, simulator.text
    assert "not whole" not in simulator.text, simulator.text


def test_a_server_shows_that_it_is_simulated_and_commands_it(endpoint: str, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    keys = 'mode = "live"\ndialect = "rmw_zenoh"\ndomain = 7'
    path.write_text(SHIPPED.read_text().replace('mode = "demo"', keys))
    zenoh = str(zenoh_file(tmp_path, endpoint))
    kiosk = Server(ROOT, KIOSK_PANEL=str(path), KIOSK_ZENOH=zenoh, KIOSK_MODE="live")
    try:
        until(lambda: "SIMULATED ROBOT" in str(kiosk.snapshot()["notice"]), "the banner")
        until(kiosk.ready, "ready")
        answer = kiosk.press("operation", "hello")
        assert answer.json()["outcome"] == "published", answer.json()
        until(lambda: "hello" in str(kiosk.snapshot()["widgets"]["last_heard"]), "the robot heard it")
    finally:
        kiosk.end()


def test_commands_read_it(endpoint: str, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    at = ["--connect", endpoint]
    assert topics([*at, *REACHED, "-t"]) == 0
    assert "/operation_enabled [std_msgs/msg/Bool]\n" in capsys.readouterr().out
    assert topics([*at, "--dialect", "rmw_zenoh"]) == GONE  # of domain 0
    assert "no ROS 2 node on rmw_zenoh is there" in capsys.readouterr().err
    assert echo([*at, *REACHED, "/operation_enabled", "--once"]) == 0
    assert "data: " in capsys.readouterr().out
    panel = tmp_path / "draft.toml"
    assert scaffold([*at, *REACHED, "--listen", "0.1", "-o", str(panel)]) == 0
    drafted = load_panel(panel)
    (robot,) = drafted.robots
    assert (robot.dialect, robot.domain, robot.connect) == ("rmw_zenoh", 7, (endpoint,))
    assert 'service = "/cell/start"' in panel.read_text()


def test_the_doctor_finds_nothing_of_bridges(endpoint: str, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text('dialect = "rmw_zenoh"\ndomain = 7\n' + SHIPPED.read_text())
    report = Report()
    robot = PanelRobot(load_panel(path))
    graph = asyncio.run(check_robot(report, robot, zenoh_file(tmp_path, endpoint), 0.5))
    assert graph is not None
    (seen,) = graph.robots
    assert {node.name for node in seen.nodes} >= {"/system_controller"}
    assert seen.actions
    assert not [code for code in report.codes() if "bridge" in code], report.codes()
    assert not [code for code in report.codes() if code.startswith("link_")]
