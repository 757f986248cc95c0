"""The seconds of trends stay in the cell until the plant asks for them: on a real PostgreSQL."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import psycopg
import pytest

from app.cell.forward.config import STREAMS
from app.cell.forward.details import MOST_VALUES, Answer, KnownPen, Request
from app.cell.forward.forwarder import send_all
from app.cell.forward.spool import Pen
from app.system.errors import KioskError
from app.tools.central.details import ask, requests
from app.tools.central.schema import TABLES, CentralError, database, prune, upgrade, versions
from app.tools.cli import central
from tests.support.cell_data import SPEED, START, CellData
from tests.support.postgres import Cluster, add_logins, execute, new_database, query
from tests.tools.central.test_forwarding import config, counts, forwarding, stepped

pytestmark = pytest.mark.promise("history")

ASKER: Final = "operator_panel_asker"
HOUR_S: Final = 3600.0


def at(seconds: float) -> datetime:
    """A time after the start of the cell's data."""
    return datetime.fromtimestamp(START + seconds, UTC)


def asked(server: Cluster, *pens: str, since: float = 0, until: float = 120, user: str = "ann") -> int:
    with database(server.config(user)) as db:
        return ask(db, "cell 1", pens, at(since), at(until))


def results(server: Cluster) -> list[tuple[str, int, str]]:
    """The end of each request: status, values and reason."""
    with database(server.config("grafana")) as db:
        return [(made.status, made.rows, made.reason) for made in reversed(requests(db))]


def details(server: Cluster) -> list[tuple[Any, ...]]:
    return query(
        server,
        "SELECT extract(epoch FROM t.at)::float8 - %s, width, low, high, last"
        " FROM operator_panel.trend_detail t ORDER BY at, width",
        START,
        user="grafana",
    )


@pytest.fixture
def cell(centre: Cluster, tmp_path: Path) -> CellData:
    """With ten minutes of a trend whose minutes the centre has."""
    add_logins(centre, ann=ASKER)
    made = CellData(tmp_path)
    made.trend([float(number) for number in range(600)])
    send_all(config(centre), tmp_path)
    return made


def test_a_cell_sends_the_seconds_that_it_is_asked_for(centre: Cluster, cell: CellData) -> None:
    asked(centre, "/speed data", since=60, until=180)
    assert results(centre) == [("open", 0, "")]
    send_all(config(centre), cell.folder)
    assert results(centre) == [("done", 120, "a value each 1 s")]
    rows = details(centre)
    assert len(rows) == 120
    assert rows[0] == (60.0, 1, 59.0, 61.0, 60.0)
    joined = query(
        centre,
        "SELECT DISTINCT n.topic, n.field FROM operator_panel.trend_detail t JOIN operator_panel.pen n"
        " ON n.panel = t.panel AND n.generation = t.generation AND n.number = t.pen",
    )
    assert joined == [("/speed", "data")]
    # Another one over the same time doubles nothing.
    asked(centre, since=120, until=240)
    send_all(config(centre), cell.folder)
    assert [row[0] for row in details(centre)] == [float(second) for second in range(60, 240)]
    assert counts(centre, "trends") == (10, 10)


def test_a_request_that_is_cut_off_begins_again_and_doubles_nothing(
    centre: Cluster, cell: CellData
) -> None:
    asked(centre, until=600)
    with forwarding(config(centre, batch=10), cell.folder) as forwarder:
        forwarder.step()  # twenty batches
        assert len(details(centre)) == 200
        execute(
            centre,
            "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE usename = 'cell1'",
        )
        forwarder.step()
        assert not forwarder.status.connected
    send_all(config(centre, batch=10), cell.folder)
    assert results(centre) == [("done", 600, "a value each 1 s")]
    assert len(details(centre)) == 600


