"""What the forwarder reads of each store of the cell."""

from pathlib import Path

import pytest

from app.cell.forward import streams
from app.cell.forward.spool import HEALTH_COLUMNS, Spool
from app.cell.forward.streams import STREAMS, entry_of, time_of
from app.records.entry import new_entry
from app.system.errors import LogError
from tests.support.cell_data import START, CellData


def named(name: str, values: tuple[object, ...]) -> dict[str, object]:
    return dict(zip(STREAMS[name].columns, values, strict=True))


def test_entries_are_read_as_they_were_signed(tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.press(5)
    cell.sign()
    stream = STREAMS["log"]
    rows = stream.rows(tmp_path, 0, 99, 4)
    assert [row.seq for row in rows] == [1, 2, 3, 4]
    assert stream.ends(tmp_path) == (1, 6)
    entries = [entry_of(row.values, row.seq) for row in stream.rows(tmp_path, 0, 99, 99)]
    assert all(entry.hash == entry.computed_hash() for entry in entries)
    assert stream.before(tmp_path, 1) == entries[0].prev
    assert stream.row_before(tmp_path, 99) == (
        6,
        rows[0].mark._replace(at=entries[-1].at, hash=entries[-1].hash),
    )
    assert stream.row_before(tmp_path, 0) is None
    backlog = stream.backlog(tmp_path, 2)
    assert (backlog.rows, backlog.oldest) == (4, round((START + 3) * 1000))
    assert backlog.size > 4 * 200


def test_alarms_have_their_texts_and_values(tmp_path: Path) -> None:
    CellData(tmp_path).alarm(2)
    first, _ = STREAMS["alarms"].rows(tmp_path, 0, 99, 99)
    about = named("alarms", first.values)
    assert about["text"] == "Air 1 low"
    assert (about["value"], about["limit"], about["priority"], about["event"]) == (
        4.5,
        5.0,
        2,
        "raised",
    )
    assert first.mark.at == round((START + 1) * 1000)


def test_states_say_when_nothing_was_recorded(tmp_path: Path) -> None:
    CellData(tmp_path).states(["Running", "", "Stopped"])
    rows = [named("states", row.values) for row in STREAMS["states"].rows(tmp_path, 0, 99, 99)]
    assert [(row["state"], row["recorded"]) for row in rows] == [
        ("Running", True), ("", False), ("Stopped", True),
    ]  # fmt: skip


def test_recipes_are_the_entries_of_the_log_that_changed_them(tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.press(3)
    cell.add(new_entry("recipe", values={"new": 1}, action="save", widget="boxes/small", who="Ann"))
    cell.press(3)
    stream = STREAMS["recipes"]
    (row,) = stream.rows(tmp_path, 0, 99, 99)
    assert (row.seq, named("recipes", row.values)["object"]) == (4, "boxes/small")
    assert stream.ends(tmp_path) == (4, 4)
    assert stream.row_before(tmp_path, 7) == (4, row.mark)
    assert not stream.dense


@pytest.mark.parametrize("name", STREAMS)
def test_a_store_that_is_not_there_has_no_rows(tmp_path: Path, name: str) -> None:
    stream = STREAMS[name]
    assert stream.ends(tmp_path) == (0, 0)
    assert stream.rows(tmp_path, 0, 99, 99) == []
    assert stream.row_before(tmp_path, 99) is None
    assert stream.backlog(tmp_path, 0) == streams.Backlog()
    assert stream.before(tmp_path, 1) == ""


def test_a_store_that_is_damaged_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "alarms.sqlite3").write_text("no database, and longer than a header of one" * 10)
    with pytest.raises(LogError, match="damaged"):
        STREAMS["alarms"].ends(tmp_path)


def test_a_batch_of_long_rows_has_fewer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    CellData(tmp_path).press(10)
    monkeypatch.setattr(streams, "MOST_BYTES", 1000)
    rows = STREAMS["log"].rows(tmp_path, 0, 99, 99)
    assert 1 <= len(rows) < 9
    assert sum(row.size for row in rows) <= 1000


def test_what_postgresql_has_no_value_for_is_replaced(tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.add(new_entry("recipe", widget="a\0b", action="save")._replace(at=10**18))
    (row,) = STREAMS["recipes"].rows(tmp_path, 0, 99, 99)
    assert "\0" not in str(named("recipes", row.values)["object"])
    assert time_of(row.mark.at).year == 2200


def test_all_streams_have_a_column_for_each_value(tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.press(1)
    cell.alarm(1)
    cell.states(["Running"])
    cell.trend([1.0] * 60)
    cell.add(new_entry("recipe", action="save"))
    spool = Spool(tmp_path)
    spool.make_minutes(START + 100)
    spool.add_health(START, dict.fromkeys(HEALTH_COLUMNS, 1))
    spool.close()
    for stream in STREAMS.values():
        (*_, row) = stream.rows(tmp_path, 0, 99, 99)
        assert len(row.values) == len(stream.columns)
