"""Whether the robot's definitions are the panel's, by the hashes of its tokens and nodes."""

import dataclasses
from typing import Any

import pytest

from app.cell.permission.interlocks import interlock_verdict
from app.cell.permission.verdict import Verdict, call_blocked, locked, topic_mismatch
from app.cell.robot.definitions import is_unhashed, timeout_hint
from app.cell.robot.state import RobotState
from app.cell.view.link_status import definition_notes
from app.ros.dialects.bridge_dialect import bridge_token, server_token, token
from app.ros.dialects.dialect import Endpoint, Role
from app.ros.messages.names import Qos
from app.system.texts import joined, say
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    FREE,
    GUARDED,
    HEARD,
    INTERFACES,
    MESSAGE,
    NOW,
    TEXT,
    panel_of,
    permits,
    robot_there,
    says,
)

SET_BOOL = "std_srvs/srv/SetBool"
REQUEST, RESPONSE = f"{SET_BOOL}_Request", f"{SET_BOOL}_Response"
CALL = {"id": "set", "kind": "call", "label": "Set", "service": "/set", "type": SET_BOOL}
PANEL = panel_of(MESSAGE, FREE, GUARDED, HEARD, CALL)
OTHER = f"RIHS01_{'0' * 64}"
SAME = {name: INTERFACES.type_hash(name) for name in (BOOL, TEXT, REQUEST, RESPONSE)}


@pytest.fixture
def robot() -> RobotState:
    return robot_there(PANEL)


def announce(robot: RobotState, topic: str, type_name: str, type_hash: str, at: float = NOW) -> None:
    """A publisher's token appears."""
    made = token(BRIDGE, "MP", robot.key(topic), type_name, Qos(), type_hash)
    robot.graph.apply_token(made, True, at)


def read(robot: RobotState, *nodes: Endpoint, at: float = NOW + 1) -> None:
    """The nodes are read from the admin space."""
    robot.graph.update_routes((), nodes, at)


def publisher(topic: str, type_name: str, type_hash: str, **more: Any) -> Endpoint:
    hashes = ((type_name, type_hash),) if type_hash else ()
    return Endpoint(BRIDGE, "MP", topic[1:], type_name, reliable=True, hashes=hashes, **more)


def server(**hashes: str) -> Endpoint:
    known = SAME | hashes
    pairs = tuple((name, known[name]) for name in (REQUEST, RESPONSE))
    return Endpoint(BRIDGE, "SS", "set", SET_BOOL, hashes=pairs, node="/plc", dds="Cyclone DDS")


def serve(robot: RobotState, at: float = NOW) -> None:
    robot.graph.apply_token(server_token(BRIDGE, "SS", "set", SET_BOOL), True, at)


def blocked(robot: RobotState) -> Verdict | None:
    call: Any = next(w for w in PANEL.widgets() if w.id == "set")
    return call_blocked(call, robot, NOW + 5)


def test_the_hash_of_a_token_is_compared(robot: RobotState) -> None:
    announce(robot, ENABLED, BOOL, SAME[BOOL])
    permits(robot)
    assert interlock_verdict(PANEL.interlocks[0], robot, NOW).permitted
    announce(robot, ENABLED, BOOL, OTHER)
    verdict = interlock_verdict(PANEL.interlocks[0], robot, NOW)
    assert verdict == locked("topic_definition_differs", name=ENABLED, type=BOOL)


def test_values_of_another_definition_are_never_decoded(robot: RobotState) -> None:
    says(robot, "/heard", "before the token")
    announce(robot, "/heard", TEXT, OTHER)
    robot.update_publishers()
    says(robot, "/heard", "after the token", seq=2)
    assert robot.reading("/heard").status == "waiting"
    robot.graph.apply_token(token(BRIDGE, "MP", "heard", TEXT, Qos(), OTHER), False)
    assert robot.reading("/heard").status == "waiting"
    says(robot, "/heard", "of the panel's definition", seq=3)
    assert robot.reading("/heard").value("data") == "of the panel's definition"