def test_a_cell_whose_own_file_was_lost_doubles_no_detail(centre: Cluster, cell: CellData) -> None:
    asked(centre)
    send_all(config(centre), cell.folder)
    (cell.folder / "forward.sqlite3").unlink()
    cell.trend([1.0] * 120, start=START - 600)  # so that the minutes get other numbers
    cell.trend([1.0] * 60, start=START + 600)
    send_all(config(centre), cell.folder)
    assert len(query(centre, "SELECT 1 FROM operator_panel.pen")) == 2, "the minutes begin again"
    asked(centre)
    send_all(config(centre), cell.folder)
    assert results(centre) == [("done", 120, "a value each 1 s")] * 2
    assert len(details(centre)) == 120


def test_details_wait_for_the_streams(centre: Cluster, cell: CellData) -> None:
    cell.press(60)
    with forwarding(config(centre, batch=1, streams=("log", "trends")), cell.folder) as forwarder:
        stepped(forwarder, 1)  # only looks
        asked(centre)
        forwarder._requests_at = 0.0  # it looks for requests as soon as it may
        stepped(forwarder, 2)  # twenty rows each
        assert counts(centre) == (40, 40)
        assert details(centre) == []
        stepped(forwarder, 10)
        assert counts(centre) == (60, 60)
        assert len(details(centre)) == 120


@pytest.mark.parametrize(
    ("pens", "since", "until", "reason"),
    [
        ((), 6 * HOUR_S, 7 * HOUR_S, "the cell has no values of this time any more"),
        (("/speed other",), 0, 60, ""),
    ],
)
def test_a_cell_says_why_it_sends_nothing(
    centre: Cluster, cell: CellData, pens: tuple[str, ...], since: float, until: float, reason: str
) -> None:
    if not reason:
        with pytest.raises(CentralError, match=r'no pen "/speed other": it has "/speed data"'):
            asked(centre, *pens, since=since, until=until)
        return
    asked(centre, *pens, since=since, until=until)
    send_all(config(centre), cell.folder)
    assert results(centre) == [("refused", 0, reason)]


def test_a_cell_that_sends_no_trends_sends_no_details(centre: Cluster, cell: CellData) -> None:
    asked(centre)
    send_all(config(centre, streams=("log",)), cell.folder)
    assert results(centre) == [("refused", 0, "this panel sends no such pen")]
    assert details(centre) == []


def test_more_than_the_bound_is_refused(cell: CellData, monkeypatch: pytest.MonkeyPatch) -> None:
    request = Request(1, (), START, START + 600, "ann")
    pens = [KnownPen(0, Pen(1, *SPEED))]
    assert Answer(cell.folder, request, pens).refusal == ""
    monkeypatch.setattr("app.cell.forward.details.MOST_VALUES", 599)
    refusal = Answer(cell.folder, request, pens).refusal
    assert refusal == "the cell has 600 values of this time, at most 599 are sent: ask for less"
    assert MOST_VALUES > 20 * 15_000, "a day of twenty pens"


def test_values_that_go_after_they_were_counted_are_not_done(cell: CellData) -> None:
    pens = [KnownPen(0, Pen(1, *SPEED))]
    answer = Answer(cell.folder, Request(1, (), START, START + 600, "ann"), pens)
    assert answer.refusal == ""
    (cell.folder / "trends.sqlite3").unlink()
    assert answer.batch(10) is None
    assert answer.refusal == "the cell has no values of this time any more"


def test_of_a_minute_the_finest_values_are_sent(cell: CellData) -> None:
    cell.trend([5.0] * 120, width=10)
    pens = [KnownPen(0, Pen(1, *SPEED))]
    answer = Answer(cell.folder, Request(1, ("/speed",), START, START + 1200, "ann"), pens)
    sent: list[int] = []
    while batch := answer.batch(50):
        answer.done(batch[1])
        sent += [detail.width for detail in batch[1]]
    assert sent == [1] * 600 + [10] * 60
    assert (answer.sent, answer.note) == (660, "a value each 1 s and 10 s")


