"""Alarms are kept over a restart and a kill of the server: what is written is not lost."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from app.cell.alarms.engine import Restored
from app.cell.alarms.history import HistoryFilter, HistoryRow
from app.cell.alarms.records import record_of, status_in
from app.cell.alarms.states import AlarmStatus, Moment, Override, State, TakenOut
from app.cell.alarms.store import AlarmStore
from tests.cell.alarms.test_engine import AIR, DELAYED, HEALTH, WARN, Cell
from tests.support.form import several
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("alarms")

NOW = Moment(100.0, 1_700_000_000.0)
LATER = Moment(5.0, NOW.wall + 60.0)  # after a restart of the computer
# Raises and acknowledges one alarm after the other, and prints what is on the disk.
WRITER = """
import sys
from pathlib import Path
from app.cell.alarms.history import HistoryRow
from app.cell.alarms.store import AlarmStore
store = AlarmStore(Path(sys.argv[1]), days=1, size_mb=8)
for n in range(10**9):
    for state, act in (("unacknowledged", ""), ("acknowledged", "acknowledge")):
        row = HistoryRow(float(n), f"air{n}", state, 1, act, "Ann", "{}")
        store.write([row], {f"air{n}": state})
        print(n, state, flush=True)
"""


def open_store(path: Path, days: float = 1000, size_mb: float = 8) -> AlarmStore:
    return AlarmStore(path, days=days, size_mb=size_mb)


def row(n: int, at: float = NOW.wall) -> HistoryRow:
    return HistoryRow(at, f"air{n}", "unacknowledged", n, "", "", "{}")


def test_written_alarms_are_read_after_reopening(tmp_path: Path) -> None:
    store = open_store(tmp_path / "alarms.sqlite")
    store.write([row(1), row(2)], {"air1": "one", "air2": "two"})
    store.write([row(3)], {"air1": None})
    store.close()
    store = open_store(tmp_path / "alarms.sqlite")
    assert store.standing() == {"air2": "two"}
    assert [(r.seq, r.id) for r in store.history()] == [(3, "air3"), (2, "air2"), (1, "air1")]
    assert [r.id for r in store.history(HistoryFilter(before=3), 1)] == ["air2"]


def test_a_clock_that_is_set_back_keeps_the_order(tmp_path: Path) -> None:
    store = open_store(tmp_path / "alarms.sqlite")
    store.write([row(1, NOW.wall)], {})
    store.write([row(2, NOW.wall - 3600)], {})
    newest, oldest = store.history()
    assert (newest.id, oldest.id) == ("air2", "air1")
    assert newest.at == oldest.at - 3600


def test_the_history_is_bounded_by_days_and_size_and_alarms_that_stand_are_kept(
    tmp_path: Path,
) -> None:
    store = open_store(tmp_path / "alarms.sqlite", days=1, size_mb=1)
    store.write([row(1, NOW.wall - 90_000), row(2)], {"air1": "one"})
    assert store.remove_old(NOW.wall) == 1
    assert [r.id for r in store.history()] == ["air2"]
    store.write([row(n)._replace(record="x" * 1000) for n in range(3000)], {})
    assert store.remove_old(NOW.wall) > 1000
    assert (tmp_path / "alarms.sqlite").stat().st_size < 5e6
    assert store.history()[0].id == "air2999"
    assert store.standing() == {"air1": "one"}


def test_torn_write_loses_only_itself(tmp_path: Path) -> None:
    path, torn = tmp_path / "alarms.sqlite", tmp_path / "torn"
    store = open_store(path)
    store.write([row(1)], {"air1": "one"})
    before = Path(f"{path}-wal").stat().st_size
    store.write([row(2)], {"air2": "two"})
    whole = Path(f"{path}-wal").read_bytes()
    for cut in range(before + 1, len(whole), 997):
        torn.mkdir(exist_ok=True)
        (torn / "alarms.sqlite").write_bytes(path.read_bytes())
        (torn / "alarms.sqlite-wal").write_bytes(whole[:cut])
        (torn / "alarms.sqlite-shm").unlink(missing_ok=True)
        again = open_store(torn / "alarms.sqlite")
        assert again.standing() == {"air1": "one"}
        again.close()


@pytest.mark.parametrize("kill", range(several(5, 50)))
def test_a_kill_between_raise_and_acknowledge_loses_nothing(tmp_path: Path, kill: int) -> None:
    path = tmp_path / "alarms.sqlite"
    command = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in range(5 + kill)]
        process.kill()
        said += process.stdout.readlines()
    said = [line for line in said if line.endswith("\n")]  # the kill may cut the last one
    store = open_store(path)
    standing, written = store.standing(), {(r.id, r.state) for r in store.history()}
    states = {"unacknowledged": 0, "acknowledged": 1}
    for line in said:
        number, state = line.split()
        assert (f"air{number}", state) in written
        assert states[standing[f"air{number}"]] >= states[state]


def restarted(folder: Path, before: Cell, alarms: str) -> Cell:
    """The alarms after a restart, from the records of those before it."""
    now = Moment(before.now, before.now)
    standing = before.engine.standing()
    records = {alarm.definition.id: record_of(alarm, now) for alarm in standing}
    after = Cell(folder, alarms, begins=False)
    assert after.engine.restore(records) == Restored()
    after.engine.evaluate()
    return after


def test_alarm_active_before_a_restart_is_unknown_until_a_message(tmp_path: Path) -> None:
    before = Cell(tmp_path, DELAYED)
    before.publish(4.5)
    before.wait_until_due()
    after = restarted(tmp_path, before, DELAYED)
    status = after.status()
    assert (status.state, status.occurrence) == (State.UNACKNOWLEDGED, 1)
    assert status.is_standing
    assert status.unknown_since is not None
    after.publish(4.5)
    assert after.status().unknown_since is None
    assert (after.status().state, after.status().occurrence) == (State.UNACKNOWLEDGED, 1)
    refused = after.acknowledge("air", 1)
    assert refused is not None
    assert refused.refusal is None


def test_a_status_of_a_robot_is_kept_over_a_restart(tmp_path: Path) -> None:
    before = Cell(tmp_path, HEALTH)
    before.publish_entries("health", ("motor 7", WARN, "Hot", ""))
    after = restarted(tmp_path, before, HEALTH)
    assert after.status("health:motor 7").unknown_since is not None
    (alarm,) = after.engine.standing()
    assert alarm.entry is not None
    assert alarm.entry.text == "Hot"


def test_an_alarm_that_the_panel_no_longer_has_is_named(tmp_path: Path) -> None:
    before = Cell(tmp_path, AIR)
    before.publish(4.5)
    (alarm,) = before.engine.standing()
    record = record_of(alarm, Moment(before.now, before.now))
    restored = Cell(tmp_path, HEALTH).engine.restore({"air": record, "oil": record})
    assert restored.missing == ("air", "oil")


@pytest.mark.parametrize(
    ("set_by_s", "left_s"), [(0.0, 540.0), (-3600.0, 600.0), (3600.0, 0.0)], ids=["", "back", "on"]
)
def test_a_shelf_gets_no_longer_by_a_clock_that_is_set(
    tmp_path: Path, set_by_s: float, left_s: float
) -> None:
    cell = Cell(tmp_path, AIR)
    cell.publish(4.5)
    (alarm,) = cell.engine.standing()
    alarm.status = AlarmStatus(
        State.UNACKNOWLEDGED, 1, 1, 1, NOW, shelf=TakenOut(NOW, "Tests", "Ann", NOW.monotonic + 600.0)
    )
    record = record_of(alarm, NOW)
    assert json.loads(record)["shelf"]["reason"] == "Tests"
    now = Moment(LATER.monotonic, LATER.wall + set_by_s)
    status = status_in(record, alarm.definition.rules, now)
    assert status.override is Override.SHELVED
    assert status.shelf is not None
    assert status.shelf.until - now.monotonic == pytest.approx(left_s)
    assert status.shelf.until - status.shelf.since.monotonic == pytest.approx(600.0)
