"""Services, actions, parameters and topics of a robot on Cyclone DDS, through the real bridge."""

import time
import uuid
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy
import pytest
import zenoh.ext

from tests.support import cyclone
from tests.support.cyclone import (
    GRAPH,
    NODE,
    TYPES,
    Client,
    CycloneRobot,
    encoded,
    errors,
    payloads,
    response,
)
from tests.support.parts import ENOUGH_S, Bridge, until

pytestmark = pytest.mark.promise("dialects")

Robots = Callable[..., CycloneRobot]

SET_BOOL = "std_srvs/srv/SetBool"
TRIGGER = "std_srvs/srv/Trigger"
ADD = "example_interfaces/srv/AddTwoInts"
STRING = "std_msgs/msg/String"
BOOL = "std_msgs/msg/Bool"

SLOW_S = 4  # longer than another answer takes

EMPTY_REQUEST = bytes.fromhex("00010000 00")

ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(1, 7)


def heard(robot: CycloneRobot, *topics: str) -> None:
    """Waits until the bridge listens to the robot's topics: it does so for who subscribes only."""
    for topic in topics:
        until(partial(robot.subscribers, topic=topic), f"the bridge listens to {topic}")


# Services.


def test_the_bridge_announces_each_service_and_the_action_with_its_type(
    robot: CycloneRobot, client: Client
) -> None:
    event_type = "rcl_interfaces/msg/ParameterEvent"
    hash_ = TYPES.hash_rihs01(event_type)
    event = f"MP/parameter_events/{event_type}/:1::0,1000:typehash={hash_};"
    until(lambda: len(set(client.tokens())) > len(GRAPH), "all its tokens")
    assert set(client.tokens()) == GRAPH | {event}


def test_a_request_and_its_reply_byte_by_byte(robot: CycloneRobot, client: Client) -> None:
    robot.answer_set_enabled(success=False, message="no")
    replies = client.get("set_enabled", bytes.fromhex("00010000 01"))
    # false, aligned length of 3, "no" and its end; then padding to 4 bytes.
    assert payloads(replies) == [bytes.fromhex("00010000 00000000 03000000 6e6f0000")]
    assert robot.requests("/set_enabled") == [{"data": True}]


def test_set_bool_says_yes_or_no_with_words(robot: CycloneRobot, client: Client) -> None:
    yes = client.call("set_enabled", SET_BOOL, True)
    robot.answer_set_enabled(success=False, message="the door is open")
    no = client.call("set_enabled", SET_BOOL, False)
    assert (yes.success, yes.message) == (True, "")
    assert (no.success, no.message) == (False, "the door is open")
    assert robot.requests("/set_enabled") == [{"data": True}, {"data": False}]


def test_trigger_and_its_dummy_byte(robot: CycloneRobot, client: Client) -> None:
    assert encoded(f"{TRIGGER}_Request") == EMPTY_REQUEST
    reset = client.call("reset", TRIGGER)
    assert (reset.success, reset.message) == (True, "reset")
    assert robot.requests("/reset") == [{}]


def test_calls_under_way_get_each_its_own_reply(robot: CycloneRobot, client: Client) -> None:
    # Ten at most: the bridge's writer of requests keeps no more.
    numbers = [*range(8), 2**62, -(2**63)]
    answers = [client.ask("add_two_ints", encoded(f"{ADD}_Request", n, 1)) for n in numbers]
    assert [response(ADD, replies).sum for replies in answers] == [n + 1 for n in numbers]
    assert [r["a"] for r in robot.requests("/add_two_ints")] == numbers


def test_a_slow_answer_comes_late_and_delays_no_other(robot: CycloneRobot, client: Client) -> None:
    robot.answer_slow(seconds=SLOW_S)
    sent_at = time.monotonic()
    slow = client.ask("slow", EMPTY_REQUEST, ENOUGH_S)
    client.call("reset", TRIGGER)
    assert time.monotonic() - sent_at < SLOW_S
    assert response(TRIGGER, slow).message == "done"
    assert time.monotonic() - sent_at >= SLOW_S


def test_no_answer_is_a_timeout_and_no_server_is_nothing_at_once(
    robot: CycloneRobot, client: Client
) -> None:
    robot.answer_slow(seconds=None)
    assert errors(client.get("slow", EMPTY_REQUEST, timeout_s=0.5)) == {"Timeout"}
    until(lambda: robot.requests("/slow"), "it came")
    assert robot.requests("/slow") == [{}]
    sent_at = time.monotonic()
    assert client.get("nowhere", EMPTY_REQUEST, ENOUGH_S) == []
    assert time.monotonic() - sent_at < ENOUGH_S / 2


