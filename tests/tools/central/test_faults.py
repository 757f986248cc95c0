"""The central database is killed, cut off, full, without its tables, of another version, or slow: no
row is lost or doubled, memory is bounded, and each is said."""

import random
import resource
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Final

import pytest

from app.cell.forward import centre as connection
from app.cell.forward import forwarder as forwarding_module
from app.cell.forward.config import ConnectionConfig
from app.cell.forward.forwarder import Forwarder
from app.system.texts import Text
from tests.support.cell_data import CellData
from tests.support.parts import ROOT, until
from tests.support.postgres import SCHEMA, Cluster, execute, new_database, query, wire
from tests.tools.central.test_forwarding import code, config, counts, findings, forwarding, stepped

pytestmark = pytest.mark.promise("history")

LOG: Final = ("log",)


@pytest.fixture(autouse=True)
def _hasty(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forwarding_module, "RETRY_S", (0.0,))
    monkeypatch.setattr(forwarding_module, "MEASURE_EVERY_S", 0.0)


def until_sent(forwarder: Forwarder, count: int) -> None:
    def is_sent() -> bool:
        forwarder.step()
        return forwarder.status.connected and forwarder.status.rows == 0

    until(is_sent, f"all {count} entries are sent", 60, 0.01)


def all_arrived(server: Cluster, count: int) -> None:
    assert counts(server) == (count, count)
    assert findings(server) == []


def killed_in_the_middle(server: Cluster, folder: Path, kills: int) -> None:
    """The server is killed at random moments while batches are sent; at each start the cell has
    more."""
    chance = random.Random(46)
    cell = CellData(folder)
    sent = 0
    with forwarding(config(server, streams=LOG, batch=20), folder) as forwarder:
        stepped(forwarder, 1)
        for _ in range(kills):
            cell.press(400)
            timer = threading.Timer(chance.uniform(0.0, 0.15), server.kill)
            timer.start()
            while timer.is_alive():
                forwarder.step()
            timer.join()
            cell.press(1)  # also where all was sent before the kill, something is to be sent now
            if not stepped(forwarder, 1).fault:
                stepped(forwarder)
            assert forwarder.status.fault, "the loss is said"
            server.start()
            (row,) = query(server, "SELECT count(*) FROM operator_panel.log")
            assert row[0] >= sent, "what was committed is there"
            sent = row[0]
        cell.sign()
        until_sent(forwarder, 401 * kills + 1)
    all_arrived(server, 401 * kills + 1)


def test_a_server_killed_in_the_middle_of_a_batch_loses_and_doubles_nothing(
    centre: Cluster, tmp_path: Path
) -> None:
    killed_in_the_middle(centre, tmp_path, 10)


@pytest.mark.long("fault")
def test_a_server_killed_a_hundred_times_loses_and_doubles_nothing(
    centre: Cluster, tmp_path: Path
) -> None:
    killed_in_the_middle(centre, tmp_path, 100)


