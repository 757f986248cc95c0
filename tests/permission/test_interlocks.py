"""Every ground on which a control is locked, with its sentence, and what permits."""

import math
from collections.abc import Callable

import pytest

from app.dialect.bridge_dialect import bridge_token, server_token
from app.interfaces.names import Qos
from app.panel.interlock import Interlock
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Call
from app.permission.interlocks import (
    SERVER_SETTLE_S,
    Verdict,
    interlock_verdict,
    link_verdict,
)
from app.permission.press_permission import judged
from app.robot.state import RobotState, Sample
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    INTERFACES,
    NOTHING,
    NOW,
    TEXT,
    Table,
    endpoint,
    panel_of,
    permits,
    robot_there,
    small_panel,
)
from tests.support.words import english


def verdict_of(robot: RobotState, interlock: Table = NOTHING, now: float = NOW) -> Verdict:
    made = Interlock.model_validate({"id": "operation", "topic": ENABLED, **interlock})
    return interlock_verdict(made, robot, now)


@pytest.fixture
def robot() -> RobotState:
    """There, and it permits."""
    made = robot_there(small_panel())
    permits(made)
    return made


def no_link(robot: RobotState) -> None:
    robot.link_up = False


def no_bridge(robot: RobotState) -> None:
    robot.graph.apply_token(bridge_token(BRIDGE), False)


def bridge_silent(robot: RobotState) -> None:
    robot.graph.update_versions({})


def bridge_unheard(robot: RobotState) -> None:
    robot.is_responding = False


def no_link_at(robot: RobotState) -> None:
    robot.link_up = False
    robot.endpoints = ("tcp/robot1:7447",)


def no_link_at_many(robot: RobotState) -> None:
    robot.link_up = False
    robot.endpoints = tuple(f"tcp/r{number}:1" for number in range(5))


def joining(robot: RobotState) -> None:
    robot.settled_at = NOW + 1


SILENT = (
    "No connection to the robot: its bridge does not respond. If this persists, restart the bridge."
)
WAYS: list[tuple[Callable[[RobotState], None], str, str]] = [
    (no_link, "no_link", "No connection to the robot: its bridge cannot be reached."),
    (
        no_link_at,
        "no_link",
        "No connection to the robot: its bridge cannot be reached at tcp/robot1:7447.",
    ),
    (
        no_link_at_many,
        "no_link",
        "No connection to the robot: its bridge cannot be reached at tcp/r0:1, tcp/r1:1, tcp/r2:1 "
        "and 2 more.",
    ),
    (
        no_bridge,
        "no_bridge",
        "No connection to the robot: Zenoh responds, but no ROS 2 bridge is running.",
    ),
    (bridge_silent, "bridge_silent", SILENT),
    (bridge_unheard, "bridge_silent", SILENT),
    (joining, "joining", "Connecting to the robot's topics. Please wait."),
]


def free() -> Publish:
    widget = next(w for w in small_panel().widgets() if w.id == "free")
    assert isinstance(widget, Publish)
    return widget


@pytest.mark.parametrize(("broken", "code", "reason"), WAYS)
def test_without_a_way_to_the_robot_everything_is_locked(
    robot: RobotState, broken: Callable[[RobotState], None], code: str, reason: str
) -> None:
    broken(robot)
    for verdict in (link_verdict(robot, NOW), verdict_of(robot), judged(free(), (), robot, NOW)):
        assert english((verdict.permitted, verdict.code, verdict.reason)) == (False, code, reason)


def test_with_a_way_commands_can_reach_the_robot(robot: RobotState) -> None:
    assert link_verdict(robot, NOW) == Verdict(True)


def test_joining_ends_by_itself_when_its_time_is_up(robot: RobotState) -> None:
    robot.settled_at = NOW + 1
    assert link_verdict(robot, NOW).until == NOW + 1
    assert link_verdict(robot, NOW + 1).permitted


def test_a_robot_that_says_true_permits(robot: RobotState) -> None:
    assert verdict_of(robot) == Verdict(True)


def test_nothing_is_permitted_before_the_robot_said_so() -> None:
    verdict = verdict_of(robot_there(small_panel()))
    assert english((verdict.permitted, verdict.code, verdict.reason)) == (
        False,
        "waiting",
        "Locked: waiting for /operation_enabled.",
    )


@pytest.mark.parametrize(("label", "name"), [(None, "operation"), ("Operation of the cell",) * 2])
def test_a_robot_that_says_false_forbids(robot: RobotState, label: str | None, name: str) -> None:
    permits(robot, False)
    verdict = verdict_of(robot, {"label": label})
    assert (verdict.permitted, verdict.code) == (False, "forbidden")
    assert english(verdict.reason) == f"The robot does not permit {name}."


def test_what_was_permitted_before_a_cut_is_locked(robot: RobotState) -> None:
    robot.mark_bridge_lost(BRIDGE, 2)
    verdict = verdict_of(robot)
    assert english((verdict.permitted, verdict.code, verdict.reason)) == (
        False,
        "cut",
        "Locked: the connection was lost. Waiting for a new /operation_enabled.",
    )


@pytest.mark.parametrize("payload", [b"", b"true!", b"\0\1\0\0", b"\0\1\0\0\1\0\0\0\0\0\0\0"])
def test_what_can_not_be_read_locks(robot: RobotState, payload: bytes) -> None:
    robot.update(robot.key(ENABLED), Sample(payload, 2, NOW, NOW, BRIDGE))
    verdict = verdict_of(robot)
    assert english((verdict.permitted, verdict.code, verdict.reason)) == (
        False,
        "unreadable",
        "Locked: /operation_enabled cannot be read. The data received is not std_msgs/msg/Bool.",
    )


