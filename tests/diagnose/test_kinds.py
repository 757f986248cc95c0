"""Commands and the doctor find out how a robot is reached: nobody says that it is on rmw_zenoh."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from app.cli.robot.echo import main as echo
from app.cli.robot.link import GONE
from app.cli.robot.scaffold import main as scaffold
from app.cli.robot.topics import main as topics
from app.diagnose.findings import Report
from app.diagnose.names import PanelRobot
from app.diagnose.robot import check_robot
from app.panel.model import Panel
from tests.support.builders import BOOL, ENABLED, GUARDED, MESSAGE, panel_of
from tests.support.parts import zenoh_file
from tests.support.rmw import RmwNode, Router

LATCHED: Final = {"durability": "transient_local", "depth": 1}
PANEL: Final = panel_of(MESSAGE, GUARDED)


@pytest.fixture
def router(domain: int) -> Iterator[Router]:
    mine = Router()
    mine.start()
    yield mine
    mine.end()


@pytest.fixture
def robot(router: Router) -> Iterator[RmwNode]:
    mine = RmwNode(router, "arm")
    mine.advertise(ENABLED, BOOL, **LATCHED)
    mine.publish(ENABLED, {"data": True})
    yield mine
    mine.end()


def diagnosed(router: Router, folder: Path, panel: Panel = PANEL) -> Report:
    report = Report()
    asyncio.run(check_robot(report, PanelRobot(panel), zenoh_file(folder, router.endpoint), 0.5))
    return report


def test_commands_read_nodes_that_nobody_named(
    router: Router, robot: RmwNode, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert topics(["--connect", router.endpoint, "-t"]) == 0
    assert f"{ENABLED} [{BOOL}]" in capsys.readouterr().out
    assert echo([ENABLED, "--connect", router.endpoint, "--once"]) == 0
    assert "data: true" in capsys.readouterr().out
    file = tmp_path / "cell.toml"
    assert scaffold(["--connect", router.endpoint, "--listen", "0.2", "-o", str(file)]) == 0
    assert ENABLED in file.read_text()


def test_the_doctor_reads_nodes_of_a_panel_that_does_not_say_so(
    router: Router, robot: RmwNode, tmp_path: Path
) -> None:
    report = diagnosed(router, tmp_path)
    assert "the robot has nodes: 1, and topics: 1" in report.facts
    assert "link_no_peer" not in report.codes()


def test_a_bridge_and_nodes_at_one_router_are_an_error_that_asks_which(
    router: Router, robot: RmwNode, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    robot.hold("@/b1b1/@ros2_lv")  # the token of a bridge
    assert topics(["--connect", router.endpoint]) == GONE
    assert "--dialect" in capsys.readouterr().err
    assert topics(["--connect", router.endpoint, "--dialect", "rmw_zenoh"]) == 0
    assert ENABLED in capsys.readouterr().out
    assert "link_two_kinds" in diagnosed(router, tmp_path).codes()


def test_a_router_without_a_robot_is_said(
    router: Router, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert topics(["--connect", router.endpoint]) == GONE
    said = capsys.readouterr().err
    assert "bridge" in said
    assert "rmw_zenoh" in said
    assert "link_no_peer" in diagnosed(router, tmp_path).codes()
