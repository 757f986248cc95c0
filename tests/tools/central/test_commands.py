"""`operator-panel central` and `forward` on a real PostgreSQL: schema, roles, partitions, verification,
pruning."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

import psycopg
import pytest

from app.cell.forward.centre import SCHEMA_VERSION
from app.cell.forward.forwarder import send_all
from app.tools.central.schema import TABLES, versions
from app.tools.cli import central, forward
from tests.support.cell_data import START, CellData
from tests.support.postgres import Cluster, execute, new_database, query
from tests.tools.central.test_forwarding import config, counts, full_cell

pytestmark = pytest.mark.promise("history")

Run = Callable[..., tuple[int, str, str]]
DAY_S: Final = 86_400.0


@pytest.fixture
def run(postgres: Cluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Run:
    """Runs `operator-panel central …`, or `forward …`; its exit status, output and errors."""
    settings = tmp_path / "central.toml"
    settings.write_text(
        f'[forward]\npanel = "cell 1"\nconnection = "{postgres.string("cell1")}"\n'
        f'password_file = "{postgres.folder}/cell-password"\n'
        f'[central]\nconnection = "{postgres.string("admin")}"\n'
        f'password_file = "{postgres.folder}/cell-password"\n'
    )

    def command(*words: str) -> tuple[int, str, str]:
        module = forward if words[0].startswith("--") else central
        capsys.readouterr()
        status = module.main([*words, "--settings", str(settings)], "operator-panel central")
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return command


def test_init_makes_the_schema_once(postgres: Cluster, run: Run) -> None:
    new_database(postgres)
    status, _, error = run("upgrade")
    assert (status, error) == (1, "there is no schema operator_panel in this database: use init\n")
    status, output, _ = run("init")
    assert status == 0
    made = 14 * len((*TABLES, "details"))
    assert output == f"the schema has version {SCHEMA_VERSION}; {made} partitions made\n"
    status, _, error = run("init")
    assert (status, "is there already, in version" in error) == (1, True)
    status, output, _ = run("upgrade")
    assert (status, output) == (
        0,
        f"the schema has version {SCHEMA_VERSION} already; 0 partitions made\n",
    )
    execute(postgres, "UPDATE operator_panel.about SET version = 99")
    status, _, error = run("upgrade")
    assert (status, "the database has version 99" in error) == (1, True)
    assert max(versions()) == SCHEMA_VERSION


def test_a_failed_upgrade_leaves_nothing(
    postgres: Cluster, run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    new_database(postgres)
    broken = tmp_path / "002.sql"
    broken.write_text("CREATE TABLE operator_panel.more (); SELECT 1 / 0;")
    monkeypatch.setattr("app.tools.central.schema.versions", lambda: {**versions(), 2: broken})
    status, _, error = run("init")
    assert (status, "division by zero" in error) == (1, True)
    assert query(postgres, "SELECT to_regclass('operator_panel.about')") == [(None,)]


@pytest.mark.parametrize(
    "statement",
    [
        "SELECT * FROM operator_panel.log",
        "SELECT * FROM operator_panel.panel",
        "UPDATE operator_panel.log SET reason = ''",
        "DELETE FROM operator_panel.log",
        "TRUNCATE operator_panel.log",
        "INSERT INTO operator_panel.pruned VALUES (1, 'log', 0, 5, '')",
        "INSERT INTO operator_panel.panel (name, key, writer) VALUES ('x', 'y', 'z')",
        "DROP TABLE operator_panel.log",
        "SELECT operator_panel.keep_partitions()",
        "SELECT operator_panel.retire_panel('cell 1')",
        "SELECT operator_panel.rename_panel('cell 1', 'x')",
        "INSERT INTO operator_panel.log_default SELECT * FROM operator_panel.log",
        "CREATE TABLE operator_panel.own ()",
    ],
)
def test_a_writer_can_only_insert(centre: Cluster, tmp_path: Path, statement: str) -> None:
    CellData(tmp_path).press(3)
    send_all(config(centre), tmp_path)
    refused = pytest.raises(psycopg.errors.InsufficientPrivilege)
    with centre.connect(user="cell1") as db, refused:
        db.execute(statement)


@pytest.mark.parametrize(
    "statement",
    [
        "INSERT INTO operator_panel.gap VALUES (1, 'log', 0, 1, 2, '')",
        "UPDATE operator_panel.log SET reason = ''",
        "DELETE FROM operator_panel.log",
        "SELECT operator_panel.register('x', '', 'y')",
    ],
)
def test_a_reader_can_only_read(centre: Cluster, tmp_path: Path, statement: str) -> None:
    CellData(tmp_path).press(3)
    send_all(config(centre), tmp_path)
    assert query(centre, "SELECT count(*) FROM operator_panel.log", user="grafana") == [(3,)]
    assert query(centre, "SELECT name FROM operator_panel.panel", user="grafana") == [("cell 1",)]
    refused = pytest.raises(psycopg.errors.InsufficientPrivilege)
    with centre.connect(user="grafana") as db, refused:
        db.execute(statement)


def test_verify_names_each_change_by_panel_and_time(centre: Cluster, tmp_path: Path, run: Run) -> None:
    for name, user in (("cell 1", "cell1"), ("cell 2", "cell2")):
        full_cell(tmp_path / name)
        send_all(config(centre, user, panel=name), tmp_path / name)
    status, output, _ = run("verify")
    assert status == 0
    assert "cell 1: 1003 entries of the log, signed up to entry 1002" in output
    assert output.endswith("nothing is missing or changed\n")
    changes = (
        "UPDATE operator_panel.log SET who = 'Bob' WHERE panel = 2 AND seq = 500",
        "DELETE FROM operator_panel.log WHERE panel = 2 AND seq BETWEEN 601 AND 603",
        "DELETE FROM operator_panel.log WHERE panel = 2 AND seq > 990",
        "DELETE FROM operator_panel.alarm WHERE panel = 2 AND seq BETWEEN 7 AND 9",
        "DELETE FROM operator_panel.trend WHERE panel = 2 AND seq = 4",
        "DELETE FROM operator_panel.log WHERE panel = 1 AND seq < 4",
        # As the panel would have noted a minute after these rows were sent.
        "UPDATE operator_panel.health SET log_seq = 1003",
    )
    for change in changes:
        execute(centre, change)
    status, output, _ = run("verify")
    assert status == 1
    first, second = output.split("cell 2: 9")
    assert "FAULT: cell 1: log: the entries before 4 are missing, and not by prune (20" in first
    assert first.count("FAULT") == 1
    lines = [line for line in second.splitlines() if "FAULT" in line]
    assert len(lines) == 5
    for words in (
        "cell 2: log: entry 500 was changed, or is not in its place (20",
        "cell 2: log: entries 601 to 603 are missing, between 20",
        "cell 2: log: entries 991 to 1003 are missing at the end: the centre had them at 20",
        "cell 2: alarms: rows 7 to 9 are missing, between 20",
        "cell 2: trends: rows 4 to 4 are missing, between 20",
    ):
        assert any(words in line for line in lines), words
    assert run("verify", "--panel", "cell 1")[1].count("FAULT") == 1
    status, _, error = run("verify", "--panel", "cell 9")
    assert (status, error) == (1, 'there is no panel "cell 9" at the centre\n')


def test_a_log_that_was_signed_again_with_another_key_is_found(
    centre: Cluster, tmp_path: Path, run: Run
) -> None:
    """Who can change the whole database replaces the key too: the noted key shows it."""
    real, forged = CellData(tmp_path / "a"), CellData(tmp_path / "b")
    for cell in (real, forged):
        cell.press(10)
        cell.sign()
    send_all(config(centre, streams=("log",)), tmp_path / "b")
    assert run("verify")[0] == 0
    status, output, _ = run("verify", "--key", f"cell 1={real.key}")
    assert status == 1
    assert "and not the noted" in output
    assert "is signed with another key" in output


def test_prune_keeps_a_chain_that_begins_with_a_signed_head(
    centre: Cluster, tmp_path: Path, run: Run
) -> None:
    cell = CellData(tmp_path, time.time() - 100 * DAY_S)
    cell.press(40, DAY_S)
    cell.sign_at(41 * DAY_S)
    cell.press(30, DAY_S)
    cell.sign_at(71 * DAY_S)
    cell.press(25, DAY_S)
    cell.sign()
    cell.trend([1.0] * 60, width=60, start=START)
    send_all(config(centre, streams=("log", "trends", "health")), tmp_path)
    assert counts(centre) == (98, 98)
    status, output, _ = run("prune", "--days", "40")
    assert (status, "log: 40 rows removed" in output) == (0, True)
    assert query(centre, "SELECT min(seq) FROM operator_panel.log") == [(41,)]
    status, output, _ = run("verify")
    assert (status, output.count("FAULT")) == (0, 0)
    execute(centre, "DELETE FROM operator_panel.log WHERE seq = 41")
    status, output, _ = run("verify")
    assert status == 1
    assert "the entries before 42 are missing, and not by prune" in output
    status, output, _ = run("prune", "--days", "31", "--stream", "trends")
    assert (status, output) == (0, "trends: 0 rows removed\ndetails: 0 rows removed\n")
    assert query(centre, "SELECT to_regclass('operator_panel.log_2000_01')") == [(None,)]


def test_old_partitions_go_and_late_rows_get_theirs(centre: Cluster, tmp_path: Path, run: Run) -> None:
    """An outage of months: its rows are in the default partition until the next upgrade or prune."""
    cell = CellData(tmp_path, time.time() - 200 * DAY_S)
    cell.press(100, DAY_S)
    cell.alarm(3)
    cell.sign()
    send_all(config(centre, streams=("log", "alarms")), tmp_path)
    waiting = "SELECT count(*) FROM operator_panel.log_default"
    assert query(centre, waiting)[0][0] >= 99
    status, output, _ = run("upgrade")
    assert (status, int(output.split("; ")[1].split()[0]) >= 4) == (0, True)
    assert query(centre, waiting) == [(0,)]
    assert counts(centre) == (101, 101)
    assert run("verify")[0] == 0
    made = "SELECT count(*) FROM pg_inherits WHERE inhparent = 'operator_panel.alarm'::regclass"
    before = query(centre, made)[0][0]
    assert run("prune", "--days", "60", "--stream", "alarms")[0] == 0
    assert counts(centre, "alarms") == (0, 0)
    assert query(centre, made)[0][0] == before - 1
    assert run("verify")[0] == 0


def test_prune_refuses_a_short_time(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        run("prune", "--days", "3")
    assert '"3" is not a whole number from 31 on' in capsys.readouterr().err


def test_forward_checks_and_sends_once(centre: Cluster, tmp_path: Path, run: Run) -> None:
    cell = full_cell(tmp_path / "data")
    data = ("--data", str(tmp_path / "data"))
    status, output, _ = run("--check", *data)
    assert status == 0
    assert f'ok: "cell 1" may write, with the key {cell.key}' in output
    assert "ok: log: row 1003 here, row 0 there" in output
    assert "note: sslmode=disable" in output
    status, output, _ = run("--once", *data)
    assert status == 0
    assert output.startswith("1058 rows sent to 127.0.0.1:")
    assert output.endswith("; nothing is left\n")
    assert "ok: log: row 1003 here, row 1003 there" in run("--check", *data)[1]
    execute(centre, "UPDATE operator_panel.about SET version = 0")
    cell.press(5)
    status, _, error = run("--once", *data)
    assert status == 1
    assert "not sent: The central database has version 0, this panel needs 1." in error
    assert "rows are left, about" in error
    status, _, error = run("--check", *data)
    assert (status, "has version 0" in error) == (1, True)


def test_a_command_without_settings_says_how_to_name_them(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("KIOSK_FORWARD", raising=False)
    assert central.main(["verify"]) == forward.main(["--check"]) == 2
    assert capsys.readouterr().err.count("name it with KIOSK_FORWARD or --settings") == 2
