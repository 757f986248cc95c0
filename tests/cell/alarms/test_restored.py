"""The alarms of an earlier run: read before anything is evaluated, each record by itself, and merged
with what was raised before they were read."""

import json
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.cell.alarms.engine import Restored
from app.cell.alarms.records import record_of
from app.cell.alarms.states import (
    ActResult,
    AlarmStatus,
    Definition,
    Moment,
    Override,
    State,
    TakenOut,
    remove_from_service,
)
from tests.cell.alarms.test_engine import AIR, ERROR, FAULTS, HEALTH, OK, STALE, WARN, Cell
from tests.support.form import several

RAISED_UNKNOWN = AIR + 'on_unknown = "raise"\n'
LATCHED = AIR + "latched = true\n"
LATCHED_STATES = (State.LATCHED_UNACKNOWLEDGED, State.LATCHED_ACKNOWLEDGED)
NEVER_LATCHED = tuple(state for state in State if state not in LATCHED_STATES)
LOCKING = 'inhibits = ["start"]\n'


def records_of(cell: Cell) -> dict[str, str]:
    now = Moment(cell.now, cell.now)
    return {alarm.definition.id: record_of(alarm, now) for alarm in cell.engine.standing()}


def occurrences(cell: Cell) -> int:
    """The highest number of an occurrence that the store has written."""
    return max((transition.after.occurrence for transition in cell.transitions), default=0)


def before(folder: Path, alarms: str, state: State) -> Cell:
    """A run in which the alarm has this state at its end."""
    cell = Cell(folder, alarms, begins=False)
    cell.publish(6.0)
    cell.engine.begin()
    cell.engine.evaluate()
    if state is not State.NORMAL:
        cell.publish(4.5)
    if state in (State.ACKNOWLEDGED, State.LATCHED_ACKNOWLEDGED):
        cell.acknowledge("air", cell.status().occurrence)
    if state in (State.NORMAL, State.RETURNED_UNACKNOWLEDGED, *LATCHED_STATES):
        cell.publish(6.0)
    assert cell.status().state is state
    return cell


KEPT = [
    *((alarms, state) for alarms in (AIR, RAISED_UNKNOWN) for state in NEVER_LATCHED),
    *((LATCHED, state) for state in State if state is not State.RETURNED_UNACKNOWLEDGED),
]


@pytest.mark.parametrize("is_out", [False, True], ids=["", "out of service"])
@pytest.mark.parametrize(("alarms", "state"), KEPT)
def test_a_restart_keeps_the_state_of_each_alarm(
    tmp_path: Path, alarms: str, state: State, is_out: bool
) -> None:
    earlier = before(tmp_path, alarms, state)
    if is_out:
        take_out(earlier)
    known = earlier.status()
    later = Cell(tmp_path, alarms, begins=False)
    assert later.engine.restore(records_of(earlier), occurrences(earlier)) == Restored()
    later.engine.evaluate()
    status = later.status()
    raises = alarms is RAISED_UNKNOWN and known.is_normal
    assert status.state is (State.UNACKNOWLEDGED if raises else known.state)
    assert status.override == known.override
    assert status.occurrence == known.occurrence + raises


def take_out(cell: Cell) -> None:
    def apply(status: AlarmStatus, _: Definition) -> ActResult:
        now = cell.engine.now()
        return remove_from_service(status, TakenOut(now, "Valve is off", "Ann"))

    assert cell.engine.act("air", "out_of_service", apply, "Ann") is not None


def test_nothing_is_evaluated_or_done_before_the_records_are_read(tmp_path: Path) -> None:
    cell = Cell(tmp_path, RAISED_UNKNOWN + STALE, begins=False)
    cell.publish(4.5)
    cell.now += 60.0
    cell.engine.evaluate()
    assert (cell.transitions, cell.engine.standing()) == ([], [])
    assert cell.inhibiting() == ["air"]
    result = cell.acknowledge("air", 1)
    assert result is not None
    assert result.refusal is not None
    assert result.refusal.code == "alarms_not_read_yet"
    cell.engine.restore({})
    cell.engine.evaluate()
    assert [transition.id for transition in cell.transitions] == ["air", "air_old"]


def late(folder: Path, alarms: str, records: dict[str, str], *values: float) -> Cell:
    """A run whose records are read late, after these values."""
    cell = Cell(folder, alarms)
    for value in values:
        cell.publish(value)
    cell.engine.restore(records)
    cell.engine.evaluate()
    return cell


@pytest.mark.parametrize(
    ("known", "values", "state"),
    [
        (State.ACKNOWLEDGED, [4.5], State.ACKNOWLEDGED),  # it still stands
        (State.ACKNOWLEDGED, [6.0, 4.5], State.UNACKNOWLEDGED),  # it has come again
        (State.ACKNOWLEDGED, [3.0], State.UNACKNOWLEDGED),  # its level has risen
        (State.ACKNOWLEDGED, [6.0], State.NORMAL),
        (State.UNACKNOWLEDGED, [4.5], State.UNACKNOWLEDGED),
        (State.UNACKNOWLEDGED, [6.0], State.RETURNED_UNACKNOWLEDGED),
        (State.UNACKNOWLEDGED, [4.5, 6.0], State.RETURNED_UNACKNOWLEDGED),
        (State.ACKNOWLEDGED, [4.5, 6.0], State.RETURNED_UNACKNOWLEDGED),
        (State.RETURNED_UNACKNOWLEDGED, [4.5], State.UNACKNOWLEDGED),
    ],
)
def test_late_records_are_merged_with_what_was_raised_since(
    tmp_path: Path, known: State, values: list[float], state: State
) -> None:
    cell = late(tmp_path, AIR, records_of(before(tmp_path, AIR, known)), *values)
    assert cell.status().state is state


