"""Alarms of a panel are raised from what its robots publish; only those that may have changed are
evaluated."""

import math
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.cell.alarms import engine, entry_room
from app.cell.alarms.engine import MAX_EVALUATED, AlarmEngine, levels_of, read_alarm
from app.cell.alarms.published import entries_of
from app.cell.alarms.sources import read_source
from app.cell.alarms.states import (
    NEVER_STEADY,
    ActResult,
    AlarmInstance,
    AlarmStatus,
    Definition,
    Moment,
    Override,
    State,
    TakenOut,
    Transition,
    acknowledge,
    remove_from_service,
    shelve,
)
from app.cell.robot.state import RobotState, Sample
from app.panel import load_panel
from tests.support.builders import BRIDGE, INTERFACES, robot_there
from tests.support.form import several
from tests.support.words import english

pytestmark = pytest.mark.promise("alarms")

START = 1000.0
PANEL = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {}
"""
AIR = """
[[alarm]]
id = "air"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air pressure low"
low = 5.0
low_low = 4.0
deadband = 0.5
priority = 2
inhibits = ["start"]
"""
DELAYED = AIR + "on_delay_s = 2.0\noff_delay_s = 3.0\n"
OLD = AIR + "max_age_s = 2.0\n"
STALE = """
[[alarm]]
id = "air_old"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "No air pressure"
stale_s = 2.0
"""
LOST = '[[alarm]]\nid = "apart"\ntext = "No connection"\nlost = "robot"\n'
HEALTH = '[[alarm]]\nid = "health"\ndiagnostics = "motor *"\nmax_age_s = 5.0\n'
FAULTS = """
[[alarm]]
id = "faults"
topic = "/faults"
type = "diagnostic_msgs/msg/DiagnosticArray"
[alarm.list]
field = "status"
code = "hardware_id"
text = "message"
level = "level"
priorities = { "2" = 1 }
"""
OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"


class Cell:
    """A robot and the alarms of a panel, with a clock that is set."""

    def __init__(self, folder: Path, alarms: str, begins: bool = True) -> None:
        path = folder / "cell.toml"
        path.write_text(PANEL + alarms)
        self.panel = load_panel(path)
        self.robot: RobotState = robot_there(self.panel)
        self.now = START
        self.transitions: list[Transition] = []
        self.removed: list[str] = []
        self.engine = AlarmEngine(
            self.panel,
            lambda: Moment(self.now, self.now),
            self.receive,
            self.remove,
        )
        self.engine.add_robot("", self.robot)
        if begins:
            self.engine.begin()
        self.engine.evaluate()

    def receive(self, transitions: Sequence[Transition]) -> None:
        self.transitions.extend(transitions)

    def remove(self, alarm_ids: Sequence[str]) -> None:
        self.removed.extend(alarm_ids)

    def publish(self, value: float, topic: str = "/air") -> None:
        payload = INTERFACES.encode("std_msgs/msg/Float64", {"data": value})
        key = self.robot.key(topic)
        self.robot.update(key, Sample(payload, 1, self.now, self.now, BRIDGE))
        self.engine.topics_changed("", [key])
        self.engine.evaluate()

    def publish_bool(self, topic: str, data: bool) -> None:
        payload = INTERFACES.encode("std_msgs/msg/Bool", {"data": data})
        key = self.robot.key(topic)
        self.robot.update(key, Sample(payload, 1, self.now, self.now, BRIDGE))
        self.engine.topics_changed("", [key])
        self.engine.evaluate()

    def publish_entries(self, alarm: str, *rows: tuple[object, ...]) -> None:
        described = next(definition for definition in self.panel.alarms if definition.id == alarm)
        if described.diagnostics:
            rows = tuple((*row, ()) for row in rows)
        self.engine.entries_received("", alarm, list(entries_of(described, rows)), self.now)
        self.engine.evaluate()

    def wait_until_due(self) -> float:
        """Lets the time pass until the next evaluation is due; returns how many seconds that took."""
        before, self.now = self.now, self.engine.due
        self.engine.evaluate()
        return self.now - before

    def status(self, alarm: str = "air") -> AlarmStatus:
        return self.engine.alarms[alarm].status

    def acknowledge(self, alarm: str, occurrence: int) -> ActResult | None:
        def apply(status: AlarmStatus, definition: Definition) -> ActResult:
            return acknowledge(status, definition.rules, occurrence)

        return self.engine.act(alarm, "acknowledge", apply, "Ann")

    def inhibiting(self) -> list[str]:
        return [alarm.definition.id for alarm in self.engine.inhibited("").get("start", ())]


@pytest.fixture
def cell(tmp_path: Path) -> partial[Cell]:
    return partial(Cell, tmp_path)


def test_a_limit_raises_and_returns_past_its_deadband(cell: partial[Cell]) -> None:
    air = cell(AIR)
    air.publish(6.0)
    assert (air.status().state, air.transitions) == (State.NORMAL, [])
    air.publish(4.9)
    assert (air.status().state, air.status().occurrence) == (State.UNACKNOWLEDGED, 1)
    air.publish(5.4)
    assert air.status().state is State.UNACKNOWLEDGED
    air.publish(5.5)
    assert air.status().state is State.RETURNED_UNACKNOWLEDGED
    assert [(t.after.state, t.value) for t in air.transitions] == [
        (State.UNACKNOWLEDGED, 4.9),
        (State.RETURNED_UNACKNOWLEDGED, 5.5),
    ]
    assert [t.seq for t in air.transitions] == [1, 2]


def test_a_second_level_escalates_the_same_alarm(cell: partial[Cell]) -> None:
    air = cell(AIR)
    air.publish(4.5)
    assert air.acknowledge("air", 1) is not None
    air.publish(3.0)
    (alarm,) = air.engine.standing()
    assert (alarm.status.state, alarm.status.occurrence) == (State.UNACKNOWLEDGED, 2)
    assert alarm.priority == 1


def test_an_acknowledgement_names_its_occurrence_and_its_actor(cell: partial[Cell]) -> None:
    air = cell(AIR)
    air.publish(4.5)
    refused = air.acknowledge("air", 0)
    assert refused is not None
    assert refused.refusal is not None
    assert refused.refusal.code == "alarm_came_again"
    assert len(air.transitions) == 1
    air.acknowledge("air", 1)
    air.acknowledge("air", 1)
    assert [(t.act, t.actor) for t in air.transitions[1:]] == [("acknowledge", "Ann")]
    assert air.acknowledge("oil", 1) is None


def test_delays_pass_without_a_message(cell: partial[Cell]) -> None:
    air = cell(DELAYED)
    air.publish(4.9)
    assert air.status().is_normal
    assert air.wait_until_due() == 2.0
    assert air.status().state is State.UNACKNOWLEDGED
    air.publish(6.0)
    assert air.wait_until_due() == 3.0
    assert air.status().state is State.RETURNED_UNACKNOWLEDGED


def test_a_dip_that_is_shorter_than_its_delay_raises_nothing(cell: partial[Cell]) -> None:
    air = cell(DELAYED)
    air.publish(4.9)
    air.now += 1.9
    air.publish(6.0)
    air.now += 10.0
    air.engine.evaluate()
    assert air.transitions == []


def test_an_old_value_is_not_known_and_the_alarm_stays(cell: partial[Cell]) -> None:
    air = cell(OLD)
    air.publish(4.5)
    assert air.wait_until_due() == 2.0
    assert (air.status().state, air.status().unknown_since) == (
        State.UNACKNOWLEDGED,
        Moment(START + 2.0, START + 2.0),
    )
    air.publish(6.0)
    assert air.status().state is State.RETURNED_UNACKNOWLEDGED


def test_messages_that_keep_a_value_fresh_need_one_timer(cell: partial[Cell]) -> None:
    air = cell(OLD)
    for _ in range(100):
        air.publish(6.0)
        air.now += 0.1
    assert len(air.engine._timers) == 1


def test_an_alarm_whose_source_is_unknown_locks_the_widgets_that_it_inhibits(
    cell: partial[Cell],
) -> None:
    air = cell(AIR)
    assert air.inhibiting() == ["air"]
    air.publish(6.0)
    assert air.inhibiting() == []
    air.publish(4.5)
    assert air.inhibiting() == ["air"]
    air.acknowledge("air", 1)
    assert air.inhibiting() == ["air"]
    air.publish(6.0)
    assert air.inhibiting() == []


def test_a_lost_link_makes_sources_unknown_and_raises_its_own_alarm(cell: partial[Cell]) -> None:
    air = cell(AIR + LOST)
    air.publish(4.5)
    air.robot.mark_link_lost()
    air.engine.robot_changed("")
    air.engine.evaluate()
    assert air.status().unknown_since is not None
    assert air.status("apart").state is State.NORMAL  # the server may be connecting
    air.wait_until_due()
    assert air.status("apart").state is State.UNACKNOWLEDGED
    assert [alarm.definition.id for alarm in air.engine.standing()] == ["air", "apart"]


def test_a_topic_that_is_silent_raises_its_alarm_at_its_time(cell: partial[Cell]) -> None:
    air = cell(STALE)
    assert air.wait_until_due() == 2.0
    assert air.status("air_old").state is State.UNACKNOWLEDGED
    air.publish(6.0)
    assert air.status("air_old").state is State.RETURNED_UNACKNOWLEDGED
    assert air.wait_until_due() == 2.0
    assert air.status("air_old").occurrence == 2


def test_a_shelf_ends_at_its_time(cell: partial[Cell]) -> None:
    air = cell(AIR)
    air.publish(4.5)
    moment = Moment(air.now, air.now)

    def apply(status: AlarmStatus, definition: Definition) -> ActResult:
        return shelve(status, definition.rules, TakenOut(moment, "Tests", "Ann", air.now + 60.0))

    air.engine.act("air", "shelve", apply, "Ann")
    air.engine.evaluate()
    assert air.status().override is Override.SHELVED
    assert air.wait_until_due() == 60.0
    assert (air.status().override, air.status().occurrence) == (None, 2)


def test_each_status_of_diagnostics_is_an_alarm(cell: partial[Cell]) -> None:
    robot = cell(HEALTH)
    rows = [(f"motor {i}", OK, "", "") for i in range(300)]
    rows[7] = ("motor 7", WARN, "Hot", "M7")
    rows[8] = ("motor 8", ERROR, "Burnt", "M8")
    robot.publish_entries("health", *rows, ("lamp", ERROR, "Dark", ""))
    first, second = robot.engine.standing()
    assert [first.definition.id, second.definition.id] == ["health:motor 8", "health:motor 7"]
    assert (first.priority, second.priority) == (2, 3)
    assert first.entry is not None
    assert english(first.text) == "motor 8: Burnt"
    rows[8] = ("motor 8", OK, "all is well", "M8")
    robot.publish_entries("health", *rows)
    assert english(first.text) == "motor 8: Burnt"  # still not acknowledged: what was, is read


def test_a_status_that_disappears_is_not_known(cell: partial[Cell]) -> None:
    robot = cell(HEALTH)
    robot.publish_entries("health", ("motor 7", WARN, "Hot", ""))
    assert robot.wait_until_due() == 5.0
    status = robot.status("health:motor 7")
    assert (status.state, status.is_standing) == (State.UNACKNOWLEDGED, True)
    assert status.unknown_since is not None
    robot.publish_entries("health", ("motor 7", OK, "", ""))
    assert robot.status("health:motor 7").state is State.RETURNED_UNACKNOWLEDGED


def test_a_list_of_active_alarms_ends_those_that_are_missing(cell: partial[Cell]) -> None:
    robot = cell(FAULTS)
    robot.publish_entries("faults", ("E1", "Axis 1 hot", WARN), ("E2", "Axis 2 broken", ERROR))
    assert [(a.definition.id, a.priority) for a in robot.engine.standing()] == [
        ("faults:E2", 1),
        ("faults:E1", 3),
    ]
    robot.publish_entries("faults", ("E2", "Axis 2 broken", ERROR))
    assert robot.status("faults:E1").state is State.RETURNED_UNACKNOWLEDGED
    assert robot.status("faults:E2").state is State.UNACKNOWLEDGED


@pytest.fixture
def little_room(monkeypatch: pytest.MonkeyPatch) -> int:
    """Room for five entries."""
    monkeypatch.setattr(entry_room, "MAX_ENTRIES", 5)
    return 5


def test_the_alarms_that_a_robot_publishes_are_bounded(cell: partial[Cell], little_room: int) -> None:
    robot = cell(HEALTH)
    robot.publish_entries("health", *((f"motor {i}", WARN, "", "") for i in range(little_room + 3)))
    assert (len(robot.engine.alarms), robot.engine.room.left_out) == (little_room, 3)
    robot.publish_entries("health", ("motor 6", OK, "", ""))
    assert robot.engine.room.left_out == 2


def test_entries_that_are_normal_again_make_room(cell: partial[Cell], little_room: int) -> None:
    robot = cell(FAULTS.replace("[alarm.list]", 'ack = "none"\n[alarm.list]'))
    for number in range(10 * little_room):
        robot.publish_entries("faults", (f"E{number}", "", WARN))
        robot.publish_entries("faults")
    assert (robot.engine.standing(), robot.engine.room.left_out) == ([], 0)
    robot.publish_entries("faults", ("E0", "", ERROR))
    assert robot.status("faults:E0").occurrence > 1  # an old screen's acknowledgement does not fit
    assert len(robot.engine.alarms) == little_room


def test_an_urgent_entry_finds_room_and_the_least_urgent_leaves(
    cell: partial[Cell], little_room: int
) -> None:
    robot = cell(FAULTS)
    rows = [(f"E{number}", "", WARN) for number in range(little_room)]
    robot.publish_entries("faults", *rows)
    robot.publish_entries("faults", *rows, ("U1", "", ERROR))
    standing = [alarm.definition.id for alarm in robot.engine.standing()]
    assert (standing[0], len(standing)) == ("faults:U1", little_room)
    assert robot.removed == ["faults:E0"]
    assert robot.engine.room.left_out == 1
    robot.publish_entries("faults", ("U1", "", ERROR))
    assert robot.engine.room.left_out == 0


def test_an_urgent_entry_finds_room_within_one_message(cell: partial[Cell], little_room: int) -> None:
    robot = cell(FAULTS)
    rows = [*((f"E{number}", "", WARN) for number in range(little_room)), ("U1", "", ERROR)]
    robot.publish_entries("faults", *rows)
    assert (robot.engine.standing()[0].definition.id, robot.engine.room.left_out) == ("faults:U1", 1)


def test_what_a_person_has_taken_out_makes_no_room(cell: partial[Cell], little_room: int) -> None:
    robot = cell(FAULTS)
    rows = [(f"E{number}", "", WARN) for number in range(little_room)]
    robot.publish_entries("faults", *rows)
    out = TakenOut(robot.engine.now(), "Tests", "Ann")

    def apply(status: AlarmStatus, _: Definition) -> ActResult:
        return remove_from_service(status, out)

    for number in range(little_room):
        robot.engine.act(f"faults:E{number}", "out_of_service", apply, "Ann")
    robot.publish_entries("faults", *rows, ("U1", "", ERROR))
    assert (robot.removed, robot.engine.room.left_out) == ([], 1)


def test_entries_of_a_message_that_are_not_read_are_counted(cell: partial[Cell]) -> None:
    robot = cell(FAULTS)
    entries = list(entries_of(robot.panel.alarms[0], [("E1", "", WARN)]))
    robot.engine.entries_received("", "faults", entries, robot.now, True, (), 7)
    assert robot.engine.room.left_out == 7
    robot.publish_entries("faults", ("E1", "", WARN))
    assert robot.engine.room.left_out == 0


def test_a_flood_at_the_limit_costs_few_walks(
    cell: partial[Cell], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(entry_room, "MAX_ENTRIES", 1_000)
    walks: list[int] = []
    entry_alarms = AlarmEngine._entry_alarms

    def counted(self: AlarmEngine) -> Iterator[AlarmInstance]:
        for alarm in entry_alarms(self):
            walks.append(1)
            yield alarm

    monkeypatch.setattr(AlarmEngine, "_entry_alarms", counted)
    robot = cell(FAULTS)
    robot.publish_entries("faults", *((f"E{number}", "", WARN) for number in range(3_000)))
    robot.publish_entries("faults", *((f"U{number}", "", ERROR) for number in range(3_000)))
    assert len(walks) < 10 * 1_000
    assert {alarm.priority for alarm in robot.engine.standing()} == {1}


def test_an_alarm_that_fails_hides_no_other(
    cell: partial[Cell], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = cell(FAULTS)
    read = read_alarm

    def fails(alarm: AlarmInstance, *others: Any) -> Any:
        if alarm.definition.id == "faults:E2":
            raise RuntimeError("a fault of the program")
        return read(alarm, *others)

    monkeypatch.setattr(engine, "read_alarm", fails)
    robot.publish_entries("faults", ("E1", "", WARN), ("E2", "", WARN), ("E3", "", WARN))
    assert {t.id for t in robot.transitions} == {"faults:E1", "faults:E3"}


def test_an_evaluation_reads_only_alarms_that_may_have_changed(
    cell: partial[Cell], monkeypatch: pytest.MonkeyPatch
) -> None:
    many = "".join(
        AIR.replace('"air"', f'"air{i}"').replace("/air", f"/air{i % 10}") for i in range(5_000)
    )
    air = cell(many)
    while air.engine.due == 0.0:
        air.engine.evaluate()
    read: list[str] = []

    def counted(alarm: Any, *about: Any) -> Any:
        read.append(alarm.id)
        return read_source(alarm, *about)

    monkeypatch.setattr(engine, "read_source", counted)
    air.publish(4.5, "/air3")
    # The value of the topic once, then that of each alarm.
    assert (len(read), len(air.transitions)) == (1 + 500, 500)
    air.engine.robot_changed("")
    air.engine.evaluate()
    assert len(read) == 1 + 500 + MAX_EVALUATED
    assert air.engine.due == 0.0


def test_a_value_that_no_limit_notices_evaluates_no_alarm(
    cell: partial[Cell], monkeypatch: pytest.MonkeyPatch
) -> None:
    many = "".join(AIR.replace('"air"', f'"air{i}"') for i in range(1_000))
    air = cell(many)
    evaluated: list[str] = []

    def counted(alarm: AlarmInstance, *about: Any) -> Any:
        evaluated.append(alarm.definition.id)
        return levels_of(alarm, *about)

    monkeypatch.setattr(engine, "levels_of", counted)
    for value, times in ((6.0, 1_000), (5.2, 0), (5.0, 0), (4.5, 1_000), (5.4, 0), (5.5, 1_000)):
        evaluated.clear()
        air.publish(value)
        assert (len(evaluated), air.engine.alarms["air7"].value) == (times, value)


@settings(max_examples=several(20, 60), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.sampled_from([3.9, 4.2, 4.6, 5.2, 6.0, math.nan]), st.floats(0, 4))))
def test_values_that_are_passed_over_change_no_transition(
    cell: partial[Cell], heard: list[tuple[float, float]]
) -> None:
    alarms = DELAYED + OLD.replace('"air"', '"old"')

    def transitions(passes_over: bool) -> list[Transition]:
        air = cell(alarms)
        for value, seconds in heard:
            air.now += seconds
            air.engine.evaluate()
            if not passes_over:
                for alarm in air.engine.alarms.values():
                    alarm.steady = NEVER_STEADY
            air.publish(value)
        return [t._replace(value=None) for t in air.transitions]

    assert transitions(passes_over=True) == transitions(passes_over=False)


def test_controls_are_locked_until_a_robot_has_published_its_alarms(cell: partial[Cell]) -> None:
    motors = cell(HEALTH + 'inhibits = ["start"]\n')
    assert motors.inhibiting() == ["health"]
    motors.publish_entries("health", ("motor 1", OK, "runs", ""))
    assert motors.inhibiting() == []
    motors.publish_entries("health", ("motor 1", ERROR, "hot", ""))
    assert motors.inhibiting() == ["health:motor 1"]
    motors.publish_entries("health", ("motor 1", OK, "runs", ""))
    assert motors.inhibiting() == []


def test_controls_are_locked_when_a_robot_publishes_its_alarms_no_more(cell: partial[Cell]) -> None:
    motors = cell(HEALTH + 'inhibits = ["start"]\n')
    motors.publish_entries("health", ("motor 1", OK, "runs", ""))
    locks = motors.engine.lock_changes
    assert motors.wait_until_due() == 5.0
    assert motors.inhibiting() == ["health"]
    assert motors.engine.lock_changes == locks + 1
    motors.publish_entries("health", ("motor 1", OK, "runs", ""))
    assert motors.inhibiting() == []


def test_controls_are_locked_when_the_robot_of_a_source_is_lost(cell: partial[Cell]) -> None:
    motors = cell(HEALTH + 'inhibits = ["start"]\n')
    motors.publish_entries("health", ("motor 1", OK, "runs", ""))
    motors.robot.link_up = False
    motors.engine.evaluate()
    motors.robot.link_up = True
    assert motors.inhibiting() == ["health"]


def test_controls_are_locked_while_a_limits_topic_was_never_heard(cell: partial[Cell]) -> None:
    air = cell(AIR)
    air.engine.evaluate()
    assert air.inhibiting() == ["air"]
    air.publish(6.0)
    assert air.inhibiting() == []


def test_a_published_alarm_from_before_a_cut_is_not_known_until_it_is_published_again(
    cell: partial[Cell],
) -> None:
    motors = cell(HEALTH)
    motors.publish_entries("health", ("motor 1", ERROR, "hot", ""))
    for link_up in (False, True):
        motors.robot.link_up = link_up
        motors.engine.robot_changed("")
        motors.engine.evaluate()
        assert motors.status("health:motor 1").unknown_since is not None
    motors.publish_entries("health", ("motor 1", ERROR, "hot", ""))
    assert motors.status("health:motor 1").unknown_since is None