def test_a_big_endian_request_is_executed_and_its_reply_lost(
    robot: CycloneRobot, client: Client
) -> None:
    request = bytes.fromhex("00000000 0000000000000001 0000000000000002")
    assert errors(client.get("add_two_ints", request, timeout_s=0.5)) == {"Timeout"}
    until(lambda: robot.requests("/add_two_ints"), "it came")
    assert robot.requests("/add_two_ints") == [{"a": 1, "b": 2}]


# The action.


class Goals:
    """The action's three services, as a client of it calls them."""

    NAME = "fibonacci/_action"
    TYPE = "example_interfaces/action/Fibonacci"

    def __init__(self, client: Client) -> None:
        self._client = client

    def send(self, order: int, goal: bytes = b"") -> tuple[bytes, Any]:
        goal = goal or uuid.uuid4().bytes
        fields = TYPES.types[f"{self.TYPE}_Goal"](order)
        answer = self._client.call(
            f"{self.NAME}/send_goal", f"{self.TYPE}_SendGoal", goal_id(goal), fields
        )
        return goal, answer

    def sent(self, order: int) -> bytes:
        goal, answer = self.send(order)
        assert answer.accepted
        return goal

    def result(self, goal: bytes, timeout_s: float = 5) -> tuple[int, list[int]]:
        answer = self._client.call(
            f"{self.NAME}/get_result", f"{self.TYPE}_GetResult", goal_id(goal), timeout_s=timeout_s
        )
        return answer.status, answer.result.sequence.tolist()

    def cancel(self, goal: bytes) -> tuple[int, list[bytes]]:
        """The return code, and the goals that will be canceled."""
        info = TYPES.types["action_msgs/msg/GoalInfo"](goal_id(goal), no_time())
        answer = self._client.call(f"{self.NAME}/cancel_goal", "action_msgs/srv/CancelGoal", info)
        return answer.return_code, [i.goal_id.uuid.tobytes() for i in answer.goals_canceling]


def goal_id(goal: bytes) -> Any:
    return TYPES.types["unique_identifier_msgs/msg/UUID"](numpy.frombuffer(goal, numpy.uint8))


def no_time() -> Any:
    return TYPES.types["builtin_interfaces/msg/Time"](0, 0)


def statuses(heard: list[Any], goal: bytes) -> list[int]:
    """Through which statuses a goal went, by the messages on the status topic."""
    went_through: list[int] = []
    for message in heard:
        for status in message.status_list:
            if (
                status.goal_info.goal_id.uuid.tobytes() == goal
                and status.status not in went_through[-1:]
            ):
                went_through.append(status.status)
    return went_through


def went(went_through: list[int], *states: int) -> bool:
    """Whether a goal went through these, to the last one: a topic that keeps one message only may leave
    out those that did not last, as EXECUTING does."""
    in_order = went_through == [state for state in states if state in went_through]
    return in_order and EXECUTING in went_through and went_through[-1] == states[-1]


def test_a_goal_from_its_acceptance_to_its_result(robot: CycloneRobot, client: Client) -> None:
    goals = Goals(client)
    with (
        client.hearing("fibonacci/_action/feedback", f"{Goals.TYPE}_FeedbackMessage") as feedback,
        client.hearing("fibonacci/_action/status", "action_msgs/msg/GoalStatusArray") as status,
    ):
        heard(robot, "/fibonacci/_action/feedback", "/fibonacci/_action/status")
        goal = goals.sent(order=5)
        assert goals.result(goal) == (SUCCEEDED, [0, 1, 1, 2, 3, 5])
        until(lambda: statuses(status, goal)[-1:] == [SUCCEEDED], "its end is published")
        until(lambda: len(feedback) >= 4, "all feedback has come: on another topic than its end")
    assert went(statuses(status, goal), ACCEPTED, EXECUTING, SUCCEEDED)
    sequences = [message.feedback.sequence.tolist() for message in feedback]
    assert sequences == [[0, 1, 1], [0, 1, 1, 2], [0, 1, 1, 2, 3], [0, 1, 1, 2, 3, 5]]
    assert {message.goal_id.uuid.tobytes() for message in feedback} == {goal}


