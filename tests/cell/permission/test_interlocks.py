"""Every ground on which a control is locked, with its code, and what permits."""

import math
from collections.abc import Callable

import pytest

from app.cell.permission.interlocks import interlock_verdict, link_verdict
from app.cell.permission.press_permission import judged
from app.cell.permission.verdict import Verdict, locked, parameters_offered, topic_mismatch
from app.cell.robot.state import RobotState, Sample
from app.panel.condition import Interlock
from app.panel.widgets.parameter import DESCRIBE, GET, SET
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Call
from app.ros.dialects.bridge_dialect import bridge_token, server_token
from app.ros.dialects.peer_traits import RMW_ZENOH_TRAITS
from app.ros.messages.names import Qos
from app.system.texts import say
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
    says,
    small_panel,
)

pytestmark = pytest.mark.promise("locks")


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


def behind(robot: RobotState) -> None:
    robot.is_caught_up = False


def no_link_at(robot: RobotState) -> None:
    robot.link_up = False
    robot.endpoints = ("tcp/robot1:7447",)


def no_link_at_many(robot: RobotState) -> None:
    robot.link_up = False
    robot.endpoints = tuple(f"tcp/r{number}:1" for number in range(5))


def joining(robot: RobotState) -> None:
    robot.settled_at = NOW + 1


MANY = say("and_more", names=("tcp/r0:1", "tcp/r1:1", "tcp/r2:1"), number=2)
WAYS: list[tuple[Callable[[RobotState], None], Verdict]] = [
    (no_link, locked("link_unreachable")),
    (
        no_link_at,
        Verdict(False, "link_unreachable", say("link_unreachable_at", where=("tcp/robot1:7447",))),
    ),
    (no_link_at_many, Verdict(False, "link_unreachable", say("link_unreachable_at", where=MANY))),
    (no_bridge, locked("link_no_bridge", name="")),
    (bridge_silent, locked("link_bridge_silent")),
    (bridge_unheard, locked("link_bridge_silent")),
    (behind, locked("link_catching_up")),
    (joining, Verdict(False, "link_connecting", say("link_connecting"), NOW + 1)),
]


def free() -> Publish:
    widget = next(w for w in small_panel().widgets() if w.id == "free")
    assert isinstance(widget, Publish)
    return widget


@pytest.mark.parametrize(("broken", "verdict"), WAYS)
def test_without_a_way_to_the_robot_everything_is_locked(
    robot: RobotState, broken: Callable[[RobotState], None], verdict: Verdict
) -> None:
    broken(robot)
    for judgement in (link_verdict(robot, NOW), verdict_of(robot), judged(free(), (), robot, NOW)):
        assert judgement == verdict


def test_with_a_way_commands_can_reach_the_robot(robot: RobotState) -> None:
    assert link_verdict(robot, NOW) == Verdict(True)


def test_joining_ends_by_itself_when_its_time_is_up(robot: RobotState) -> None:
    robot.settled_at = NOW + 1
    assert link_verdict(robot, NOW).until == NOW + 1
    assert link_verdict(robot, NOW + 1).permitted


def test_a_robot_that_says_true_permits(robot: RobotState) -> None:
    assert verdict_of(robot) == Verdict(True)


def test_unknown_permission_locks() -> None:
    verdict = verdict_of(robot_there(small_panel()))
    assert verdict == locked("interlock_waiting", topic=ENABLED, wanted=BOOL)


@pytest.mark.parametrize(("label", "name"), [(None, "operation"), ("Operation of the cell",) * 2])
def test_a_robot_that_says_false_forbids(robot: RobotState, label: str | None, name: str) -> None:
    permits(robot, False)
    verdict = verdict_of(robot, {"label": label})
    assert verdict == locked("interlock_not_permitted", name=name)


def test_the_end_of_a_publisher_is_no_lost_connection() -> None:
    strict = {"require_publisher": True}
    robot = robot_there(small_panel(strict))
    endpoint(robot, "MP", ENABLED, BOOL)
    robot.update_publishers()
    permits(robot)
    endpoint(robot, "MP", ENABLED, BOOL, alive=False)
    robot.update_publishers()
    assert verdict_of(robot, strict).code == "interlock_no_publisher"
    endpoint(robot, "MP", ENABLED, BOOL)
    robot.update_publishers()
    assert verdict_of(robot, strict).code == "interlock_publisher_ended"


