"""Commands and the doctor find out how a robot is reached: nobody says that it is on rmw_zenoh."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from app.panel.model import Panel
from app.tools.cli.doctor import as_text
from app.tools.cli.robot.echo import main as echo
from app.tools.cli.robot.options import GONE
from app.tools.cli.robot.scaffold import main as scaffold
from app.tools.cli.robot.topics import main as topics
from app.tools.doctor.findings import Report
from app.tools.doctor.names import PanelRobot
from app.tools.doctor.robot import check_robot
from tests.support.builders import BOOL, ENABLED, GUARDED, MESSAGE, TEXT, panel_of
from tests.support.parts import zenoh_file
from tests.support.rmw import RmwNode, Router, router_without_admin_space

pytestmark = pytest.mark.promise("doctor")

LATCHED: Final = {"durability": "transient_local", "depth": 1}
LOG: Final = "rcl_interfaces/msg/Log"
NODES_LOG: Final = {"id": "log", "kind": "log", "label": "Log"}
PANEL: Final = panel_of(MESSAGE, GUARDED)


@pytest.fixture
def router(zenohd: None) -> Iterator[Router]:
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


def test_the_doctor_finds_nothing_on_a_robot_of_several_processes(
    router: Router, robot: RmwNode, tmp_path: Path
) -> None:
    """Each process is a session with a /rosout of its own, and no bridge. No QoS is incompatible."""
    robot.subscribe("/guarded", TEXT, durability="transient_local")
    another = RmwNode(router, "daemon")
    try:
        for node in (robot, another):
            node.advertise("/rosout", LOG, **LATCHED)
        report = diagnosed(router, tmp_path, panel_of(MESSAGE, GUARDED, NODES_LOG))
        assert [f.code for f in report.findings if f.severity != "note"] == [], as_text(report)
        another.advertise(ENABLED, BOOL, **LATCHED)
        report = diagnosed(router, tmp_path)
        assert [f.code for f in report.findings if f.severity != "note"] == ["permission_publishers"]
    finally:
        another.end()


def test_a_bridge_and_nodes_at_one_router_are_an_error_that_asks_which(
    router: Router, robot: RmwNode, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    robot.hold("@/b1b1/@ros2_lv")  # the token of a bridge
    assert topics(["--connect", router.endpoint]) == GONE
    assert "--dialect" in capsys.readouterr().err
    assert topics(["--connect", router.endpoint, "--dialect", "rmw_zenoh"]) == 0
    assert ENABLED in capsys.readouterr().out
    assert "link_two_kinds" in diagnosed(router, tmp_path).codes()


def test_a_router_without_an_admin_space_is_an_error_with_its_line(tmp_path: Path) -> None:
    lacks_an_admin_space(router_without_admin_space(tmp_path), tmp_path)


def test_zenohd_whose_admin_space_may_not_be_read_is_the_same_error(
    zenohd: None, tmp_path: Path
) -> None:
    router, file = Router(), tmp_path / "router.json5"
    listen = f'listen: {{ endpoints: ["{router.endpoint}"] }}'
    file.write_text(f"{{ {listen}, adminspace: {{ permissions: {{ read: false, write: false }} }} }}")
    router.configure(file)
    lacks_an_admin_space(router, tmp_path)


def lacks_an_admin_space(router: Router, folder: Path) -> None:
    router.start()
    robot = RmwNode(router, "arm")
    try:
        report = diagnosed(router, folder)
        assert "link_router_no_admin" in report.codes()
        assert "adminspace: { enabled: true" in as_text(report)
    finally:
        robot.end()
        router.end()


def test_a_router_without_a_robot_is_said(
    router: Router, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert topics(["--connect", router.endpoint]) == GONE
    said = capsys.readouterr().err
    assert "bridge" in said
    assert "rmw_zenoh" in said
    assert "link_no_peer" in diagnosed(router, tmp_path).codes()