def test_several_goals_run_at_once(robot: CycloneRobot, client: Client) -> None:
    goals = Goals(client)
    robot.fibonacci(step_s=60)
    ids = [goals.sent(order) for order in (3, 4, 5)]
    until(lambda: {goal["status"] for goal in robot.goals()} == {EXECUTING}, "all three run")
    robot.fibonacci(step_s=0.01)
    ends = [goals.result(goal) for goal in reversed(ids)]
    assert ends == [
        (SUCCEEDED, [0, 1, 1, 2, 3, 5]),
        (SUCCEEDED, [0, 1, 1, 2, 3]),
        (SUCCEEDED, [0, 1, 1, 2]),
    ]


def test_a_goal_is_rejected_and_so_is_an_id_twice(robot: CycloneRobot, client: Client) -> None:
    goals = Goals(client)
    rejected, answer = goals.send(order=-1)
    assert not answer.accepted
    assert goals.result(rejected) == (0, [])
    goal = goals.sent(order=2)
    _, again = goals.send(2, goal)
    assert not again.accepted


def test_the_client_cancels_a_goal(robot: CycloneRobot, client: Client) -> None:
    goals = Goals(client)
    robot.fibonacci(step_s=60)
    with client.hearing("fibonacci/_action/status", "action_msgs/msg/GoalStatusArray") as status:
        heard(robot, "/fibonacci/_action/status")
        goal, other = goals.sent(order=5), goals.sent(order=5)
        assert goals.cancel(goal) == (0, [goal])
        assert goals.result(goal) == (CANCELED, [0, 1])
        until(lambda: statuses(status, goal)[-1:] == [CANCELED], "its end is published")
    assert went(statuses(status, goal), ACCEPTED, EXECUTING, CANCELING, CANCELED)
    assert {g["id"]: g["status"] for g in robot.goals()} == {
        goal.hex(): CANCELED,
        other.hex(): EXECUTING,
    }


def test_cancel_is_refused_unknown_or_too_late_and_a_general_cancel_ends_all(
    robot: CycloneRobot, client: Client
) -> None:
    goals = Goals(client)
    robot.fibonacci(step_s=60, refuse_cancels="rclcpp")
    first, second = goals.sent(order=5), goals.sent(order=5)
    assert goals.cancel(first) == (1, [])
    robot.fibonacci(refuse_cancels="rclpy")
    assert goals.cancel(first) == (0, [])
    assert goals.cancel(uuid.uuid4().bytes) == (2, [])
    robot.fibonacci(refuse_cancels="")
    assert goals.cancel(bytes(16)) == (0, [first, second])
    assert goals.result(first)[0] == goals.result(second)[0] == CANCELED
    assert goals.cancel(first) == (3, [])


def test_the_robot_itself_aborts_one_goal_and_cancels_another(
    robot: CycloneRobot, client: Client
) -> None:
    goals = Goals(client)
    robot.fibonacci(step_s=60)
    first, second = goals.sent(order=5), goals.sent(order=5)
    assert robot.abort(goal=first.hex()) == 1
    assert goals.result(first) == (ABORTED, [0, 1])
    assert robot.cancel() == 1
    assert goals.result(second) == (CANCELED, [0, 1])
    assert robot.requests("/fibonacci/_action/cancel_goal") == []


def test_a_result_after_more_than_five_seconds(robot: CycloneRobot, client: Client) -> None:
    goals = Goals(client)
    robot.fibonacci(step_s=5.5)
    sent_at = time.monotonic()
    goal = goals.sent(order=2)
    request = encoded(f"{Goals.TYPE}_GetResult_Request", goal_id(goal))
    impatient = client.get("fibonacci/_action/get_result", request, timeout_s=0.5)
    assert errors(impatient) == {"Timeout"}
    assert goals.result(goal, timeout_s=20) == (SUCCEEDED, [0, 1, 1])
    assert time.monotonic() - sent_at > 5


def test_old_results_are_discarded(robot: CycloneRobot, client: Client) -> None:
    goals = Goals(client)
    goal = goals.sent(order=1)
    assert goals.result(goal) == (SUCCEEDED, [0, 1])
    robot.fibonacci(keep_s=0)
    assert goals.result(goal) == (0, [])


def test_late_listener_gets_the_last_status(robot: CycloneRobot, client: Client) -> None:
    goal = Goals(client).sent(order=1)
    Goals(client).result(goal)
    heard: list[Any] = []
    subscriber = zenoh.ext.declare_advanced_subscriber(
        client.session,
        "fibonacci/_action/status",
        lambda sample: heard.append(
            cyclone.decoded("action_msgs/msg/GoalStatusArray", sample.payload.to_bytes())
        ),
        history=zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1),
    )
    until(lambda: statuses(heard, goal)[-1:] == [SUCCEEDED], "the last status comes")
    subscriber.undeclare()


# Parameters.