def test_a_publisher_without_a_token_counts_when_the_nodes_are_read(robot: RobotState) -> None:
    announce(robot, "/heard", TEXT, SAME[TEXT])
    first = publisher("/heard", TEXT, SAME[TEXT], node="/first")
    read(robot, first, publisher("/heard", TEXT, OTHER, node="/second"))
    difference = robot.difference("MP", "heard")
    assert difference is not None
    assert (difference.node, difference.theirs, difference.ours) == ("/second", OTHER, SAME[TEXT])
    read(robot, first)
    assert robot.difference("MP", "heard") is None


def test_a_token_of_a_publisher_that_ended_does_not_count_once_the_nodes_are_read(
    robot: RobotState,
) -> None:
    announce(robot, "/heard", TEXT, OTHER)
    read(robot, publisher("/heard", TEXT, SAME[TEXT]), at=NOW - 1)  # before the token
    assert robot.difference("MP", "heard") is not None
    read(robot, publisher("/heard", TEXT, SAME[TEXT]))
    assert robot.difference("MP", "heard") is None


@pytest.mark.parametrize("theirs", ["", "RIHS02_" + "0" * 64])
def test_without_a_hash_that_can_be_compared_nothing_locks(robot: RobotState, theirs: str) -> None:
    announce(robot, "/heard", TEXT, theirs)
    heard: Any = next(w for w in PANEL.widgets() if w.id == "heard")
    assert topic_mismatch("MS", heard, robot) is None


def test_details_name_hashes_and_types_that_cannot_be_compared(robot: RobotState) -> None:
    announce(robot, ENABLED, BOOL, "")
    announce(robot, "/heard", TEXT, OTHER)
    assert is_unhashed(robot.graph, "MP", robot.key(ENABLED))
    hashes = say(
        "link_definition_hashes",
        name="/heard",
        type=TEXT,
        node=say("link_definition_node_unknown"),
        theirs=OTHER,
        ours=SAME[TEXT],
        source="ROS 2 jazzy",
    )
    unhashed = say("link_no_hashes", names=(ENABLED,))
    assert definition_notes(robot) == joined([hashes, unhashed], "between_lines")


@pytest.mark.parametrize("part", [REQUEST, RESPONSE])
def test_a_server_of_another_definition_is_not_called(robot: RobotState, part: str) -> None:
    serve(robot)
    read(robot, server())
    assert blocked(robot) is None
    read(robot, server(**{part: OTHER}))
    assert blocked(robot) == locked("topic_definition_differs", name="/set", type=part)


def test_a_server_on_fast_dds_is_not_called(robot: RobotState) -> None:
    serve(robot)
    read(robot, server(), dataclasses.replace(server(), dds="Fast DDS"))
    assert blocked(robot) == locked("service_wrong_rmw", name="/set", vendor="Fast DDS")


def test_a_new_server_is_not_called_before_its_node_is_known(robot: RobotState) -> None:
    robot.nodes_are_read = True
    serve(robot)
    read(robot, server(), at=NOW - 1)
    assert blocked(robot) == locked("service_connecting", name="/set")
    read(robot, server())
    assert blocked(robot) is None


@pytest.mark.parametrize("role", ["MP", "MS"])
def test_another_bridges_token_is_no_difference(robot: RobotState, role: Role) -> None:
    robot.graph.apply_token(bridge_token("c2"), False)
    robot.graph.apply_token(token("c2", "MS", "heard", TEXT, Qos(), OTHER), True)
    assert robot.difference(role, "heard") is None


@pytest.mark.parametrize(
    ("dds", "hint"), [("Cyclone DDS", ""), ("", "cyclone"), ("Fast DDS", "cyclone"), (None, "cyclone")]
)
def test_a_server_on_cyclone_dds_times_out_for_another_cause(dds: str | None, hint: str) -> None:
    robot = robot_there(PANEL)
    if dds is not None:
        read(robot, dataclasses.replace(server(), dds=dds))
    assert timeout_hint(robot.graph, "SS", "set", "cyclone") == hint
