"""The history of alarms: searched and paged by its numbers, exported, and bounded."""

import asyncio
import csv
import io
import json
import time
from pathlib import Path
from typing import Any

import pytest

from app.cell.alarms.export import FIELDS, export
from app.cell.alarms.history import (
    MAX_PAGE,
    HistoryFilter,
    HistoryRow,
    event_of,
    lasted,
    read_history,
    read_page,
)
from app.cell.alarms.states import NORMAL, AlarmRules, AlarmStatus, Moment, acknowledge, update_level
from app.cell.alarms.store import (
    MIN_REMOVED,
    NAME,
    TIDY_AFTER,
    AlarmDisk,
    AlarmStore,
    DiskEvents,
    RecordChange,
)
from app.panel.alarm import AlarmRules as Rules
from app.system.texts import PanelText

AT = 1_700_000_000.0
DAY_S = 86_400.0
MANY = 100_000
RULES = AlarmRules()


def row(number: int, at: float = AT, **changed: Any) -> HistoryRow:
    text = PanelText({"en": f"Pump {number}", "ja": f"ポンプ {number}"}, "en").as_json()
    record = json.dumps(
        {"about": {"text": text, "group": "Air", "unit": "bar"}, "value": number}, ensure_ascii=False
    )
    made = HistoryRow(at, f"pump{number}", "active", 1, "", "", record, "raised", 2, "left", "Air")
    return made._replace(**changed)


def store_with(folder: Path, rows: list[HistoryRow], days: float = 1000, size_mb: float = 64) -> Path:
    store = AlarmStore(folder / "alarms.sqlite3", days=days, size_mb=size_mb)
    store.write(rows, {})
    store.close()
    return folder / "alarms.sqlite3"


def numbers(path: Path, **wanted: Any) -> list[int]:
    chosen = HistoryFilter()._replace(**wanted)
    return [hit.seq for hit in read_history(path, chosen)]


def test_each_part_of_a_filter_selects_its_rows(tmp_path: Path) -> None:
    path = store_with(
        tmp_path,
        [
            row(1),
            row(2, AT + 60, priority=1, group="Oil", robot="right"),
            row(3, AT + 120, act="acknowledge", actor="Ann", event="acknowledged"),
        ],
    )
    assert numbers(path) == [3, 2, 1]
    assert (
        numbers(path, priority=1) == numbers(path, group="Oil") == numbers(path, robot="right") == [2]
    )
    assert numbers(path, alarm="pump3") == numbers(path, text="ann") == [3]
    assert numbers(path, since=AT + 60, until=AT + 120) == [2]
    assert numbers(path, before=3, priority=2) == [1]


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("pump 2", 1),
        ("ポンプ", 3),
        ("PUMP3", 1),
        ("bar", 3),
        ("code", 0),
        ("params", 0),
        ("%", 0),
        ('"', 0),
    ],
)
def test_a_text_is_searched_in_all_languages_and_in_no_keys(
    tmp_path: Path, text: str, rows: int
) -> None:
    path = store_with(tmp_path, [row(1), row(2), row(3)])
    assert len(numbers(path, text=text)) == rows


def test_a_quote_in_a_text_is_found(tmp_path: Path) -> None:
    record = json.dumps({"about": {"text": 'Door "A" \\ open'}})
    path = store_with(tmp_path, [row(1), row(2, record=record)])
    assert numbers(path, text='"A" \\') == [2]