def parameters(client: Client, service: str, *fields: Any) -> Any:
    name = "".join(word.capitalize() for word in service.split("_"))
    return client.call(f"{NODE}/{service}", f"rcl_interfaces/srv/{name}", *fields)


def parameter(name: str, value: Any) -> Any:
    kinds = {bool: (1, "bool_value"), int: (2, "integer_value"), float: (3, "double_value")}
    kind, field = kinds.get(type(value), (4, "string_value"))
    empty = {
        "type": kind,
        "bool_value": False,
        "integer_value": 0,
        "double_value": 0.0,
        "string_value": "",
        "byte_array_value": numpy.array([], numpy.uint8),
        "bool_array_value": numpy.array([], numpy.bool_),
        "integer_array_value": numpy.array([], numpy.int64),
        "double_array_value": numpy.array([], numpy.float64),
        "string_array_value": [],
    }
    wire = TYPES.types["rcl_interfaces/msg/ParameterValue"](**{**empty, field: value})
    return TYPES.types["rcl_interfaces/msg/Parameter"](name, wire)


def set_one(client: Client, name: str, value: Any) -> tuple[bool, str]:
    (result,) = parameters(client, "set_parameters", [parameter(name, value)]).results
    return result.successful, result.reason


def test_parameters_are_listed_typed_and_described(robot: CycloneRobot, client: Client) -> None:
    names = ["speed", "name", "enabled", "limit", "serial"]
    assert parameters(client, "list_parameters", [], 0).result.names == list(robot.parameters())
    assert parameters(client, "get_parameter_types", names).types.tolist() == [3, 4, 1, 2, 4]
    described = parameters(client, "describe_parameters", names).descriptors
    assert [(d.name, d.type, d.read_only) for d in described] == [
        ("speed", 3, False),
        ("name", 4, False),
        ("enabled", 1, False),
        ("limit", 2, False),
        ("serial", 4, True),
    ]
    (speed,) = described[0].floating_point_range
    (limit,) = described[3].integer_range
    assert (speed.from_value, speed.to_value, speed.step) == (0.0, 2.0, 0.1)
    assert (limit.from_value, limit.to_value, limit.step) == (0, 100, 0)


def test_parameters_are_read_all_or_none(robot: CycloneRobot, client: Client) -> None:
    speed, serial = parameters(client, "get_parameters", ["speed", "serial"]).values
    assert (speed.type, speed.double_value) == (3, 0.5)
    assert (serial.type, serial.string_value) == (4, "CR-0001")
    assert parameters(client, "get_parameters", ["speed", "nothing"]).values == []


def test_a_parameter_is_set_and_the_change_is_published(robot: CycloneRobot, client: Client) -> None:
    with client.hearing("parameter_events", "rcl_interfaces/msg/ParameterEvent") as events:
        heard(robot, "/parameter_events")
        assert set_one(client, "speed", 1.3) == (True, "")
        assert set_one(client, "name", "zoë") == (True, "")
        assert set_one(client, "enabled", False) == (True, "")
        assert set_one(client, "limit", 100) == (True, "")
        robot.set_parameter(name="serial", value="CR-0002")
        until(lambda: len(events) >= 5, "each change is published")
    assert {
        name: robot.parameters()[name] for name in ("speed", "name", "enabled", "limit", "serial")
    } == {
        "speed": 1.3,
        "name": "zoë",
        "enabled": False,
        "limit": 100,
        "serial": "CR-0002",
    }
    assert len(events) == 5
    assert {event.node for event in events} == {f"/{NODE}"}
    changed = [event.changed_parameters[0] for event in events]
    assert [c.name for c in changed] == ["speed", "name", "enabled", "limit", "serial"]
    assert changed[0].value.double_value == 1.3


def test_a_refused_parameter_comes_with_its_reason(robot: CycloneRobot, client: Client) -> None:
    before = robot.parameters()
    refused = {
        ("speed", 2.1): "parameter 'speed' is out of range 0.0 to 2.0",
        ("speed", 0.55): "parameter 'speed' is not on a step of 0.1",
        ("speed", "fast"): "parameter 'speed' is of type double, not string",
        ("limit", -1): "parameter 'limit' is out of range 0 to 100",
        ("serial", "mine"): "parameter 'serial' is read-only",
        ("nothing", True): "parameter 'nothing' was not declared",
    }
    assert {setting: set_one(client, *setting) for setting in refused} == {
        setting: (False, reason) for setting, reason in refused.items()
    }
    assert robot.parameters() == before


# Topics.