def test_a_late_record_of_an_alarm_that_is_raised_while_unknown_keeps_what_a_person_did(
    tmp_path: Path,
) -> None:
    earlier = before(tmp_path, RAISED_UNKNOWN, State.ACKNOWLEDGED)
    take_out(earlier)
    cell = late(tmp_path, RAISED_UNKNOWN, records_of(earlier))
    status = cell.status()
    assert (status.state, status.override) == (State.ACKNOWLEDGED, Override.OUT_OF_SERVICE)


def test_an_occurrence_is_never_used_again(tmp_path: Path) -> None:
    earlier = Cell(tmp_path, AIR + STALE)
    for value in (4.5, 6.0, 4.5):
        earlier.publish(value)
    seen = earlier.status().occurrence
    earlier.acknowledge("air", seen)
    earlier.publish(6.0)
    assert records_of(earlier) == {}
    later = Cell(tmp_path, AIR, begins=False)
    later.engine.restore({}, occurrences(earlier))
    later.publish(4.5)
    refused = later.acknowledge("air", seen)
    assert refused is not None
    assert refused.refusal is not None
    assert refused.refusal.code == "alarm_came_again"
    assert later.status().occurrence > seen


BAD = ["", "{}", "null", "[]", "[" * 100_000, '{"state": "odd"}', '{"state": 1e999}', "\x00", "7"]


@pytest.mark.parametrize("bad", BAD, ids=range(len(BAD)))
def test_a_record_that_is_unreadable_takes_no_other_with_it(tmp_path: Path, bad: str) -> None:
    earlier = Cell(tmp_path, HEALTH)
    names = [f"motor {number}" for number in range(40)]
    earlier.publish_entries("health", *((name, WARN, "", "") for name in names))
    records = records_of(earlier)
    records["health:motor 3"] = bad
    later = Cell(tmp_path, HEALTH, begins=False)
    restored = later.engine.restore(records)
    later.engine.evaluate()
    assert {*restored.unreadable, *restored.missing} == {"health:motor 3"}
    assert len(later.engine.standing()) == 39


@settings(max_examples=several(60, 300), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_no_record_stops_the_alarms(tmp_path: Path, data: st.DataObject) -> None:
    earlier = before(tmp_path, AIR, State.ACKNOWLEDGED)
    take_out(earlier)
    record = json.loads(records_of(earlier)["air"])
    json_value = (
        st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.lists(st.text())
    )
    key = data.draw(st.sampled_from(sorted(record)))
    record[key] = data.draw(json_value | st.dictionaries(st.text(), json_value))
    later = Cell(tmp_path, AIR, begins=False)
    later.engine.restore({"air": json.dumps(record)})
    later.publish(6.0)
    later.publish(3.0)
    assert later.status().level == 2


def lost_and_found(folder: Path, alarms: str, by: str) -> Cell:
    """A cell with an alarm of a robot that is not known since a restart, or a cut of its link."""
    source = "health" if alarms.startswith(HEALTH) else "faults"
    row = ("motor 1", ERROR, "hot", "") if source == "health" else ("E1", "Axis 1 hot", ERROR)
    cell = Cell(folder, alarms)
    cell.publish_entries(source, row)
    if by == "restart":
        records = records_of(cell)
        cell = Cell(folder, alarms, begins=False)
        cell.engine.restore(records)
    else:
        for link_up in (False, True):
            cell.robot.link_up = link_up
            cell.engine.robot_changed("")
            cell.engine.evaluate()
    cell.engine.evaluate()
    (alarm,) = cell.engine.standing()
    assert alarm.status.unknown_since is not None
    assert cell.inhibiting()
    return cell


@pytest.mark.parametrize("by", ["restart", "cut"])
def test_a_whole_list_without_an_entry_ends_it_after_a_cut(tmp_path: Path, by: str) -> None:
    cell = lost_and_found(tmp_path, FAULTS.replace("[alarm.list]", LOCKING + "[alarm.list]"), by)
    cell.publish_entries("faults")
    assert (cell.status("faults:E1").state, cell.status("faults:E1").unknown_since) == (
        State.RETURNED_UNACKNOWLEDGED,
        None,
    )
    assert cell.inhibiting() == []


@pytest.mark.parametrize("by", ["restart", "cut"])
def test_a_period_of_diagnostics_without_an_entry_ends_it_after_a_cut(tmp_path: Path, by: str) -> None:
    cell = lost_and_found(tmp_path, HEALTH + LOCKING, by)
    for _ in range(5):
        cell.publish_entries("health", ("motor 2", OK, "runs", ""))
        assert cell.status("health:motor 1").unknown_since is not None
        cell.now += 1.0
    cell.publish_entries("health", ("motor 2", OK, "runs", ""))
    for _ in range(3):
        cell.now += 4.0
        cell.publish_entries("health", ("motor 2", OK, "runs", ""))
        status = cell.status("health:motor 1")
        assert (status.state, status.unknown_since) == (State.RETURNED_UNACKNOWLEDGED, None)
        assert cell.inhibiting() == []


def test_an_entry_whose_node_is_gone_stays_not_known_while_others_publish(tmp_path: Path) -> None:
    cell = Cell(tmp_path, HEALTH)
    cell.publish_entries("health", ("motor 1", ERROR, "hot", ""))
    for _ in range(10):
        cell.now += 2.0
        cell.publish_entries("health", ("motor 2", OK, "runs", ""))
    status = cell.status("health:motor 1")
    assert (status.state, status.unknown_since is not None) == (State.UNACKNOWLEDGED, True)
