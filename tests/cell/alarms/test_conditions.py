"""Alarms of conditions and nodes, suppression by design, and the controls that alarms lock."""

from functools import partial
from pathlib import Path

import pytest

from app.cell.alarms.states import Override, State
from tests.cell.alarms.test_engine import Cell

DOOR = """
[[alarm]]
id = "door"
text = "Door open"
latched = true
inhibits = ["start"]
when = { topic = "/door_open" }
"""
SET_UP = 'while = { topic = "/set_up" }\n'
NODE = '[[alarm]]\nid = "driver"\ntext = "No driver"\nnode = "/driver"\n'


@pytest.fixture
def cell(tmp_path: Path) -> partial[Cell]:
    return partial(Cell, tmp_path)


def test_a_condition_raises_while_it_is_met(cell: partial[Cell]) -> None:
    door = cell(DOOR)
    door.publish_bool("/door_open", False)
    assert (door.status("door").state, door.inhibiting()) == (State.NORMAL, [])
    door.publish_bool("/door_open", True)
    assert (door.status("door").state, door.inhibiting()) == (State.UNACKNOWLEDGED, ["door"])
    door.publish_bool("/door_open", False)
    assert door.status("door").state is State.LATCHED_UNACKNOWLEDGED
    assert list(door.engine.inhibited("")) == ["start"]


def test_a_control_is_locked_until_the_alarms_source_is_known(cell: partial[Cell]) -> None:
    door = cell(DOOR)
    assert door.inhibiting() == ["door"]
    changes = door.engine.lock_changes
    door.publish_bool("/door_open", False)
    assert door.inhibiting() == []
    door.robot.mark_link_lost()
    door.engine.robot_changed("")
    door.engine.evaluate()
    assert door.inhibiting() == ["door"]
    assert door.engine.lock_changes == changes + 2


def test_a_replayed_value_raises_but_does_not_open(cell: partial[Cell]) -> None:
    door = cell(DOOR.replace('open" }', 'open", max_age_s = 5 }'))
    door.publish_bool("/door_open", False)  # of unknown age: no publisher is known to be volatile
    assert door.inhibiting() == ["door"]
    door.publish_bool("/door_open", True)
    assert door.status("door").state is State.UNACKNOWLEDGED
    door.wait_until_due()
    assert door.status("door").unknown_since is not None


def test_an_alarm_is_suppressed_by_design_and_raised_at_its_end(cell: partial[Cell]) -> None:
    door = cell(DOOR + SET_UP)
    door.publish_bool("/set_up", True)
    assert door.status("door").override is Override.SUPPRESSED
    door.publish_bool("/door_open", True)
    assert door.status("door").override is Override.SUPPRESSED
    assert door.inhibiting() == ["door"]
    door.publish_bool("/set_up", False)
    assert (door.status("door").state, door.status("door").override) == (State.UNACKNOWLEDGED, None)


def test_suppression_may_open_the_control(cell: partial[Cell]) -> None:
    door = cell(DOOR.replace("[[alarm]]", "[[alarm]]\ninhibits_when_suppressed = false") + SET_UP)
    door.publish_bool("/door_open", True)
    door.publish_bool("/set_up", True)
    assert door.inhibiting() == []


def test_a_node_that_does_not_run_raises(cell: partial[Cell]) -> None:
    driver = cell(NODE)
    assert driver.status("driver").state is State.UNACKNOWLEDGED
    driver.robot.mark_link_lost()
    driver.engine.robot_changed("")
    driver.engine.evaluate()
    assert driver.status("driver").unknown_since is not None
