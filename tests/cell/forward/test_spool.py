"""The forwarder's own file: minutes of trends, and what it keeps for how long."""

import math
import os
import sqlite3
from pathlib import Path

import pytest

from app.cell.forward.spool import (
    HEALTH_COLUMNS,
    Cursor,
    Minute,
    Pen,
    Spool,
    minutes,
    process_use,
    uptime_s,
)
from tests.support.cell_data import START, CellData

MINUTE = 60.0


def rows(folder: Path, table: str = "trend") -> list[tuple[float, ...]]:
    with sqlite3.connect(folder / "forward.sqlite3") as db:
        return db.execute(f"SELECT * FROM {table} ORDER BY seq").fetchall()


def test_a_minute_is_made_of_the_finest_values() -> None:
    fine = [(START + second, 1, second - 1.0, second + 1.0, float(second)) for second in range(60)]
    coarse = [(START, 10, -50.0, 50.0, 7.0), (START + 60, 10, 2.0, 9.0, 4.0)]
    made = list(minutes(sorted([*fine, *coarse])))
    assert made == [
        Minute(round(START), -1.0, 60.0, 29.5, 59.0, 60),
        Minute(round(START + 60), 2.0, 9.0, 4.0, 4.0, 1),
    ]
    assert list(minutes([(START, 1, math.nan, 1.0, 1.0), (START, 1, 1.0, math.inf, 1.0)])) == []


def test_minutes_are_made_once_and_when_they_are_over(tmp_path: Path) -> None:
    CellData(tmp_path).trend([float(n) for n in range(150)])
    spool = Spool(tmp_path)
    assert spool.make_minutes(START + 79) == 0  # the first minute's values may still come
    assert spool.make_minutes(START + 81) == 1
    assert spool.make_minutes(START + 81) == 0
    assert spool.make_minutes(START + 1000) == 2
    made = rows(tmp_path)
    assert [row[1] for row in made] == [round((START + 60 * n) * 1000) for n in range(3)]
    assert made[0][3:] == (-1.0, 60.0, 29.5, 59.0, 60)
    assert made[2][7] == 30
    assert spool.pens([1]) == [Pen(1, "", "/speed", "std_msgs/msg/Float64", "data")]
    spool.close()


def test_values_that_the_disk_took_late_make_their_minute(tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.trend([1.0] * 60)
    spool = Spool(tmp_path)
    assert spool.make_minutes(START + 7200) == 1
    cell.trend([2.0] * 60, start=START + 60)
    assert spool.make_minutes(START + 7260) == 1
    spool.close()


def test_a_clock_that_is_set_back_makes_minutes_again(tmp_path: Path) -> None:
    cell = CellData(tmp_path)
    cell.trend([1.0] * 600)
    spool = Spool(tmp_path)
    assert spool.make_minutes(START + 700) == 10
    cell.trend([2.0] * 60, start=START + 180)
    assert spool.make_minutes(START + 270) == 1
    assert [row[5] for row in rows(tmp_path)][-1] == 2.0
    spool.close()


def test_old_rows_go_by_age_and_by_size_sent_or_not(tmp_path: Path) -> None:
    CellData(tmp_path).trend([1.0] * 60 * 100)
    spool = Spool(tmp_path)
    spool.make_minutes(START + 10_000)
    spool.move("trends", Cursor(0, 3))
    assert spool.remove_old(35, 512, START + 10_000) == 0
    assert spool.remove_old(50 * 60 / 86_400, 512, START + 6000) == 50
    assert rows(tmp_path)[0][0] == 51
    assert spool.remove_old(35, 0.0, START + 6000) >= 40
    assert spool.cursor("trends") == Cursor(0, 3)
    assert spool.cursor("log") is None
    spool.close()


def test_health_has_all_its_columns(tmp_path: Path) -> None:
    spool = Spool(tmp_path)
    spool.add_health(START, dict.fromkeys(HEALTH_COLUMNS, 1))
    assert rows(tmp_path, "health") == [(1, round(START * 1000), *[1] * len(HEALTH_COLUMNS))]
    spool.close()


def test_a_process_is_measured() -> None:
    cpu_s, memory = process_use(os.getpid())
    assert cpu_s > 0
    assert memory > 10_000_000
    assert uptime_s(os.getpid()) > 0
    assert process_use(2**22 + 1) == (0.0, 0)
    assert uptime_s(2**22 + 1) == 0.0


@pytest.mark.parametrize("mode", [0o600])
def test_only_the_panel_s_user_reads_the_file(tmp_path: Path, mode: int) -> None:
    Spool(tmp_path).close()
    assert (tmp_path / "forward.sqlite3").stat().st_mode & 0o777 == mode