def test_a_time_span_that_the_cell_s_clock_has_not_reached_waits(
    centre: Cluster, cell: CellData
) -> None:
    asked(centre)
    clock = [START + 120]
    with forwarding(config(centre), cell.folder) as forwarder:
        forwarder._now = lambda: clock[0]
        stepped(forwarder)
        assert results(centre) == [("open", 0, "")]
        clock[0] += 20
        forwarder._requests_at = 0.0  # the next look at requests
        stepped(forwarder)
        assert results(centre) == [("done", 120, "a value each 1 s")]


@pytest.mark.parametrize(
    ("panel", "since", "until", "reason"),
    [
        ("cell 9", 0, 60, 'there is no panel "cell 9" at the centre'),
        ("cell 1", 60, 60, "the time span ends before it begins"),
        ("cell 1", 0, 200 * HOUR_S, "the time span is not over yet"),
        ("cell 1", -200 * HOUR_S, 0, "the time span is longer than 7 days"),
    ],
)
def test_a_wrong_request_is_refused_at_once(
    centre: Cluster, cell: CellData, panel: str, since: float, until: float, reason: str
) -> None:
    with (
        pytest.raises(CentralError, match=reason),
        database(centre.config("ann")) as db,
    ):
        ask(db, panel, (), at(since), at(until))
    assert results(centre) == []


def test_a_panel_has_ten_open_requests_at_most(centre: Cluster, cell: CellData) -> None:
    for _ in range(10):
        asked(centre)
    with pytest.raises(CentralError, match="ten open requests"):
        asked(centre)
    send_all(config(centre), cell.folder)
    assert asked(centre) == 11


@pytest.mark.parametrize("user", ["grafana", "cell1"])
def test_only_an_asker_and_the_owner_can_ask(centre: Cluster, cell: CellData, user: str) -> None:
    with pytest.raises(KioskError, match="permission denied"):
        asked(centre, user=user)
    assert asked(centre, user="admin")


@pytest.mark.parametrize(
    ("user", "statement"),
    [
        ("grafana", "SELECT operator_panel.ask_details('cell 1', '{}', now(), now())"),
        ("grafana", "SELECT operator_panel.settle_request(1, 1, 'done', '', 0)"),
        ("ann", "SELECT operator_panel.settle_request(1, 1, 'done', '', 0)"),
        ("ann", "INSERT INTO operator_panel.detail_request (panel) VALUES (1)"),
        ("ann", "UPDATE operator_panel.detail_request SET status = 'done'"),
        ("ann", "DELETE FROM operator_panel.trend_detail"),
        ("cell1", "SELECT * FROM operator_panel.detail_request"),
        ("cell1", "UPDATE operator_panel.detail_request SET status = 'done'"),
        ("cell1", "SELECT * FROM operator_panel.trend_detail"),
        ("cell2", "INSERT INTO operator_panel.trend_detail VALUES (1, 0, 1, 1, now(), 1, 1, 1)"),
    ],
)
def test_rights_end_at_asking_and_sending(
    centre: Cluster, cell: CellData, user: str, statement: str
) -> None:
    asked(centre)
    refused = pytest.raises(psycopg.errors.InsufficientPrivilege)
    with centre.connect(user=user) as db, refused:
        db.execute(statement)


def test_another_cell_sees_and_ends_no_request(centre: Cluster, cell: CellData, tmp_path: Path) -> None:
    CellData(tmp_path / "other")
    send_all(config(centre, "cell2", panel="cell 2"), tmp_path / "other")
    asked(centre)
    assert query(centre, "SELECT * FROM operator_panel.open_requests(1)", user="cell2") == []
    assert query(centre, "SELECT * FROM operator_panel.known_pens(1)", user="cell2") == []
    query(centre, "SELECT operator_panel.settle_request(1, 1, 'done', '', 0)", user="cell2")
    assert results(centre) == [("open", 0, "")]
    assert len(query(centre, "SELECT * FROM operator_panel.open_requests(1)", user="cell1")) == 1