@pytest.mark.timeout(900)
@pytest.mark.parametrize("kills", [3, pytest.param(100, marks=pytest.mark.long("fault"))])
def test_a_forwarder_killed_in_the_middle_of_a_batch_goes_on(
    centre: Cluster, tmp_path: Path, kills: int
) -> None:
    data, settings = tmp_path / "data", tmp_path / "forward.toml"
    cell = CellData(data)
    settings.write_text(
        f'[forward]\npanel = "cell 1"\nconnection = "{centre.string("cell1")}"\nbatch = 10\n'
        f'password_file = "{centre.folder}/cell-password"\nstreams = ["log"]\nevery_s = 0.1\n'
    )
    command = [sys.executable, "-m", "app.cli", "forward", "--once", "--settings", str(settings)]
    chance = random.Random(46)
    for _ in range(kills):
        cell.press(400)
        before = counts(centre)[0]
        child = subprocess.Popen([*command, "--data", str(data)], cwd=ROOT)
        until(lambda: counts(centre)[0] > before or child.poll() is not None, "it sends", 30)  # noqa: B023
        threading.Event().wait(chance.uniform(0.0, 0.05))
        child.send_signal(signal.SIGKILL)
        child.wait()
    cell.sign()
    done = subprocess.run([*command, "--data", str(data)], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    all_arrived(centre, 400 * kills + 1)


@pytest.mark.parametrize("has_word", [True, False])
def test_a_network_that_is_cut_is_noticed_and_loses_nothing(
    centre: Cluster, tmp_path: Path, has_word: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a word the connection is reset; without one nothing comes any more."""
    monkeypatch.setattr(connection, "ANSWERED_WITHIN_S", 60.0 if has_word else 1.0)
    cell = CellData(tmp_path)
    cell.press(500)
    with wire(centre.port) as way:
        cut = ConnectionConfig(
            keys={**centre.config("cell1").keys, "port": str(way.port)},
            password_file=centre.folder / "cell-password",
        )
        settings = config(centre, streams=LOG, batch=50, connection=cut)
        with forwarding(settings, tmp_path) as forwarder:
            stepped(forwarder)
            assert counts(centre) == (500, 500)
            cell.press(500)
            cell.sign()
            way.is_cut = True
            if has_word:
                threading.Timer(0.5, way.reset).start()
            stepped(forwarder, 2)
            assert code(forwarder.status) == "forward_unreachable"
            assert forwarder.status.rows == 501
            assert forwarder.status.size > 501 * 200
            assert forwarder.status.oldest is not None
            way.reset()  # by then the server has noticed too
            way.is_cut = False
            until_sent(forwarder, 1001)
    all_arrived(centre, 1001)


REFUSALS: Final = {
    "disk full": (
        "CREATE FUNCTION public.refuse() RETURNS trigger LANGUAGE plpgsql AS"
        " $$ BEGIN RAISE disk_full; END $$;"
        "CREATE TRIGGER refuse BEFORE INSERT ON operator_panel.log FOR EACH ROW"
        " EXECUTE FUNCTION public.refuse()",
        "DROP TRIGGER refuse ON operator_panel.log; DROP FUNCTION public.refuse()",
        "forward_centre_full",
    ),
    "table missing": (
        "ALTER TABLE operator_panel.log RENAME TO elsewhere",
        "ALTER TABLE operator_panel.elsewhere RENAME TO log",
        "forward_no_tables",
    ),
    "older schema": (
        "UPDATE operator_panel.about SET version = 0, written_from = 0",
        "UPDATE operator_panel.about SET version = 1, written_from = 1",
        "forward_other_version",
    ),
    "newer schema": (
        "UPDATE operator_panel.about SET version = 9, written_from = 5",
        "UPDATE operator_panel.about SET version = 9, written_from = 1",
        "forward_other_version",
    ),
    "role taken away": (
        "REVOKE operator_panel_writer FROM cell1",
        "GRANT operator_panel_writer TO cell1",
        "forward_not_permitted",
    ),
    "read only": (
        "ALTER ROLE cell1 SET default_transaction_read_only = on",
        "ALTER ROLE cell1 RESET default_transaction_read_only",
        "forward_refused",
    ),
    "sign-in refused": (
        "ALTER ROLE cell1 PASSWORD 'another'",
        "ALTER ROLE cell1 PASSWORD 's3cret-of-the-cell'",
        "forward_sign_in",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSALS)
def test_what_the_centre_refuses_is_said_and_sent_later(
    centre: Cluster, tmp_path: Path, fault: str
) -> None:
    damage, repair, sentence = REFUSALS[fault]
    cell = CellData(tmp_path)
    cell.press(100)
    cell.sign()
    execute(centre, damage)
    try:
        with forwarding(config(centre, streams=LOG), tmp_path) as forwarder:
            stepped(forwarder)
            assert code(forwarder.status) == sentence
            assert isinstance(forwarder.status.fault, Text)
            assert forwarder.status.rows == 101
            execute(centre, repair)
            until_sent(forwarder, 101)
    finally:
        if "ROLE" in repair or "GRANT" in repair:  # of the whole cluster
            execute(centre, repair)
    all_arrived(centre, 101)


def test_a_database_without_the_schema_is_said(centre: Cluster, tmp_path: Path) -> None:
    CellData(tmp_path).press(1)
    new_database(centre)
    with forwarding(config(centre), tmp_path) as forwarder:
        stepped(forwarder)
        assert code(forwarder.status) == "forward_no_tables"
        assert "operator-panel central init" in str(forwarder.status.fault)
        new_database(centre, template=SCHEMA)
        until_sent(forwarder, 1)
    gone = config(centre, connection=centre.config("cell1", database="none"))
    with forwarding(gone, tmp_path) as forwarder:
        assert code(stepped(forwarder)) == "forward_no_database"


def slow_commits(server: Cluster, seconds: float) -> None:
    execute(
        server,
        "CREATE FUNCTION public.wait() RETURNS trigger LANGUAGE plpgsql AS"
        f" $$ BEGIN PERFORM pg_sleep({seconds}); RETURN NULL; END $$;"
        "CREATE TRIGGER wait AFTER INSERT ON operator_panel.log FOR EACH STATEMENT"
        " EXECUTE FUNCTION public.wait()",
    )


@pytest.mark.parametrize("seconds", [0.3, pytest.param(10.0, marks=pytest.mark.long("real time"))])
def test_a_slow_server_is_said_and_gets_everything(
    centre: Cluster, tmp_path: Path, seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(forwarding_module, "SLOW_S", seconds * 0.9)
    slow_commits(centre, seconds)
    cell = CellData(tmp_path)
    cell.press(60)
    cell.sign()
    with forwarding(config(centre, streams=LOG, batch=30), tmp_path) as forwarder:
        stepped(forwarder, 2)
        assert forwarder.status.connected
        assert isinstance(forwarder.status.note, Text)
        assert forwarder.status.note.code == "forward_slow"
        until_sent(forwarder, 61)
    all_arrived(centre, 61)


def test_a_statement_that_never_ends_is_given_up(
    centre: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "SERVER_OPTIONS", "-c statement_timeout=300ms")
    slow_commits(centre, 60)
    cell = CellData(tmp_path)
    cell.press(10)
    cell.sign()
    with forwarding(config(centre, streams=LOG), tmp_path) as forwarder:
        stepped(forwarder)
        assert code(forwarder.status) == "forward_too_slow"
        execute(centre, "DROP TRIGGER wait ON operator_panel.log")
        until_sent(forwarder, 11)
    all_arrived(centre, 11)


def test_a_full_disk_of_the_cell_stops_nothing(
    centre: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The forwarder's own file takes no more pages: rows are sent, the centre knows how far."""
    cell = CellData(tmp_path)
    cell.press(300)
    with forwarding(config(centre, streams=("log", "health")), tmp_path) as forwarder:
        stepped(forwarder)
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        previous = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        monkeypatch.setattr(forwarding_module, "HEALTH_EVERY_S", 0.0)
        cell.press(300)
        cell.sign()
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1, limits[1]))
            forwarder._health_at = 0.0
            stepped(forwarder, 4)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
            signal.signal(signal.SIGXFSZ, previous)
        assert forwarder.status.connected
        assert isinstance(forwarder.status.note, Text)
        assert forwarder.status.note.code == "forward_store"
        assert counts(centre) == (601, 601)
        stepped(forwarder)
        assert forwarder.status.note == ""
    all_arrived(centre, 601)


