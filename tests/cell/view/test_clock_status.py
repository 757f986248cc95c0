"""What is said of a robot's clock: on the page of diagnostics, in the details of its link, in the
header."""

from collections.abc import Callable

import pytest

from app.cell.robot.clocks import PAUSED_S
from app.cell.robot.state import RobotState
from app.cell.view.clock_status import clock_note, clock_status, simulation_banner
from app.system.texts import Text
from tests.cell.robot.test_clocks import WALL, clock_message, record, record_peer
from tests.support.builders import robot_there, small_panel

NOW = 10.0


@pytest.fixture
def robot() -> RobotState:
    return robot_there(small_panel())


def nothing(robot: RobotState) -> None:
    """No stamp has arrived."""


def even(robot: RobotState) -> None:
    record_peer(robot.clock, 0.5)
    record(robot.clock, "odom", 0.4)


def behind(robot: RobotState) -> None:
    record_peer(robot.clock, -41.2)
    record(robot.clock, "odom", -41.3)


def ahead(robot: RobotState) -> None:
    record(robot.clock, "odom", 3700.0)


def a_node_behind(robot: RobotState) -> None:
    record_peer(robot.clock, 0.0)
    for key in ("odom", "scan", "imu"):
        record(robot.clock, key, -41.0)


def a_recording(robot: RobotState) -> None:
    record_peer(robot.clock, 0.0)
    record(robot.clock, "odom", 1.78e9 - WALL)


def from_zero(robot: RobotState) -> None:
    record(robot.clock, "odom", -WALL)


def simulated_awaited(robot: RobotState) -> None:
    robot.clock.begin_simulated()


def simulated(robot: RobotState) -> None:
    robot.clock.begin_simulated().put(clock_message(123.4), NOW)


def simulated_of_a_recording(robot: RobotState) -> None:
    robot.clock.begin_simulated().put(clock_message(1.78e9), NOW)


def paused(robot: RobotState) -> None:
    robot.clock.begin_simulated().put(clock_message(123.4), NOW - PAUSED_S)


def not_simulated(robot: RobotState) -> None:
    clock = robot.clock.begin_simulated()
    clock.put(clock_message(123.4), NOW)
    record(robot.clock, "odom", 0.0)


CASES: list[tuple[Callable[[RobotState], None], str, str, str, str]] = [
    (nothing, "unknown", "clock_unknown", "", ""),
    (even, "even", "clock_even", "", ""),
    (behind, "apart", "clock_behind", "clock_behind_do", ""),
    (ahead, "apart", "clock_ahead", "clock_ahead_do", ""),
    (a_node_behind, "apart", "clock_even", "clock_stamps_apart", ""),
    (a_recording, "other_time", "clock_other_time", "clock_other_time_do", ""),
    (from_zero, "other_time", "clock_other_time", "clock_other_time_do", ""),
    (simulated_awaited, "simulated_awaited", "clock_awaited", "clock_awaited_do", "simulated_time"),
    (simulated, "simulated", "clock_simulated", "", "simulated_time"),
    (simulated_of_a_recording, "simulated", "clock_simulated", "", "simulated_time"),
    (paused, "simulated_paused", "clock_paused", "clock_paused_do", "simulated_time_paused"),
    (not_simulated, "simulated", "clock_simulated", "clock_stamps_not_simulated", "simulated_time"),
]


def code(text: object) -> str:
    return text.code if isinstance(text, Text) else str(text)


@pytest.mark.parametrize(
    ("happens", "state", "text", "reason", "banner"), CASES, ids=[case[0].__name__ for case in CASES]
)
def test_what_is_said_of_the_clock(
    robot: RobotState,
    happens: Callable[[RobotState], None],
    state: str,
    text: str,
    reason: str,
    banner: str,
) -> None:
    happens(robot)
    status = clock_status(robot, NOW)
    assert (status.state, code(status.text), code(status.reason)) == (state, text, reason)
    assert code(clock_note(robot, NOW)) == reason
    assert code(simulation_banner(robot, NOW, is_simulated=False)) == banner
    both = banner.replace("simulated", "simulated_robot") if banner else "simulated"
    assert code(simulation_banner(robot, NOW, is_simulated=True)) == both
    assert (status.skew_s is None) == (state not in ("even", "apart"))


def test_a_skew_is_as_exact_as_the_round_trip(robot: RobotState) -> None:
    record_peer(robot.clock, -41.2)
    assert clock_status(robot, NOW).within_s == pytest.approx(0.01)
    robot.round_trips.record(0.08, NOW)
    assert clock_status(robot, NOW).within_s == pytest.approx(0.08)


def test_topics_are_named_and_counted(robot: RobotState) -> None:
    a_node_behind(robot)
    reason = clock_status(robot, NOW).reason
    assert isinstance(reason, Text)
    assert dict(reason.params)["topics"] == Text(
        "and_more", (("names", ("/imu", "/odom")), ("number", 1))
    )