def test_the_end_of_a_process_on_rmw_zenoh_is_no_lost_connection(robot: RobotState) -> None:
    robot.traits = RMW_ZENOH_TRAITS
    robot.mark_peer_lost(BRIDGE, 2)
    assert verdict_of(robot).code == "interlock_publisher_ended"


def test_permission_from_before_a_cut_is_locked(robot: RobotState) -> None:
    robot.mark_peer_lost(BRIDGE, 2)
    verdict = verdict_of(robot)
    assert verdict == locked("interlock_connection_lost", topic=ENABLED, wanted=BOOL)


@pytest.mark.parametrize("payload", [b"", b"true!", b"\0\1\0\0", b"\0\1\0\0\1\0\0\0\0\0\0\0"])
def test_unreadable_value_locks(robot: RobotState, payload: bytes) -> None:
    robot.update(robot.key(ENABLED), Sample(payload, 2, NOW, NOW, BRIDGE))
    verdict = verdict_of(robot)
    assert verdict == locked("interlock_unreadable", topic=ENABLED, wanted=BOOL)


def test_another_type_on_the_robot_locks(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, TEXT)
    verdict = verdict_of(robot)
    assert verdict == locked("topic_wrong_type", topic=ENABLED, found=TEXT, wanted=BOOL)


@pytest.mark.parametrize("age", [2.0, 2.001, 1e6])
def test_a_permission_that_is_too_old_is_stale(robot: RobotState, age: float) -> None:
    endpoint(robot, "MP", ENABLED, BOOL)
    verdict = verdict_of(robot, {"max_age_s": 2}, NOW + age)
    assert verdict == locked("interlock_stale", topic=ENABLED, limit="2")


def test_fresh_permission_has_its_expiry_time(robot: RobotState) -> None:
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
    assert verdict == locked("interlock_no_publisher", topic=ENABLED)
    endpoint(robot, "MP", ENABLED, BOOL)
    assert verdict_of(robot, {"require_publisher": True}).permitted


def test_ended_publisher_locks_a_required_publisher_interlock(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, BOOL)
    endpoint(robot, "MP", ENABLED, BOOL, alive=False)
    assert verdict_of(robot, {"require_publisher": True}).code == "interlock_no_publisher"
    assert verdict_of(robot).permitted


def test_a_publish_without_an_interlock_needs_a_way_only() -> None:
    assert judged(free(), (), robot_there(small_panel()), NOW).permitted


def test_a_publish_to_a_topic_of_another_type_is_locked(robot: RobotState) -> None:
    endpoint(robot, "MS", "/free", BOOL)
    verdict = judged(free(), (), robot, NOW)
    assert verdict == locked("topic_wrong_type", topic="/free", found=BOOL, wanted=TEXT)


def test_a_publish_has_the_verdict_of_its_interlock(robot: RobotState) -> None:
    interlock = Interlock(id="operation", topic=ENABLED)
    assert judged(free(), [interlock], robot, NOW).permitted
    permits(robot, False)
    assert judged(free(), [interlock], robot, NOW).code == "interlock_not_permitted"


@pytest.mark.parametrize(
    ("value", "text"), [(math.nan, "not a number (NaN)"), (-math.inf, "−Infinity"), (0.5, "0.5")]
)
def test_a_number_that_is_none_is_named_so(value: float, text: str) -> None:
    float64 = "std_msgs/msg/Float64"
    panel = small_panel({"type": float64, "min": 1.0, "label": "Air"})
    cell = robot_there(panel)
    says(cell, ENABLED, value, float64)
    reason = interlock_verdict(panel.interlocks[0], cell, NOW).reason
    assert str(reason) == f"Air is {text}: it must be 1 or more."


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
    assert verdict == locked("qos_robot_best_effort", topic=ENABLED)
    asks_less = small_panel({"qos": {"reliability": "best_effort"}}).interlocks[0]
    assert interlock_verdict(asks_less, robot, NOW).permitted


