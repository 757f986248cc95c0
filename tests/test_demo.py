"""The demo robot, stepped by hand."""

from types import SimpleNamespace

from app.demo import COUNT_STEP_S, FORBIDDEN_S, LONGEST_COUNT, PERMITTED_S, REPEAT_S, DemoRobot


def test_it_permits_and_forbids_in_turns_and_says_so_once_a_second() -> None:
    robot = DemoRobot()
    assert robot.step(100.0) == [("/operation_enabled", {"data": True})]
    assert robot.step(100.0 + REPEAT_S / 2) == []
    assert robot.step(100.0 + REPEAT_S) == [("/operation_enabled", {"data": True})]
    assert robot.step(100.0 + PERMITTED_S) == [("/operation_enabled", {"data": False})]
    assert robot.step(100.0 + PERMITTED_S + FORBIDDEN_S) == [("/operation_enabled", {"data": True})]


def test_it_echoes_what_it_heard_once() -> None:
    robot = DemoRobot()
    robot.hear("/operation1", "hello")
    assert ("/last_heard", {"data": "hello (/operation1)"}) in robot.step(0.0)
    assert robot.step(0.1) == []


def test_its_services_answer_and_refuse_with_words() -> None:
    robot = DemoRobot()
    robot.step(0.0)
    assert robot.serve("/light", SimpleNamespace(data=True))["message"] == "the light is on"
    assert robot.serve("/reset", None)["success"] is True
    robot.step(PERMITTED_S)
    refused = robot.serve("/reset", None)
    assert (refused["success"], refused["message"]) == (False, "not while operation is forbidden")


def test_a_count_goes_step_by_step_to_its_result() -> None:
    robot = DemoRobot()
    robot.step(0.0)
    assert robot.begin(b"a", 3)
    assert not robot.begin(b"a", 3)
    assert robot.result(b"a") is None
    robot.step(COUNT_STEP_S)
    assert robot.count() == [(b"a", [0, 1, 1])]
    assert robot.count() == []
    robot.step(2 * COUNT_STEP_S)
    assert robot.count() == [(b"a", [0, 1, 1, 2])]
    assert robot.result(b"a") == (4, [0, 1, 1, 2])


def test_a_count_is_canceled_rejected_and_unknown() -> None:
    robot = DemoRobot()
    robot.step(0.0)
    assert not robot.begin(b"x", 0)
    assert not robot.begin(b"x", LONGEST_COUNT + 1)
    assert robot.begin(b"a", 5)
    assert robot.cancel(b"a") == 0
    assert robot.cancel(b"a") == 3
    assert robot.cancel(b"b") == 2
    assert robot.result(b"a") == (5, [0, 1])
    assert robot.result(b"b") == (0, [])