def test_a_damaged_store_stops_no_other_stream(centre: Cluster, tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.press(10)
    cell.sign()
    (tmp_path / "alarms.sqlite3").write_bytes(b"no database, and longer than a header of one" * 10)
    with forwarding(config(centre, streams=("alarms", "log")), tmp_path) as forwarder:
        stepped(forwarder)
        assert forwarder.status.connected
        assert "damaged" in str(forwarder.status.note)
        assert counts(centre) == (11, 11)


def test_memory_is_bounded_whatever_waits(centre: Cluster, tmp_path: Path) -> None:
    """50,000 entries with long texts: the process takes no more than for a batch of them."""
    data, settings = tmp_path / "data", tmp_path / "forward.toml"
    cell = CellData(data)
    for _ in range(50):
        cell.press(1_000)
    cell.sign()
    settings.write_text(
        f'[forward]\npanel = "cell 1"\nconnection = "{centre.string("cell1")}"\nbatch = 500\n'
        f'password_file = "{centre.folder}/cell-password"\nstreams = ["log"]\n'
    )
    work = (
        "import re, sys; from pathlib import Path;"
        "from app.cell.forward.config import read_forward;"
        "from app.cell.forward.forwarder import send_all; send_all(read_forward(Path(sys.argv[1])),"
        " Path(sys.argv[2]));"
        # Not `ru_maxrss`, in which the process that started this one counts too.
        r"print(re.search(r'VmHWM:\s+(\d+) kB', Path('/proc/self/status').read_text())[1])"
    )
    command = [sys.executable, "-c", work, str(settings), str(data)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert counts(centre) == (50_001, 50_001)
    assert int(done.stdout) < 150_000, "kB"
