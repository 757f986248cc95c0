"""How many publishers a topic has, behind one bridge or several."""

from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.publishers import MAX_NAMES, Publisher, Publishers
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    NOW,
    endpoint,
    robot_there,
    says,
    small_panel,
)

KEY = ENABLED[1:]
DOOR = Publisher(BRIDGE, "g1", ("/door",))
ARM = Publisher(BRIDGE, "g2", ("/arm",))


def test_each_writer_is_counted_once_and_a_bridge_without_dds_by_its_token() -> None:
    robot = robot_there(small_panel())
    known, graph = robot.topic_publishers, robot.graph
    assert known.of_topic(KEY, graph) == Publishers(0)
    endpoint(robot, "MP", ENABLED, BOOL)
    assert known.of_topic(KEY, graph) == Publishers(1)
    assert known.update(KEY, [DOOR])
    assert not known.update(KEY, [DOOR])
    assert known.of_topic(KEY, graph) == Publishers(1, ("/door",))
    graph.apply_token("@/b2/@ros2_lv", True)
    known.update(KEY, [DOOR, DOOR._replace(peer="b2"), ARM])
    assert known.of_topic(KEY, graph) == Publishers(2, ("/arm", "/door"))
    endpoint(robot, "MP", ENABLED, BOOL, "b3")
    graph.apply_token("@/b3/@ros2_lv", True)
    assert known.of_topic(KEY, graph).number == 3
    graph.apply_token(f"@/{BRIDGE}/@ros2_lv", False)
    assert known.of_topic(KEY, graph) == Publishers(2, ("/door",))


def test_of_many_nodes_some_are_named() -> None:
    many = Publishers(9, tuple(f"/n{number}" for number in range(9)))
    assert str(many.sentence("/a")) == "/a is published by /n0, /n1, /n2, /n3 and 5 more."
    assert MAX_NAMES == 4
    assert Publishers(2).sentence("/a") == ""


def test_a_second_publisher_locks_where_one_is_allowed_and_else_is_named_in_the_lock() -> None:
    for publishers, codes in (
        ("one", ["permitted", "interlock_several_publishers"]),
        ("any", ["permitted"] * 2),
    ):
        panel = small_panel({"publishers": publishers})
        robot, (interlock,) = robot_there(panel), panel.interlocks
        endpoint(robot, "MP", ENABLED, BOOL)
        says(robot, ENABLED, True, BOOL)
        verdict_codes = []
        for known in ([DOOR], [DOOR, ARM]):
            robot.topic_publishers.update(KEY, known)
            verdict_codes.append(interlock_verdict(interlock, robot, NOW).code)
        assert verdict_codes == codes
        says(robot, ENABLED, False, BOOL)
        reason = str(interlock_verdict(interlock, robot, NOW).reason)
        assert reason.endswith("/operation_enabled is published by /arm, /door.")


def test_without_a_link_nothing_is_known() -> None:
    robot = robot_there(small_panel({"publishers": "one"}))
    robot.topic_publishers.update(KEY, [DOOR, ARM])
    robot.mark_link_lost()
    assert robot.topic_publishers.of_topic(KEY, robot.graph) == Publishers(0)
