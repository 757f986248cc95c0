"""What the doctor finds where a panel is at two routers, with the real bridge."""

import asyncio
from contextlib import ExitStack
from pathlib import Path

import pytest

from app.panel import load_panel
from app.tools.doctor.findings import Report
from app.tools.doctor.names import PanelRobot
from app.tools.doctor.robot import check_robot
from tests.bridge import test_robots_at_routers_on_bridge as at_routers
from tests.bridge.test_robots_at_routers_on_bridge import PANEL, Robot
from tests.support.parts import client_file, until
from tests.support.rmw import LinkedRouters

pytestmark = pytest.mark.promise("doctor")

stack, routers = at_routers.stack, at_routers.routers


@pytest.mark.parametrize(
    ("mode", "expected"), [("peer", ["peer_at_routers"]), ("client", [])], ids=["peer", "client"]
)
def test_a_peer_of_two_routers_is_found_and_no_client(
    domain: int,
    routers: LinkedRouters,
    stack: ExitStack,
    tmp_path: Path,
    mode: str,
    expected: list[str],
) -> None:
    robot = Robot(stack, domain + 6, routers.endpoints)
    robot.node.every("/heard", {"data": "again"}, 0.1)
    file = tmp_path / "cell.toml"
    file.write_text(PANEL.replace("{robots}", ""))
    zenoh = client_file(tmp_path, *routers.endpoints)
    zenoh.write_text(zenoh.read_text().replace('"client"', f'"{mode}"'))

    def codes() -> set[str]:
        report = Report()
        asyncio.run(check_robot(report, PanelRobot(load_panel(file)), zenoh, 1.0))
        return set(report.codes())

    until(lambda: codes() & {"peer_at_routers", "bridge_piled_readers"} == set(expected), "found")