def test_a_best_effort_publisher_does_not_mismatch_a_topic_that_is_only_shown() -> None:
    robot = robot_there(small_panel())
    heard = next(source for source in small_panel().monitored if source.topic == "/heard")
    endpoint(robot, "MP", "/heard", TEXT, qos=Qos(reliable=False))
    assert topic_mismatch("MS", heard, robot) is None
    robot.reliable_readers = {robot.key("/heard")}
    assert topic_mismatch("MS", heard, robot) == locked("qos_robot_best_effort", topic="/heard")


def test_a_subscriber_that_would_not_hear_locks_a_press() -> None:
    robot = robot_there(small_panel())
    endpoint(robot, "MS", "/free", TEXT, qos=Qos(transient_local=True))
    verdict = judged(free(), (), robot, NOW)
    assert verdict == locked("qos_robot_requires_transient_local", topic="/free")


def test_no_qos_locks_a_robot_that_has_none_of_dds() -> None:
    robot = robot_there(small_panel())
    robot.traits = RMW_ZENOH_TRAITS
    permits(robot)
    endpoint(robot, "MP", ENABLED, BOOL, qos=Qos(reliable=False))
    endpoint(robot, "MS", "/free", TEXT, qos=Qos(transient_local=True))
    assert interlock_verdict(small_panel().interlocks[0], robot, NOW).permitted
    assert judged(free(), (), robot, NOW).permitted


def test_a_service_that_has_just_come_is_not_called_yet() -> None:
    call = Call(id="reset", kind="call", label="Reset", service="/reset", type="std_srvs/srv/Trigger")
    robot = robot_there(panel_of(call.model_dump(exclude_none=True, exclude_defaults=True)))
    token = server_token(BRIDGE, "SS", "reset", call.type)
    assert judged(call, (), robot, NOW).code == "service_unavailable"
    robot.graph.apply_token(token, True, NOW)
    verdict = judged(call, (), robot, NOW)
    ready_at = NOW + robot.traits.server_settle_s
    assert verdict == Verdict(
        False, "service_connecting", say("service_connecting", name="/reset"), ready_at
    )
    assert judged(call, (), robot, NOW + robot.traits.server_settle_s).permitted
    robot.graph.apply_token(token, False)
    robot.graph.apply_token(token, True, NOW + 9)  # another node of this name
    assert judged(call, (), robot, NOW + 9).code == "service_connecting"


def test_a_server_is_not_called_before_its_node_is_read() -> None:
    call = Call(id="reset", kind="call", label="Reset", service="/reset", type="std_srvs/srv/Trigger")
    robot = robot_there(panel_of(call.model_dump(exclude_none=True, exclude_defaults=True)))
    robot.graph.apply_token(server_token(BRIDGE, "SS", "reset", call.type), True, 0.0)
    assert judged(call, (), robot, NOW).permitted
    robot.nodes_are_read = True
    assert judged(call, (), robot, NOW) == locked("service_connecting", name="/reset")
    robot.graph.update_routes((), (), 1.0)
    assert judged(call, (), robot, NOW).permitted


def test_parameters_need_the_three_services_with_their_types() -> None:
    speed = {"id": "speed", "kind": "parameter", "label": "Speed", "node": "/arm"}
    robot = robot_there(panel_of({**speed, "parameter": "speed", "type": "double"}))

    def serve(name: str, type_name: str, alive: bool = True) -> None:
        robot.graph.apply_token(server_token(BRIDGE, "SS", f"arm/{name}", type_name), alive, 0.0)

    serve(*GET)
    serve(*DESCRIBE)
    assert parameters_offered("/arm", robot) == locked("parameter_node_unavailable", node="/arm")
    trigger = "std_srvs/srv/Trigger"
    serve(SET[0], trigger)
    verdict = parameters_offered("/arm", robot)
    assert verdict == locked("topic_wrong_type", topic=f"/arm/{SET[0]}", found=trigger, wanted=SET[1])
    serve(SET[0], trigger, alive=False)
    serve(*SET)
    assert parameters_offered("/arm", robot) is None
    robot.nodes_are_read = True
    assert parameters_offered("/arm", robot) == locked("service_connecting", name=f"/arm/{GET[0]}")