def test_another_type_on_the_robot_locks(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, TEXT)
    verdict = verdict_of(robot)
    assert english((verdict.permitted, verdict.code, verdict.reason)) == (
        False,
        "wrong_type",
        "/operation_enabled is std_msgs/msg/String on the robot, "
        "but this panel expects std_msgs/msg/Bool.",
    )


@pytest.mark.parametrize("age", [2.0, 2.001, 1e6])
def test_a_permission_that_is_too_old_is_stale(robot: RobotState, age: float) -> None:
    endpoint(robot, "MP", ENABLED, BOOL)
    verdict = verdict_of(robot, {"max_age_s": 2}, NOW + age)
    assert english((verdict.permitted, verdict.code, verdict.reason)) == (
        False,
        "stale",
        "Locked: the last /operation_enabled is older than 2 s.",
    )


def test_a_fresh_permission_says_when_it_ends(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL)
    assert verdict_of(robot, {"max_age_s": 2}, NOW + 1.999) == Verdict(True, until=NOW + 2)


def test_a_permission_without_an_age_stays(robot: RobotState) -> None:
    assert verdict_of(robot, now=NOW + 1e9) == Verdict(True, until=math.inf)


def test_a_new_sample_ends_staleness(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL)
    permits(robot, at=NOW + 5)
    assert verdict_of(robot, {"max_age_s": 2}, NOW + 5).permitted


def test_an_interlock_may_ask_for_a_publisher(robot: RobotState) -> None:
    verdict = verdict_of(robot, {"require_publisher": True})
    assert english((verdict.permitted, verdict.code, verdict.reason)) == (
        False,
        "no_publisher",
        "Locked: no node of the robot publishes /operation_enabled.",
    )
    endpoint(robot, "MP", ENABLED, BOOL)
    assert verdict_of(robot, {"require_publisher": True}).permitted


def test_a_publisher_that_ended_locks_where_one_is_asked_for(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL)
    endpoint(robot, "MP", ENABLED, BOOL, alive=False)
    assert verdict_of(robot, {"require_publisher": True}).code == "no_publisher"
    assert verdict_of(robot).permitted


def test_a_publish_without_an_interlock_needs_a_way_only() -> None:
    assert judged(free(), (), robot_there(small_panel()), NOW).permitted


def test_a_publish_to_a_topic_of_another_type_is_locked(robot: RobotState) -> None:
    endpoint(robot, "MS", "/free", BOOL)
    verdict = judged(free(), (), robot, NOW)
    assert english((verdict.code, verdict.reason)) == (
        "wrong_type",
        "/free is std_msgs/msg/Bool on the robot, but this panel expects std_msgs/msg/String.",
    )


def test_a_publish_has_the_verdict_of_its_interlock(robot: RobotState) -> None:
    interlock = Interlock(id="operation", topic=ENABLED)
    assert judged(free(), [interlock], robot, NOW).permitted
    permits(robot, False)
    assert judged(free(), [interlock], robot, NOW).code == "forbidden"


@pytest.mark.parametrize("permitted", [True, False])
def test_a_bool_of_a_larger_message_can_permit(permitted: bool) -> None:
    interlock = {"type": "sensor_msgs/msg/RegionOfInterest", "field": "do_rectify"}
    robot = robot_there(small_panel(interlock))
    sizes = dict.fromkeys(("x_offset", "y_offset", "height", "width"), 1)
    payload = INTERFACES.encode(interlock["type"], {**sizes, "do_rectify": permitted})
    robot.update(robot.key(ENABLED), Sample(payload, 1, NOW, NOW, BRIDGE))
    assert verdict_of(robot, interlock).permitted is permitted


def test_a_permission_that_is_published_best_effort_locks_a_panel_that_asks_for_reliable() -> None:
    best_effort = Qos(reliable=False)
    robot = robot_there(small_panel())
    permits(robot)
    endpoint(robot, "MP", ENABLED, BOOL, qos=best_effort)
    verdict = interlock_verdict(small_panel().interlocks[0], robot, NOW)
    assert (verdict.permitted, verdict.code) == (False, "publishes_best_effort")
    assert english(verdict.reason) == (
        "The robot publishes /operation_enabled as best effort, but this panel requires reliable."
    )
    asks_less = small_panel({"qos": {"reliability": "best_effort"}}).interlocks[0]
    assert interlock_verdict(asks_less, robot, NOW).permitted


def test_a_subscriber_that_would_not_hear_locks_a_press() -> None:
    robot = robot_there(small_panel())
    endpoint(robot, "MS", "/free", TEXT, qos=Qos(transient_local=True))
    verdict = judged(free(), (), robot, NOW)
    assert (
        english(verdict.reason)
        == "The robot requires /free as transient local, but this panel publishes it as volatile."
    )
    assert not verdict.permitted


def test_a_service_that_has_just_come_is_not_called_yet() -> None:
    call = Call(id="reset", kind="call", label="Reset", service="/reset", type="std_srvs/srv/Trigger")
    robot = robot_there(panel_of(call.model_dump(exclude_none=True, exclude_defaults=True)))
    token = server_token(BRIDGE, "SS", "reset", call.type)
    assert judged(call, (), robot, NOW).code == "no_service"
    robot.graph.apply_token(token, True, NOW)
    verdict = judged(call, (), robot, NOW)
    assert english((verdict.permitted, verdict.code, verdict.reason, verdict.until)) == (
        False,
        "getting_ready",
        "Locked: the robot has just started /reset. Connecting.",
        NOW + SERVER_SETTLE_S,
    )
    assert judged(call, (), robot, NOW + SERVER_SETTLE_S).permitted
    robot.graph.apply_token(token, False)
    robot.graph.apply_token(token, True, NOW + 9)  # another node of this name
    assert judged(call, (), robot, NOW + 9).code == "getting_ready"