@pytest.mark.long("flood")
def test_pages_of_100_000_rows_have_each_row_once_and_come_at_once(tmp_path: Path) -> None:
    path = store_with(tmp_path, [row(n, AT + n, priority=1 + n % 4) for n in range(MANY)], size_mb=512)
    begun = time.monotonic()
    page = read_page(path, HistoryFilter(priority=3), 50)
    took = time.monotonic() - begun
    assert (page.total, page.newer, len(page.rows)) == (MANY // 4, 0, 50)
    assert took < 5, took
    seen: list[int] = []
    before = 2**62
    while rows := read_history(path, HistoryFilter(before=before, priority=3), MAX_PAGE):
        seen += [hit.seq for hit in rows]
        before = seen[-1]
    assert len(seen) == MANY // 4
    assert seen == sorted(set(seen), reverse=True)
    deep = read_page(path, HistoryFilter(before=seen[-50], priority=3), 50)
    assert (deep.newer, [hit.seq for hit in deep.rows]) == (MANY // 4 - 49, seen[-49:])
    searched = read_page(path, HistoryFilter(text="ポンプ 77777"), 50)
    assert [hit.id for hit in searched.rows] == ["pump77777"]


def test_a_clock_that_was_set_back_keeps_the_order_and_the_row_says_so(tmp_path: Path) -> None:
    store = AlarmStore(tmp_path / "alarms.sqlite3", days=1000, size_mb=8)
    store.write([row(1, AT), row(2, AT - 3600), row(3, AT - 3599.5), row(4, AT - 3600)], {})
    store.close()
    store = AlarmStore(tmp_path / "alarms.sqlite3", days=1000, size_mb=8)
    store.write([row(5, AT - 7200)], {})
    store.close()
    page = read_page(tmp_path / "alarms.sqlite3", HistoryFilter(), 50)
    assert [(hit.seq, hit.clock_back_s) for hit in page.rows] == [
        (5, 3600),
        (4, 0),
        (3, 0),
        (2, 3600),
        (1, 0),
    ]
    assert page.set_back
    assert not read_page(tmp_path / "alarms.sqlite3", HistoryFilter(since=AT - 10), 50).set_back


def test_a_file_of_an_earlier_version_goes_on(tmp_path: Path) -> None:
    path = store_with(tmp_path, [])
    store = AlarmStore(path, days=1000, size_mb=8)
    store._db.executescript(
        "DROP TABLE history; CREATE TABLE history (seq INTEGER PRIMARY KEY AUTOINCREMENT,"
        " at REAL NOT NULL, id TEXT NOT NULL, state TEXT NOT NULL, occurrence INTEGER NOT NULL,"
        " act TEXT NOT NULL, actor TEXT NOT NULL, record TEXT NOT NULL);"
        f"INSERT INTO history VALUES (1, {AT}, 'air', 'active', 1, '', '', '{{}}')"
    )
    store.close()
    store = AlarmStore(path, days=1000, size_mb=8)
    store.write([row(2, AT - 60)], {})
    store.close()
    newest, oldest = read_history(path)
    assert (oldest.id, oldest.event, newest.clock_back_s) == ("air", "", 60)


def test_a_wrong_clock_removes_not_the_whole_history(tmp_path: Path) -> None:
    store = AlarmStore(tmp_path / "alarms.sqlite3", days=1, size_mb=64)
    store.write([row(n) for n in range(5 * MIN_REMOVED)], {})
    assert store.remove_old(AT + 365 * DAY_S) == MIN_REMOVED
    assert store.remove_old(AT) == 0


def test_a_flood_is_bounded_before_the_next_time_to_tidy(tmp_path: Path) -> None:
    async def flood() -> None:
        def ignored(*_: object) -> None: ...

        disk = AlarmDisk(tmp_path, Rules(size_mb=1), DiskEvents(*[ignored] * 5))
        disk.open()
        disk.tidy(quiet=True)
        large = json.dumps({"about": {"text": "x" * 1000}})
        disk.write([RecordChange(n, "", row(n, record=large), None) for n in range(TIDY_AFTER)])
        disk.tidy(quiet=False)
        disk.close(None)

    asyncio.run(flood())
    assert len(numbers(tmp_path / NAME)) == MAX_PAGE
    assert read_page(tmp_path / NAME, HistoryFilter(), 1).total < 1000
    assert (tmp_path / NAME).stat().st_size < 8e6


def raised(at: float) -> AlarmStatus:
    return update_level(NORMAL, RULES, 1, Moment(at, at))


def test_each_transition_has_a_name_and_how_long_it_lasted() -> None:
    at = Moment(30.0, 30.0)
    first = raised(20.0)
    known = update_level(first, RULES, None, at)
    returned = update_level(first, RULES, 0, at)
    acknowledged = acknowledge(first, RULES, 1).status
    assert event_of(NORMAL, first) == "raised"
    assert event_of(first, returned) == "returned"
    assert event_of(first, acknowledged, "acknowledge") == "acknowledged"
    assert event_of(first, known) == "unknown"
    assert event_of(known, first) == "known"
    assert event_of(returned, update_level(returned, RULES, 1, at)) == "raised"
    assert (lasted(NORMAL, first, at), lasted(first, returned, at)) == (None, 10.0)


def test_the_csv_has_all_rows_in_the_readers_language(tmp_path: Path) -> None:
    formula = row(601, act="shelve", actor="=1+1", event="shelved")
    path = store_with(tmp_path, [row(n, lasted_s=1.5) for n in range(601)] + [formula])
    text = b"".join(export(path, HistoryFilter(), False, "ja")).decode()
    assert text.startswith("\ufeff")
    rows = list(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"))))
    assert len(rows) == 602
    assert tuple(rows[0]) == FIELDS
    assert (rows[0]["who"], rows[1]["text"]) == ("'=1+1", "ポンプ 600")
    assert (rows[1]["value"], rows[1]["unit"], rows[1]["lasted_s"]) == ("600", "bar", "1.5")
    assert rows[1]["at"] == "2023-11-14T22:13:20.000+00:00"


def test_without_a_file_there_is_no_history(tmp_path: Path) -> None:
    assert read_page(None, HistoryFilter(), 50).rows == []
    assert read_history(tmp_path / "none") == []
