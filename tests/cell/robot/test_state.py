"""The latest sample per topic: waiting, a message, unreadable, or from before a cut."""

import logging
from typing import Final

import pytest

from app.cell.robot.state import RobotState, Sample
from app.cell.robot.traffic import LOG_EVERY_S
from app.panel.model import RobotEntry
from app.ros.dialects import bridge_dialect
from app.ros.dialects.bridge_dialect import bridge_token, token
from app.ros.messages.names import Qos
from tests.support.builders import (
    BOOL,
    BRIDGE,
    DIALECT,
    ENABLED,
    HEARD,
    INTERFACES,
    KIOSK,
    NOW,
    TEXT,
    TRAITS,
    panel_of,
    robot_there,
    says,
    small_panel,
)


class Counted:
    """A payload that counts how often its bytes are asked for."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.reads = 0

    def __bytes__(self) -> bytes:
        self.reads += 1
        return self.data

    def __len__(self) -> int:
        return len(self.data)


@pytest.fixture
def robot() -> RobotState:
    return robot_there(small_panel())


def broken(robot: RobotState, topic: str = "/heard", *, at: float = 1.0, seq: int = 1) -> None:
    robot.update(robot.key(topic), Sample(b"broken", seq, at, at, BRIDGE))


def test_a_topic_that_was_not_heard_is_waited_for(robot: RobotState) -> None:
    assert robot.reading("/heard").status == "waiting"


def test_a_sample_is_read_with_its_time(robot: RobotState) -> None:
    says(robot, "/heard", "hello", at=7.0)
    reading = robot.reading("/heard")
    assert (reading.status, reading.value("data")) == ("message", "hello")
    assert (reading.at, reading.wall) == (7.0, 7.0)


def test_a_newer_sample_takes_the_place_of_the_last(robot: RobotState) -> None:
    says(robot, "/heard", "first")
    assert robot.reading("/heard").value("data") == "first"
    says(robot, "/heard", "second")
    assert robot.reading("/heard").value("data") == "second"


def test_topics_do_not_mix(robot: RobotState) -> None:
    says(robot, "/heard", "hello")
    assert robot.reading(ENABLED).status == "waiting"


def test_a_namespace_stands_before_every_key() -> None:
    robot = robot_there(small_panel(namespace="/robot1"))
    assert robot.key("/heard") == "robot1/heard"
    says(robot, "/heard", "hello")
    assert robot.reading("/heard").value("data") == "hello"


def test_a_sample_is_decoded_once_and_only_when_it_is_asked_for(robot: RobotState) -> None:
    payload = Counted(INTERFACES.encode(TEXT, {"data": "hello"}))
    robot.update(robot.key("/heard"), Sample(payload, 1, 0.0, 0.0, BRIDGE))
    assert payload.reads == 0
    robot.reading("/heard")
    robot.reading("/heard")
    assert payload.reads == 1


def test_bytes_that_are_no_message_are_unreadable(robot: RobotState) -> None:
    broken(robot)
    assert (robot.reading("/heard").status, robot.reading("/heard").fields) == ("unreadable", None)


def test_a_message_after_an_unreadable_one_is_read(robot: RobotState) -> None:
    broken(robot)
    robot.reading("/heard")
    says(robot, "/heard", "well")
    assert robot.reading("/heard").status == "message"


def test_unreadable_samples_are_counted_by_key(robot: RobotState) -> None:
    for _ in range(3):
        broken(robot)
        robot.reading("/heard")
        robot.reading("/heard")
    assert robot.traffic.undecodable == {"heard": 3}


def test_unreadable_samples_fill_no_log(robot: RobotState, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.ERROR, "kiosk.robot"):
        for at in (0.0, 1.0, LOG_EVERY_S - 1, LOG_EVERY_S):
            broken(robot, at=at)
            robot.reading("/heard")
    assert [r.getMessage().partition(" (")[2] for r in caplog.records] == ["1 so far)", "4 so far)"]


@pytest.mark.parametrize("source", [BRIDGE, None])
def test_a_sample_from_before_its_bridge_was_lost_is_cut(robot: RobotState, source: str | None) -> None:
    says(robot, "/heard", "old", seq=1, at=3.0, source=source)
    robot.mark_peer_lost(BRIDGE, 2)
    reading = robot.reading("/heard")
    assert (reading.status, reading.value("data"), reading.at) == ("cut", "old", 3.0)


def test_a_sample_of_another_bridge_is_not_cut(robot: RobotState) -> None:
    robot.graph.apply_token(bridge_dialect.bridge_token("b2"), True)
    says(robot, "/heard", "fresh", source="b2")
    robot.mark_peer_lost(BRIDGE, 2)
    assert robot.reading("/heard").status == "message"


OTHER: Final = "b2"
LOG: Final = {"id": "log", "kind": "log", "label": "Log"}


def robot_of_several(namespace: str) -> RobotState:
    """A robot with a namespace, whose panel has a topic of the cell, which has its own bridge."""
    panel = panel_of({**HEARD, "topic": "//cell/heard"}, LOG)
    entry = RobotEntry(id="r1", name="Robot 1", namespace=namespace)
    robot = RobotState(panel, INTERFACES, DIALECT, TRAITS, KIOSK, entry)
    for zid, robot_namespace in ((BRIDGE, namespace), (OTHER, "/cell")):
        robot.graph.apply_token(bridge_token(zid), True)
        robot.graph.update_namespaces({zid: robot_namespace})
    return robot


def test_a_topic_of_the_cell_comes_through_another_bridge() -> None:
    robot = robot_of_several("/r1")
    assert robot.graph.peers == {BRIDGE}
    says(robot, "//cell/heard", "open", source=OTHER)
    assert robot.reading("//cell/heard").status == "message"
    robot.graph.apply_token(bridge_token(OTHER), False)
    robot.mark_peer_lost(OTHER, 9)
    assert robot.reading("//cell/heard").status == "cut"


def test_a_value_that_another_zenoh_session_has_stamped_is_foreign(robot: RobotState) -> None:
    for topic, type_name in (("/heard", TEXT), (ENABLED, BOOL)):
        says(robot, topic, "x" if type_name == TEXT else True, type_name, source="stranger")
        assert robot.reading(topic).status == "foreign"


@pytest.mark.parametrize("sender", ["", "router"])
def test_what_permits_needs_a_stamp_of_the_robot(robot: RobotState, sender: str) -> None:
    """A value that is only shown does not: not every session stamps what it sends."""
    key = ENABLED[1:]
    payload = INTERFACES.encode(BOOL, {"data": True})
    robot.update(key, Sample(payload, 1, 1.0, 1.0, None, sender=sender))
    assert robot.reading(ENABLED).status == "foreign"
    robot.graph.apply_token(token("router", "MP", key, BOOL, Qos(), ""), True)
    assert (robot.reading(ENABLED).status == "message") is (sender == "router")
    robot.update("heard", Sample(b"", 1, 1.0, 1.0, None, sender=sender))
    assert robot.reading("/heard").status == "unreadable"


@pytest.mark.parametrize(
    ("bridge", "publisher", "key"),
    [
        ("/r1", None, "r1/rosout"),
        ("", None, "rosout"),
        ("", "rosout", "rosout"),
        ("", "r1/rosout", "r1/rosout"),  # of the simulated robots of a panel
    ],
)
def test_the_nodes_log_is_where_the_bridge_has_it(bridge: str, publisher: str | None, key: str) -> None:
    robot = robot_of_several("/r1")
    robot.graph.update_namespaces({BRIDGE: bridge})
    if publisher:
        name = "rcl_interfaces/msg/Log"
        robot.graph.apply_token(token(BRIDGE, "MP", publisher, name, Qos(), ""), True)
    robot.update_publishers()
    assert robot.key("/rosout") == key
    assert robot.log_lines["rosout"] is robot.log_lines["r1/rosout"]


def test_a_sample_from_after_the_loss_is_not_cut(robot: RobotState) -> None:
    says(robot, "/heard", "fresh", seq=3)
    robot.mark_peer_lost(BRIDGE, 2)
    assert robot.reading("/heard").status == "message"


def test_a_sample_after_the_cut_is_a_message_again(robot: RobotState) -> None:
    says(robot, "/heard", "old")
    robot.mark_peer_lost(BRIDGE, 2)
    says(robot, "/heard", "new", seq=3)
    assert (robot.reading("/heard").status, robot.reading("/heard").value("data")) == ("message", "new")


def test_every_topic_of_the_bridge_is_cut(robot: RobotState) -> None:
    says(robot, "/heard", "old")
    says(robot, ENABLED, True, BOOL)
    robot.mark_peer_lost(BRIDGE, 2)
    assert {robot.reading(topic).status for topic in ("/heard", ENABLED)} == {"cut"}


def test_a_cut_before_anything_was_heard_leaves_waiting(robot: RobotState) -> None:
    robot.mark_peer_lost(BRIDGE, 2)
    assert robot.reading("/heard").status == "waiting"


def test_unreadable_sample_before_the_cut_has_no_message(robot: RobotState) -> None:
    broken(robot)
    robot.mark_peer_lost(BRIDGE, 2)
    assert (robot.reading("/heard").status, robot.reading("/heard").fields) == ("cut", None)


def test_log_lines_of_several_robots_begin_with_the_robots_name(
    caplog: pytest.LogCaptureFixture,
) -> None:
    panel = small_panel()
    entry = RobotEntry(id="r1", name="Robot 1", namespace="/r1")
    robot = RobotState(panel, INTERFACES, DIALECT, TRAITS, KIOSK, entry)
    robot.update("r1/heard", Sample(b"broken", 1, NOW, NOW, BRIDGE))
    robot.reading("/heard")
    (record,) = caplog.records
    assert record.getMessage().startswith("Robot 1: /r1/heard: ")
    assert vars(record)["robot"] == "Robot 1"
