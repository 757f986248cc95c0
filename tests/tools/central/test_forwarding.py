"""What a cell keeps reaches a real PostgreSQL: every row once, whatever was restored, replaced or set
back."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import psycopg
import pytest

from app.cell.forward.config import STREAMS, ForwardConfig
from app.cell.forward.forwarder import Forwarder, send_all
from app.cell.forward.status import ForwardStatus, parse_status
from app.records.entry import new_entry
from app.system.errors import LogError
from app.system.texts import Text
from app.tools.central.schema import TABLES, database
from app.tools.central.verification import Finding, panels, verify_panel
from tests.support.cell_data import START, CellData
from tests.support.postgres import SCHEMA, Cluster, execute, new_database, query

pytestmark = pytest.mark.promise("history")

NOTHING: Final = (0, 0)


def config(server: Cluster, user: str = "cell1", **more: Any) -> ForwardConfig:
    about: dict[str, Any] = {"panel": "cell 1", "site": "line 2", "every_s": 0.0}
    about["connection"] = server.config(user)
    return ForwardConfig(**(about | more))


def counts(server: Cluster, stream: str = "log") -> tuple[int, int]:
    """How many rows the centre has of a stream, and how many different ones."""
    table = TABLES[stream]
    (row,) = query(
        server,
        f"SELECT count(*), count(DISTINCT (panel, generation, seq)) FROM operator_panel.{table}",
    )
    return row[0], row[1]


def findings(server: Cluster) -> list[Finding]:
    with database(server.config()) as db:
        return [finding for panel in panels(db) for finding in verify_panel(db, panel, {}).findings]


def full_cell(folder: Path) -> CellData:
    cell = CellData(folder)
    cell.press(700)
    cell.sign()
    cell.press(300)
    cell.add(new_entry("recipe", values={"new": 1}, action="save", widget="boxes/small", who="Ann"))
    cell.sign()
    cell.alarm(40)
    cell.states(["Running", "", "Stopped"])
    cell.trend([float(n) for n in range(600)])
    return cell


@contextmanager
def forwarding(settings: ForwardConfig, folder: Path) -> Iterator[Forwarder]:
    forwarder = Forwarder(settings, folder)
    try:
        yield forwarder
    finally:
        forwarder.close()


def stepped(forwarder: Forwarder, steps: int = 3) -> ForwardStatus:
    for _ in range(steps):
        forwarder.step()
    return forwarder.status


def code(status: ForwardStatus) -> str:
    return status.fault.code if isinstance(status.fault, Text) else status.fault


def test_all_streams_arrive_once(centre: Cluster, tmp_path: Path) -> None:
    full_cell(tmp_path)
    status = send_all(config(centre, batch=100), tmp_path)
    assert (status.fault, status.note, status.rows) == ("", "", 0)
    assert {name: counts(centre, name)[0] for name in STREAMS} == {
        "log": 1003, "alarms": 40, "states": 3, "trends": 10, "recipes": 1, "health": 1,
    }  # fmt: skip
    assert findings(centre) == []
    assert send_all(config(centre), tmp_path).sent == 1  # the panel's health, and nothing twice
    assert counts(centre) == (1003, 1003)
    (row,) = query(centre, "SELECT name, site, writer FROM operator_panel.panel")
    assert row == ("cell 1", "line 2", "cell1")
    trend = "SELECT low, high, mean, last, count FROM operator_panel.trend ORDER BY seq LIMIT 1"
    assert query(centre, trend) == [(-1.0, 60.0, 29.5, 59.0, 60)]
    assert query(centre, "SELECT topic, field FROM operator_panel.pen") == [("/speed", "data")]
    assert query(centre, "SELECT text FROM operator_panel.alarm WHERE seq = 7") == [("Air 7 low",)]


def test_only_the_chosen_streams_are_sent(centre: Cluster, tmp_path: Path) -> None:
    full_cell(tmp_path)
    send_all(config(centre, streams=("alarms",)), tmp_path)
    assert counts(centre, "alarms") == (40, 40)
    assert counts(centre) == counts(centre, "health") == NOTHING


def test_a_row_is_sent_when_it_was_there_at_the_look_before(centre: Cluster, tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.press(5)
    with forwarding(config(centre, streams=("log",)), tmp_path) as forwarder:
        stepped(forwarder, 1)
        assert counts(centre) == NOTHING
        cell.press(5)
        stepped(forwarder, 1)
        assert counts(centre) == (5, 5)
        stepped(forwarder, 1)
        assert counts(centre) == (10, 10)


def test_a_restored_older_centre_gets_the_rows_again(centre: Cluster, tmp_path: Path) -> None:
    cell = full_cell(tmp_path)
    send_all(config(centre), tmp_path)
    for table in TABLES.values():
        execute(centre, f"DELETE FROM operator_panel.{table} WHERE seq > 5")
    cell.press(10)
    send_all(config(centre), tmp_path)
    assert counts(centre) == (1013, 1013)
    assert counts(centre, "trends") == (10, 10)
    assert counts(centre, "alarms") == (40, 40)
    assert findings(centre) == []


def test_an_emptied_centre_gets_everything_again(centre: Cluster, tmp_path: Path) -> None:
    full_cell(tmp_path)
    send_all(config(centre), tmp_path)
    new_database(centre, template=SCHEMA)
    send_all(config(centre), tmp_path)
    assert counts(centre) == (1003, 1003)
    assert counts(centre, "trends") == (10, 10)
    assert findings(centre) == []


def test_a_lost_file_of_the_forwarder_doubles_nothing(centre: Cluster, tmp_path: Path) -> None:
    cell = full_cell(tmp_path)
    send_all(config(centre), tmp_path)
    (tmp_path / "forward.sqlite3").unlink()
    cell.press(3)
    cell.trend([1.0] * 120, start=START - 600)  # so that the minutes get other numbers
    cell.trend([1.0] * 60, start=START + 600)
    send_all(config(centre), tmp_path)
    assert counts(centre) == (1006, 1006)
    assert counts(centre, "alarms") == (40, 40)
    times = query(centre, "SELECT count(*), count(DISTINCT at) FROM operator_panel.trend")
    assert times == [(11, 11)]
    generations = "SELECT generation, count(*) FROM operator_panel.trend GROUP BY 1 ORDER BY 1"
    assert query(centre, generations) == [(0, 10), (1, 1)]


def test_a_restored_cell_goes_on_in_a_new_generation(centre: Cluster, tmp_path: Path) -> None:
    here, copy = tmp_path / "cell", tmp_path / "copy"
    cell = CellData(here)
    cell.press(100)
    cell.sign()
    cell.close()
    shutil.copytree(here, copy)
    cell = CellData(here)
    cell.press(100)
    cell.sign()
    cell.close()
    send_all(config(centre, streams=("log",)), here)
    restored = CellData(copy, START + 5000)
    restored.press(150)
    restored.sign()
    (copy / "forward.lock").unlink(missing_ok=True)
    assert send_all(config(centre, streams=("log",)), copy).fault == ""
    generations = "SELECT generation, min(seq), max(seq) FROM operator_panel.log GROUP BY 1 ORDER BY 1"
    assert query(centre, generations) == [(0, 1, 202), (1, 102, 252)]
    (note,) = findings(centre)
    assert note.is_note
    assert "was replaced or restored: from entry 102 on" in note.text


def test_a_clock_that_is_set_back_loses_nothing(centre: Cluster, tmp_path: Path) -> None:
    cell = CellData(tmp_path, 4_000_000_000.0)
    cell.press(10)
    cell.close()
    later = CellData(tmp_path, 1000.0)  # a clock that was never set
    later.press(10)
    later.sign()
    send_all(config(centre, streams=("log",)), tmp_path)
    assert counts(centre) == (21, 21)
    assert findings(centre) == []


def test_entries_that_the_cell_removed_unsent_are_a_named_gap(centre: Cluster, tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.press(10, 86_400.0)
    send_all(config(centre, streams=("log",)), tmp_path)
    cell.press(20, 86_400.0)
    cell.remove_before(9.5, START + 30 * 86_400)
    cell.sign()
    send_all(config(centre, streams=("log",)), tmp_path)
    gaps = query(centre, 'SELECT first, "last", reason FROM operator_panel.gap')
    assert gaps == [(11, 20, "removed in the cell before it was sent")]
    (note,) = findings(centre)
    assert note.is_note, "the cell's own signed log says that it removed them"
    assert "cell 1: log: entries 11 to 20 are missing, between 20" in str(note)


def test_two_panels_with_one_name_are_refused_and_said(centre: Cluster, tmp_path: Path) -> None:
    for name in ("a", "b"):
        CellData(tmp_path / name).press(5)
    assert send_all(config(centre, streams=("log",)), tmp_path / "a").fault == ""
    status = send_all(config(centre, streams=("log",)), tmp_path / "b")
    assert code(status) == "forward_name_taken"
    assert "another panel named cell 1" in str(status.fault)
    assert status.rows == 5
    execute(centre, "SELECT operator_panel.retire_panel('cell 1')")
    assert send_all(config(centre, streams=("log",)), tmp_path / "b").fault == ""
    assert counts(centre) == (10, 10)


def test_a_panel_s_key_under_two_names_is_refused(centre: Cluster, tmp_path: Path) -> None:
    CellData(tmp_path).press(5)
    send_all(config(centre), tmp_path)
    status = send_all(config(centre, panel="cell 2"), tmp_path)
    assert code(status) == "forward_key_taken"
    assert "under the name cell 1" in str(status.fault)
    execute(centre, "SELECT operator_panel.rename_panel('cell 1', 'cell 2')")
    assert send_all(config(centre, panel="cell 2"), tmp_path).fault == ""


def test_two_programs_never_send_as_one_panel(centre: Cluster, tmp_path: Path) -> None:
    here, copy = tmp_path / "cell", tmp_path / "copy"
    CellData(here).press(5)
    shutil.copytree(here, copy)
    with forwarding(config(centre), here) as forwarder:
        assert stepped(forwarder).connected
        with pytest.raises(LogError, match="Another process sends"):
            send_all(config(centre), here)
        assert code(send_all(config(centre), copy)) == "forward_sent_twice"
    assert send_all(config(centre), copy).fault == ""


def test_another_role_writes_no_rows_of_the_panel(centre: Cluster, tmp_path: Path) -> None:
    CellData(tmp_path).press(5)
    send_all(config(centre), tmp_path)
    status = send_all(config(centre, "cell2"), tmp_path)
    assert code(status) == "forward_other_role"
    with (
        centre.connect(user="cell2") as db,
        pytest.raises(psycopg.errors.InsufficientPrivilege, match="row-level security"),
    ):
        db.execute("INSERT INTO operator_panel.gap VALUES (1, 'log', 0, 1, 2, 'none of mine', now())")


def test_a_row_that_the_database_can_t_take_is_left_and_noted(centre: Cluster, tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.press(3)
    cell.add(new_entry("pressed", values={"n": 0})._replace(monotonic=2**62, of=1, at=1))
    cell.press(3)
    cell.sign()
    execute(
        centre,
        "CREATE FUNCTION public.small() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN"
        " IF NEW.monotonic > 1::bigint << 60 THEN RAISE numeric_value_out_of_range; END IF;"
        " RETURN NEW; END $$;"
        "CREATE TRIGGER small BEFORE INSERT ON operator_panel.log_default FOR EACH ROW"
        " EXECUTE FUNCTION public.small()",
    )
    status = send_all(config(centre, streams=("log",)), tmp_path)
    assert status.fault == ""
    assert counts(centre) == (7, 7)
    (gap,) = query(centre, 'SELECT first, "last", reason FROM operator_panel.gap')
    assert gap[:2] == (4, 4)
    assert gap[2].startswith("refused by the database")
    (finding,) = findings(centre)
    assert not finding.is_note


def test_the_status_is_the_same_after_the_way_to_the_server() -> None:
    status = ForwardStatus(address="a:1", fault=Text("forward_no_key"), rows=3, unsent={"log": 3})
    assert parse_status(status.as_json()) == status
    assert status.lag_s(5.0) == 0.0
    assert ForwardStatus(oldest=2.0).lag_s(5.0) == 3.0
