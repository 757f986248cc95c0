"""Which messages may be latched ones, sent again; times in seconds."""

import math

import pytest

from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.publishers import REPLAY_S, ReplayedMessages
from app.cell.robot.state import RobotState
from app.ros.messages.names import Qos
from app.ros.zenoh.inbox import Inbox
from app.ros.zenoh.sample import Sample
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    INTERFACES,
    endpoint,
    robot_there,
    small_panel,
)

KEY = "operation_enabled"
JOINED = 100.0
PANEL = small_panel({"max_age_s": 60.0})
TRUE = INTERFACES.encode(BOOL, {"data": True})
LATCHED = Qos(transient_local=True, depth=1)


@pytest.fixture
def robot() -> RobotState:
    there = robot_there(PANEL)
    there.settled_at = JOINED
    return there


def says(robot: RobotState, at: float, cached: bool = False) -> bool:
    """The robot permits at this time; whether the panel does, by that."""
    robot.update(KEY, Sample(TRUE, int(at * 10), at, at, BRIDGE, cached=cached))
    return interlock_verdict(PANEL.interlocks[0], robot, at).permitted


@pytest.mark.parametrize("late_s", [0.5, 1.0, 5.0, 3600.0])
def test_the_first_value_of_a_latched_publisher_is_never_fresh(
    robot: RobotState, late_s: float
) -> None:
    endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED)
    assert not says(robot, JOINED + late_s)
    assert interlock_verdict(PANEL.interlocks[0], robot, JOINED + late_s).code == "interlock_waiting"


def test_periodic_latched_publisher_unlocks_with_its_next_message(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED)
    first = JOINED + 10.0
    assert [says(robot, first + s) for s in (0.0, 0.01, 0.5, REPLAY_S, REPLAY_S + 0.5)] == [
        False,
        False,  # a publisher may keep several
        False,
        True,
        True,
    ]


def test_slow_publisher_unlocks_with_its_second_message(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED)
    assert [says(robot, JOINED + 10.0), says(robot, JOINED + 40.0)] == [False, True]


def test_a_volatile_publisher_says_nothing_again(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL)
    assert says(robot, JOINED + 1.0)


def test_a_publisher_that_is_not_known_yet_may_be_latched(robot: RobotState) -> None:
    """Its token comes up to seconds after what it said."""
    assert not says(robot, JOINED + 5.0)
    endpoint(robot, "MP", ENABLED, BOOL, zid="b1")
    assert interlock_verdict(PANEL.interlocks[0], robot, JOINED + 5.1).permitted
    endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED)  # of several, each may be the one that spoke
    assert not interlock_verdict(PANEL.interlocks[0], robot, JOINED + 5.2).permitted


def test_message_before_joining_the_graph_does_not_count_as_first(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED)
    robot.settled_at = math.inf
    assert not says(robot, JOINED - 5.0)
    robot.settled_at = JOINED
    assert [says(robot, JOINED + 3.0), says(robot, JOINED + 5.0)] == [False, True]


@pytest.mark.parametrize("event", ["bridge lost", "publisher lost", "session lost", "publisher new"])
def test_after_each_loss_and_each_new_publisher_the_next_is_the_first(event: str) -> None:
    panel = small_panel({"max_age_s": 60.0, "require_publisher": True})
    robot = robot_there(panel)
    robot.settled_at = JOINED
    endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED)
    robot.update_publishers()
    assert [says(robot, JOINED + 3.0), says(robot, JOINED + 5.0)] == [False, True]
    if event == "bridge lost":
        robot.mark_peer_lost(BRIDGE, 10**6)
    elif event == "publisher lost":
        endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED, alive=False)
        robot.update_publishers()
    elif event == "session lost":
        robot.mark_link_lost()
    else:
        robot.replayed.begin(KEY, JOINED + 6.0)
    assert robot.replayed.known_since(KEY) == math.inf


def test_message_at_a_publishers_appearance_counts_as_first() -> None:
    replayed = ReplayedMessages()
    for at in (1.0, 5.0):
        replayed.record_message(KEY, at, 0.0, False)
    replayed.begin(KEY, 4.9)  # the token's time, taken in after the message
    assert replayed.known_since(KEY) == 5.0 + REPLAY_S


def test_cached_sample_is_never_fresh(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL, qos=LATCHED)
    assert not says(robot, JOINED + 10.0, cached=True)
    assert not says(robot, JOINED + 20.0, cached=True)
    assert says(robot, JOINED + 30.0)


def test_inbox_marks_samples_from_a_cache() -> None:
    inbox = Inbox(lambda _: None)
    inbox.put_cached(KEY, TRUE, None)
    assert inbox.drain().samples[KEY].cached
    inbox.put(KEY, TRUE, None)
    assert not inbox.drain().samples[KEY].cached
