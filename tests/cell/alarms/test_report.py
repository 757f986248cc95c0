"""What a shift report is made of: shifts, alarms and the states of the machine."""

import json
import time
from itertools import pairwise
from pathlib import Path

import pytest

from app.cell.alarms.history import HistoryRow
from app.cell.alarms.report import (
    FREQUENT,
    HIGH,
    MAX_ROWS,
    NOT_RECORDED,
    Shift,
    StatePeriod,
    StateRow,
    close_states,
    read_report,
    read_states,
    shift_at,
    write_states,
)
from app.cell.alarms.store import AlarmStore

STARTS = ("06:00", "14:00", "22:00")
AT = 1_700_000_000.0


def at(text: str) -> float:
    return time.mktime(time.strptime(text, "%Y-%m-%d %H:%M"))


@pytest.mark.parametrize(
    ("now", "back", "since", "until"),
    [
        ("2026-11-26 15:20", 0, "2026-11-26 14:00", "2026-11-26 22:00"),
        ("2026-11-26 14:00", 0, "2026-11-26 14:00", "2026-11-26 22:00"),
        ("2026-11-26 15:20", 1, "2026-11-26 06:00", "2026-11-26 14:00"),
        ("2026-11-26 15:20", 2, "2026-11-25 22:00", "2026-11-26 06:00"),
        ("2026-11-26 01:00", 0, "2026-11-25 22:00", "2026-11-26 06:00"),
        ("2026-11-26 23:59", 0, "2026-11-26 22:00", "2026-11-27 06:00"),
        ("2026-03-01 03:00", 2, "2026-02-28 06:00", "2026-02-28 14:00"),
    ],
)
def test_a_shift_begins_and_ends_at_its_times(now: str, back: int, since: str, until: str) -> None:
    assert shift_at(at(now), STARTS, back) == Shift(at(since), at(until))


def test_one_start_makes_shifts_of_a_day() -> None:
    day = shift_at(at("2026-11-26 05:00"), ("06:00",), 1)
    assert day == Shift(at("2026-11-24 06:00"), at("2026-11-25 06:00"))


def event(
    after: float,
    alarm: str,
    name: str,
    lasted: float | None = None,
    priority: int = 2,
    number: int = 1,
) -> HistoryRow:
    record = json.dumps({"about": {"text": alarm}})
    return HistoryRow(
        AT + after, alarm, "active", number, "", "Ann", record, name, priority, "", "", lasted
    )


def test_alarms_are_counted_with_their_times(tmp_path: Path) -> None:
    store = AlarmStore(tmp_path / "a.sqlite3", days=1000, size_mb=8)
    store.write(
        [
            event(-5, "air", "raised"),
            event(0, "air", "returned", 5.0),
            event(10, "air", "raised"),
            event(20, "air", "returned", 10.0),
            event(30, "air", "raised", None),
            event(60, "air", "returned", 30.0),
            event(70, "door", "raised", None, 1, 4),
            event(80, "door", "acknowledged", 10.0, 1, 4),
            event(90, "door", "returned", 20.0, 1, 4),
            event(95, "door", "raised", None, 1, 5),
            event(100, "late", "raised"),
        ],
        {},
    )
    store.close()
    report = read_report(tmp_path / "a.sqlite3", AT, AT + 100)
    assert [(a.row.id, a.raises, a.active_s, a.longest_s) for a in report.frequent] == [
        ("air", 2, 45.0, 30.0),
        ("door", 2, 20.0, 20.0),
    ]
    first, second = report.high
    assert first.acknowledged is not None
    assert first.returned is not None
    assert (first.acknowledged.actor, first.acknowledged.lasted_s, first.returned.lasted_s) == (
        "Ann",
        10.0,
        20.0,
    )
    assert (second.acknowledged, second.returned, report.high_count) == (None, None, 2)


def test_a_report_has_room_for_a_page_and_counts_the_rest(tmp_path: Path) -> None:
    store = AlarmStore(tmp_path / "a.sqlite3", days=1000, size_mb=8)
    store.write([event(n, f"a{n}", "raised", None, 1) for n in range(50)], {})
    store.close()
    report = read_report(tmp_path / "a.sqlite3", AT, AT + 100)
    assert (len(report.frequent), len(report.high), report.high_count) == (FREQUENT, HIGH, 50)
    assert read_report(None, AT, AT + 1).frequent == []


def test_states_have_periods_within_the_time(tmp_path: Path) -> None:
    path = tmp_path / "states.sqlite3"
    rows = [StateRow(AT, "", "run"), StateRow(AT + 50, "", "fault"), StateRow(AT + 70, "", "run")]
    write_states(path, [*rows, StateRow(AT, "right", "wait")], [])
    assert read_states(path, "", AT + 20, AT + 100) == [
        StatePeriod(AT + 20, AT + 50, "run"),
        StatePeriod(AT + 50, AT + 70, "fault"),
        StatePeriod(AT + 70, AT + 100, "run"),
    ]
    assert read_states(path, "right", AT + 20, AT + 30) == [StatePeriod(AT + 20, AT + 30, "wait")]
    assert read_states(path, "", AT - 20, AT - 10) == []
    assert read_states(tmp_path / "none", "", AT, AT + 1) == []


def test_the_state_of_a_killed_server_ends_where_it_was_last_alive(tmp_path: Path) -> None:
    path = tmp_path / "states.sqlite3"
    close_states(path)
    assert not path.exists()
    write_states(path, [StateRow(AT, "", "run")], [("", AT + 30)])
    close_states(path)
    write_states(path, [StateRow(AT + 100, "", "run")], [])
    assert read_states(path, "", AT, AT + 120) == [
        StatePeriod(AT, AT + 30, "run"),
        StatePeriod(AT + 100, AT + 120, "run"),
    ]


def test_a_clock_that_is_set_back_counts_no_time_twice(tmp_path: Path) -> None:
    path = tmp_path / "states.sqlite3"
    rows = [StateRow(AT, "", "run"), StateRow(AT + 60, "", "fault"), StateRow(AT + 10, "", "wait")]
    write_states(path, [*rows, StateRow(AT + 80, "", NOT_RECORDED)], [])
    periods = read_states(path, "", AT, AT + 100)
    assert sum(until - since for since, until, _ in periods) <= 80
    assert all(first.until <= second.since for first, second in pairwise(periods))


def test_the_states_are_bounded(tmp_path: Path) -> None:
    path = tmp_path / "states.sqlite3"
    write_states(path, [StateRow(AT + n, "", f"{n % 2}") for n in range(MAX_ROWS + 100)], [])
    assert read_states(path, "", AT, AT + 200)[0].since >= AT + 100
