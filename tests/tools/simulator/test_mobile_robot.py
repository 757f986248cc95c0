"""The simulated mobile robot, stepped by hand."""

import math
from typing import Final

import pytest

from app.tools.simulator.mobile_robot import (
    BLOCKED_EACH,
    DOCK,
    DOCK_NOT_IN_DB,
    DRIVES,
    FAILED_TO_CONTROL,
    FOLLOW_NO_PROGRESS,
    GOAL_OCCUPIED,
    GOAL_OUTSIDE_MAP,
    NO_VALID_PATH,
    PATIENCE_S,
    PLACES,
    RADIUS,
    START,
    STEPS_ASIDE_S,
    UNKNOWN_ERROR,
    MobileRobot,
    Pose,
    State,
    Task,
)

STEP_S: Final = 0.1
LONG_S: Final = 120.0


@pytest.fixture
def robot() -> MobileRobot:
    return MobileRobot()


def run(robot: MobileRobot, seconds: float) -> set[State]:
    """The states on the way."""
    states = set()
    for _ in range(round(seconds / STEP_S)):
        robot.step(robot.t + STEP_S)
        states.add(robot.state)
    return states


def finish(robot: MobileRobot, task: Task | None) -> Task:
    assert task is not None
    for _ in range(round(LONG_S / STEP_S)):
        if task.has_ended:
            return task
        robot.step(robot.t + STEP_S)
    raise AssertionError("the task does not end")


def drive(robot: MobileRobot, place: str) -> Task:
    return finish(robot, robot.navigate(PLACES[place]))


def dock(robot: MobileRobot) -> Task:
    return finish(robot, robot.dock("charger", drives_there=True))


def test_it_drives_to_a_place_and_turns_there(robot: MobileRobot) -> None:
    task = robot.navigate(PLACES["WRAPPER"])
    run(robot, 1)
    assert (robot.state, robot.moves, robot.place) == (State.DRIVING, True, "")
    assert finish(robot, task).code == 0
    assert robot.pose == pytest.approx(PLACES["WRAPPER"])
    assert (robot.state, robot.moves, robot.place) == (State.WAITING, False, "WRAPPER")


def test_distance_that_remains_falls_to_nothing(robot: MobileRobot) -> None:
    robot.navigate(PLACES["PALLETIZER_1"])
    distances = []
    while robot.task is not None:
        distances.append(robot.remaining)
        run(robot, STEP_S)
    assert distances == sorted(distances, reverse=True)
    assert distances[0] > 10
    assert distances[-1] == pytest.approx(0, abs=0.1)


def test_it_keeps_away_from_walls_on_every_way(robot: MobileRobot) -> None:
    for place in PLACES:
        robot.navigate(PLACES[place])
        while robot.task is not None:
            run(robot, 0.5)
            assert robot.hall.clearance(*robot.pose[:2]) >= RADIUS


@pytest.mark.parametrize(
    ("goal", "code"),
    [
        (Pose(-3.4, 9.0, 0.0), GOAL_OCCUPIED),
        (Pose(99.0, 0.0, 0.0), GOAL_OUTSIDE_MAP),
        (Pose(14.5, -8.0, 0.0), GOAL_OCCUPIED),
        (Pose(1.9, 19.0, 0.0), GOAL_OCCUPIED),
    ],
)
def test_goal_that_can_not_be_reached_fails_at_once(robot: MobileRobot, goal: Pose, code: int) -> None:
    task = robot.navigate(goal)
    assert task is not None
    assert (task.has_ended, task.code, robot.task) == (True, code, None)
    assert robot.pose == START
    assert any(str(code) in text for _, text in robot.notes())


def test_codes_of_the_planner_differ() -> None:
    assert len({GOAL_OCCUPIED, GOAL_OUTSIDE_MAP, NO_VALID_PATH, FOLLOW_NO_PROGRESS}) == 4


def test_new_goal_is_in_place_of_the_old_one(robot: MobileRobot) -> None:
    first = robot.navigate(PLACES["WRAPPER"])
    run(robot, 3)
    second = robot.navigate(PLACES["PALLETIZER_2"])
    assert first is not None
    assert (first.has_ended, first.code) == (True, UNKNOWN_ERROR)
    assert finish(robot, second).code == 0


def test_stop_ends_the_task_and_the_movement(robot: MobileRobot) -> None:
    task = robot.navigate(PLACES["WRAPPER"])
    run(robot, 5)
    robot.stop()
    where = robot.pose
    assert task is not None
    assert (task.code, robot.state, robot.moves) == (UNKNOWN_ERROR, State.WAITING, False)
    run(robot, 5)
    assert robot.pose == where