def test_details_go_with_their_trends(centre: Cluster, cell: CellData) -> None:
    asked(centre)
    send_all(config(centre), cell.folder)
    execute(centre, "UPDATE operator_panel.trend_detail SET at = at - interval '100 days'")
    execute(centre, "UPDATE operator_panel.detail_request SET settled_at = now() - interval '100 days'")
    with database(centre.config()) as db:
        assert prune(db, 60, STREAMS)["details"] == 120
    assert (details(centre), results(centre)) == ([], [])


@pytest.fixture
def version_1(postgres: Cluster, monkeypatch: pytest.MonkeyPatch) -> Cluster:
    """A centre of the version before, whose panels have sent rows."""
    new_database(postgres)
    add_logins(postgres, ann=ASKER)
    files = versions()
    with monkeypatch.context() as patch, database(postgres.config()) as db:
        patch.setattr("app.tools.central.schema.versions", lambda: {1: files[1]})
        assert upgrade(db, new=True)[:2] == (0, 1)
    return postgres


def test_an_upgrade_keeps_every_row_and_the_panel_goes_on(version_1: Cluster, tmp_path: Path) -> None:
    """A panel that is newer than the centre sends, and answers no request until it is upgraded."""
    cell = CellData(tmp_path)
    cell.press(20)
    cell.trend([float(number) for number in range(600)])
    with forwarding(config(version_1), tmp_path) as forwarder:
        assert stepped(forwarder, 4).fault == ""
        assert counts(version_1, "trends") == (10, 10)
        with pytest.raises(CentralError, match="version 1, requests need 2"):
            asked(version_1, user="admin")
        with database(version_1.config()) as db:
            before, after, made = upgrade(db, new=False)
        assert (before, after, made) == (1, 2, 14), "the months of the new table"
        cell.press(20)
        assert stepped(forwarder, 4).fault == ""
        assert counts(version_1) == (40, 40)
    asked(version_1)
    send_all(config(version_1), tmp_path)
    assert results(version_1) == [("done", 120, "a value each 1 s")]
    assert {name: counts(version_1, name)[0] for name in TABLES} == {
        "log": 40, "alarms": 0, "states": 0, "trends": 10, "recipes": 0, "health": 2,
    }  # fmt: skip
    months = "SELECT count(*) FROM operator_panel.trend_detail_default"
    assert query(version_1, months) == [(0,)]


def test_the_command_asks_and_lists(
    centre: Cluster, cell: CellData, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    settings = tmp_path / "central.toml"
    settings.write_text(
        f'[central]\nconnection = "{centre.string("ann")}"\n'
        f'password_file = "{centre.folder}/cell-password"\n'
    )

    def run(*words: str) -> tuple[int, str, str]:
        capsys.readouterr()
        status = central.main(["ask", *words, "--settings", str(settings)], "operator-panel central")
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    span = ("--from", at(0).isoformat(), "--until", at(60).isoformat())
    status, output, _ = run("--panel", "cell 1", *span, "--pen", "/speed")
    assert (status, output.partition(":")[0]) == (0, "request 1")
    assert run("--list")[1].endswith(": open\n")
    send_all(config(centre), cell.folder)
    status, output, _ = run("--list", "--panel", "cell 1")
    assert status == 0
    assert output.startswith('1 cell 1: "/speed" from ')
    assert ", asked by ann at " in output
    assert output.endswith(": done, 60 values: a value each 1 s\n")
    assert run("--list", "--panel", "cell 2")[:2] == (0, "")
    assert run("--panel", "cell 1")[::2] == (2, "ask needs --panel and --from, or --list\n")
    status, _, error = run("--panel", "cell 9", *span)
    assert (status, error) == (1, 'there is no panel "cell 9" at the centre\n')
    with pytest.raises(SystemExit):
        run("--panel", "cell 1", "--from", "noon")
    assert '"noon" is not a time, like 2027-01-20T10:00' in capsys.readouterr().err