def test_topics_go_both_ways_with_their_type_hashes(robot: CycloneRobot, client: Client) -> None:
    robot.advertise(topic="/words", type=STRING)
    robot.subscribe(topic="/lamp", type=BOOL)
    published = f"MP/words/{STRING}/:1::0,10:typehash={TYPES.hash_rihs01(STRING)};"
    subscribed = f"MS/lamp/{BOOL}/:1::0,10:typehash={TYPES.hash_rihs01(BOOL)};"
    until(lambda: {published, subscribed} <= set(client.tokens()), "the topics are announced")
    with client.hearing("words", STRING) as words:
        heard(robot, "/words")
        robot.publish(topic="/words", fields={"data": "grüezi"})
        until(lambda: words, "the words come")
    assert [word.data for word in words] == ["grüezi"]
    until(lambda: robot.publishers(topic="/lamp"), "the bridge speaks to the lamp")
    client.session.put("lamp", encoded(BOOL, True))
    until(lambda: robot.heard(topic="/lamp"), "the lamp hears")
    assert robot.heard(topic="/lamp") == [{"data": True}]


# What happens when a part breaks.

LEASE_S = 6.0


def test_a_killed_robot_times_out_until_its_lease_ends_and_comes_back(
    cyclone_robots: Robots, cyclone_bridge: Bridge, client: Client
) -> None:
    robot = cyclone_robots(cyclone_bridge.domain, lease_s=LEASE_S)
    cyclone.served(robot, client)
    robot.kill()
    assert errors(client.get("reset", EMPTY_REQUEST, timeout_s=0.3)) == {"Timeout"}
    assert set(client.tokens()) >= GRAPH
    until(lambda: not client.tokens(), "its lease ends")
    assert client.get("reset", EMPTY_REQUEST) == []
    robot.start()
    cyclone.served(robot, client)
    assert client.call("reset", TRIGGER).success
    assert robot.requests("/reset") == [{}]
    robot.end()
    until(lambda: not client.tokens(), "its leave is announced", within_s=LEASE_S / 2)


def test_a_robot_killed_and_started_at_once_is_lost_when_the_old_lease_ends(
    cyclone_robots: Robots, cyclone_bridge: Bridge, client: Client
) -> None:
    """A fault of the bridge's: the panel has to say so, and a start after a leave helps."""
    robot = cyclone_robots(cyclone_bridge.domain, lease_s=LEASE_S)
    cyclone.served(robot, client)
    robot.kill()
    robot.start()
    until(lambda: not client.tokens(), "the bridge loses it")
    assert client.get("reset", EMPTY_REQUEST) == []
    assert robot.calls() == []
    robot.end()
    robot.start()
    cyclone.served(robot, client)
    assert client.call("reset", TRIGGER).success


def test_a_robot_that_left_and_came_back_at_once_is_served(robot: CycloneRobot, client: Client) -> None:
    robot.end()
    robot.start()
    cyclone.served(robot, client)
    assert client.call("reset", TRIGGER).success


def test_without_a_token_of_the_client_a_second_life_brings_each_message_twice(
    cyclone_robots: Robots, own_cyclone_bridge: Bridge, own_client: Client
) -> None:
    """Another fault of the bridge's, which `Client.join` keeps away from the other tests."""
    client, copies = own_client, []
    for life in (1, 2):
        robot = cyclone_robots(own_cyclone_bridge.domain)
        cyclone.served(robot, client)
        with client.hearing("parameter_events", "rcl_interfaces/msg/ParameterEvent") as events:
            heard(robot, "/parameter_events")
            robot.set_parameter(name="limit", value=1)
            robot.set_parameter(name="limit", value=2)
            until(partial(came, events, times=life), "both come")
            copies.append(limits(events).count(1))
        robot.end()
        until(lambda: not client.tokens(), "its leave is announced")
    assert copies == [1, 2]


def came(events: list[Any], times: int) -> bool:
    return limits(events).count(1) >= times and limits(events).count(2) >= times


def limits(events: list[Any]) -> list[int]:
    return [event.changed_parameters[0].value.integer_value for event in events]


def test_the_robot_is_found_by_a_bridge_that_comes_back(
    cyclone_robots: Robots, own_cyclone_bridge: Bridge, own_client: Client
) -> None:
    robot, client = cyclone_robots(own_cyclone_bridge.domain), own_client
    cyclone.served(robot, client)
    own_cyclone_bridge.kill()
    until(lambda: not client.tokens(), "the bridge is gone")
    own_cyclone_bridge.start()
    cyclone.served(robot, client)
    assert client.call("reset", TRIGGER).success