def test_box_in_the_way_stops_it_and_the_task_fails_after_a_time(robot: MobileRobot) -> None:
    robot.put_obstacle(there=True)
    task = robot.navigate(PLACES["WRAPPER"])
    assert State.BLOCKED in run(robot, 10)
    assert robot.is_blocked
    assert not robot.moves
    finish(robot, task)
    assert task is not None
    assert (task.code, task.recoveries) == (FOLLOW_NO_PROGRESS, int(PATIENCE_S / 4) - 1)
    assert robot.state is State.WAITING
    robot.put_obstacle(there=False)
    assert drive(robot, "WRAPPER").code == 0


def test_someone_in_the_way_steps_aside(robot: MobileRobot) -> None:
    for place in ("PALLETIZER_1", "WRAPPER", "PALLETIZER_2")[: BLOCKED_EACH - 1]:
        drive(robot, place)
    task = robot.navigate(PLACES["GATE_3"])
    states = run(robot, 40)
    assert State.BLOCKED in states
    assert finish(robot, task).code == 0
    assert STEPS_ASIDE_S < PATIENCE_S


def test_it_docks_and_charges_and_undocks(robot: MobileRobot) -> None:
    task = robot.dock("charger", drives_there=True)
    assert State.DOCKING in run(robot, 12)
    assert finish(robot, task).code == 0
    assert (robot.is_docked, robot.state, robot.place) == (True, State.CHARGING, "CHARGER")
    assert robot.pose == pytest.approx(DOCK)
    before = robot.charge
    run(robot, 60)
    assert robot.charge > before + 0.05
    assert finish(robot, robot.undock()).code == 0
    assert (robot.is_docked, robot.state) == (False, State.WAITING)
    assert math.dist(robot.pose[:2], DOCK[:2]) > 1
    assert robot.pose.yaw == pytest.approx(DOCK.yaw)


def test_it_leaves_the_charger_by_itself_for_a_goal(robot: MobileRobot) -> None:
    dock(robot)
    assert drive(robot, "WRAPPER").code == 0
    assert not robot.is_docked


def test_dock_that_is_unknown_or_far_away_fails(robot: MobileRobot) -> None:
    unknown = robot.dock("dock 7", drives_there=True)
    assert unknown is not None
    assert unknown.code == DOCK_NOT_IN_DB
    drive(robot, "WRAPPER")
    far = robot.dock("charger", drives_there=False)
    assert far is not None
    assert far.code == FAILED_TO_CONTROL


def test_it_takes_no_goal_while_it_docks_or_is_driven_by_hand(robot: MobileRobot) -> None:
    robot.dock("", drives_there=True)
    assert robot.navigate(PLACES["WRAPPER"]) is None
    assert robot.set_manual(on=True) == DRIVES
    robot.stop()
    assert robot.set_manual(on=True) == ""
    assert robot.navigate(PLACES["WRAPPER"]) is None
    assert robot.dock("", drives_there=True) is None
    assert robot.undock() is None


def test_by_hand_it_moves_while_messages_come_and_stops_before_walls(robot: MobileRobot) -> None:
    robot.teleop(0.5, 0.0)
    run(robot, 1)
    assert robot.pose == START
    robot.set_manual(on=True)
    for _ in range(10):
        robot.teleop(0.5, 0.0)
        run(robot, STEP_S)
    assert robot.pose.y == pytest.approx(START.y + 0.5, abs=0.06)
    run(robot, 1)
    assert not robot.moves
    for _ in range(400):
        robot.teleop(-1.0, 0.0)
        run(robot, STEP_S)
    assert robot.hall.clearance(*robot.pose[:2]) > 0
    robot.set_manual(on=False)
    assert robot.state is State.WAITING


def test_battery_drains_on_the_way_and_never_ends(robot: MobileRobot) -> None:
    run(robot, 60)
    standing = 0.64 - robot.charge
    assert standing > 0
    robot.charge = 0.05
    run(robot, 10)
    assert robot.charge == 0.05


def test_odometry_and_its_correction_are_the_pose(robot: MobileRobot) -> None:
    drive(robot, "GATE_3")
    assert robot.odom.then(robot.by_odometry) == pytest.approx(robot.pose)
    assert robot.odom != Pose(START.x, START.y, 0.0)


def test_pose_that_is_set_makes_it_unsure_for_a_while(robot: MobileRobot) -> None:
    robot.set_pose(Pose(1.0, 1.0, 0.0))
    assert robot.uncertainty == 0.5
    run(robot, 30)
    assert robot.uncertainty < 0.06
    assert robot.pose == START


def test_machine_that_slept_goes_on_where_it_was(robot: MobileRobot) -> None:
    robot.navigate(PLACES["WRAPPER"])
    robot.step(3600.0)
    assert robot.task is not None
    assert robot.t == pytest.approx(3600.0)
