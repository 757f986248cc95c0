"""Histories on disk: what a kill, a torn end, damage and a full disk leave of them."""

import asyncio
import logging
import math
import os
import shutil
import sqlite3
import threading
import time
from collections.abc import Coroutine
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.history import trends
from app.cell.history.trends import NAME, FieldName, TrendFile, TrendRecorder, TrendWriter
from app.cell.robot.history import Bucket, FieldHistory
from app.cell.robot.state import RobotState
from app.panel.model import Panel
from app.system.texts import render
from tests.support.builders import INTERFACES, Table, panel_of, robot_there
from tests.support.parts import ENOUGH_S
from tests.support.waiting import when

pytestmark = pytest.mark.promise("history")

FLOAT: Final = "std_msgs/msg/Float64"
PEN: Final[Table] = {"topic": "/speed", "type": FLOAT, "label": "Speed"}
TREND: Final[Table] = {"id": "course", "kind": "trend", "label": "Course", "pen": [PEN], "disk": True}
FIELD: Final[FieldName] = ("", "/speed", FLOAT, "data")
NOW: Final = 1_795_000_000.0


def buckets(count: int, first: int = 0) -> list[Bucket]:
    return [
        Bucket(NOW + n, n - 1.0, n + 1.0, float(n), gap=n == 0) for n in range(first, first + count)
    ]


def test_buckets_are_read_as_they_were_written(tmp_path: Path) -> None:
    file = TrendFile(tmp_path / "new")
    file.write({FIELD: {1: buckets(5), 10: buckets(2)}}, {}, NOW)
    file.close()
    again = TrendFile(tmp_path / "new")
    assert list(again.buckets(FIELD, 1, 0.0)) == buckets(5)
    assert list(again.buckets(FIELD, 1, NOW + 3)) == buckets(2, first=3)
    assert list(again.buckets(FIELD, 10, 0.0)) == buckets(2)
    assert not list(again.buckets(("", "/speed", FLOAT, "other"), 1, 0.0))
    again.close()


def test_a_bucket_that_has_grown_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    file = TrendFile(tmp_path)
    file.write({FIELD: {1: buckets(1)}}, {}, NOW)
    grown = buckets(1)[0]._replace(high=99.0)
    file.write({FIELD: {1: [grown]}}, {}, NOW)
    assert list(file.buckets(FIELD, 1, 0.0)) == [grown]
    file.close()


def test_the_file_has_an_end(tmp_path: Path) -> None:
    file = TrendFile(tmp_path)
    file.write({FIELD: {1: buckets(100)}}, {(FIELD, 1): 20.0}, NOW + 99)
    assert list(file.buckets(FIELD, 1, 0.0)) == buckets(21, first=79)
    file.remove_unused([], NOW + 32 * 86_400)
    assert not list(file.buckets(FIELD, 1, 0.0))
    file.close()


def killed_while_writing(folder: Path, copy: Path) -> Path:
    """A copy of the files as they are when the process is killed between two transactions."""
    file = TrendFile(folder)
    file.write({FIELD: {1: buckets(50)}}, {}, NOW)
    file.write({FIELD: {1: buckets(50, first=50)}}, {}, NOW)
    shutil.copytree(folder, copy)
    file.close()
    return copy / f"{NAME}-wal"


@pytest.mark.parametrize("torn", [1, 100, 4_000, 4_100])
def test_torn_end_is_dropped_and_earlier_samples_stay(tmp_path: Path, torn: int) -> None:
    wal = killed_while_writing(tmp_path / "a", tmp_path / "b")
    wal.write_bytes(wal.read_bytes()[:-torn])
    file = TrendFile(tmp_path / "b")
    stored = list(file.buckets(FIELD, 1, 0.0))
    assert stored in (buckets(50), buckets(100))
    assert stored == buckets(50) or torn > 4_000
    file.write({FIELD: {1: buckets(1, first=200)}}, {}, NOW)
    assert list(file.buckets(FIELD, 1, 0.0)) == [*stored, *buckets(1, first=200)]
    file.close()


class Cell:
    """A robot whose trend is kept on disk."""

    def __init__(self, folder: Path, panel: Panel | None = None) -> None:
        panel = panel or panel_of(TREND)
        self.robot: RobotState = robot_there(panel)
        TrendRecorder(panel, INTERFACES, self.robot)
        self.disk = TrendWriter(folder, panel)
        self.shown = 0
        self.disk.add("", self.robot, self._show)

    def _show(self) -> None:
        self.shown += 1

    @property
    def field(self) -> FieldHistory:
        return self.robot.history.fields["speed", "data"]

    def says(self, *values: float) -> None:
        for value in values:
            self.field.add(self.robot.history.time(time.monotonic()), value)

    def peaks(self) -> list[float]:
        now = time.time() + 10
        self.robot.history.set_clock(time.monotonic(), time.time())
        return [
            column.high for column in self.robot.history.columns(self.field, now - 3_600, now, 600.0)
        ]


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trends, "WRITE_EVERY_S", 0.02)
    for limit in ("LOAD_TIMEOUT_S", "STOP_TIMEOUT_S"):  # for a busy machine
        monkeypatch.setattr(trends, limit, ENOUGH_S)


def test_restart_finds_the_stored_history(tmp_path: Path) -> None:
    async def work() -> None:
        first = Cell(tmp_path)
        await first.disk.start()
        first.says(1.0, 5.0, 2.0)
        await first.disk.stop()
        second = Cell(tmp_path)
        await second.disk.start()
        assert max(second.peaks()) == 5.0
        second.says(7.0)
        await second.disk.stop()
        third = Cell(tmp_path)
        await third.disk.start()
        assert max(third.peaks()) == 7.0
        assert sorted(third.field.levels[0].high)[-2:] == [5.0, 7.0]
        assert list(third.field.levels[0].at) == sorted(third.field.levels[0].at)
        await third.disk.stop()

    run(work())


def newest_is(file: TrendFile, value: float) -> bool:
    return [bucket.high for bucket in file.buckets(FIELD, 600, 0.0)][-1:] == [value]


def test_growing_bucket_is_written_while_it_grows(tmp_path: Path) -> None:
    """A kill takes what is newer than the last transaction, whatever bucket it is in."""

    async def work() -> None:
        cell = Cell(tmp_path)
        await cell.disk.start()
        file = TrendFile(tmp_path)
        for value in (1.0, 2.0, 3.0):
            cell.says(value)
            await when(partial(newest_is, file, value))
        file.close()
        await cell.disk.stop()

    run(work())


def test_damaged_file_is_kept_beside_a_new_file(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    async def work() -> None:
        (tmp_path / NAME).write_bytes(b"no database " * 1_000)
        cell = Cell(tmp_path)
        await cell.disk.start()
        cell.says(4.0)
        await when(lambda: cell.shown and not cell.robot.history.fault)
        await cell.disk.stop()
        again = Cell(tmp_path)
        await again.disk.start()
        assert max(again.peaks()) == 4.0
        await again.disk.stop()

    run(work())
    (kept,) = tmp_path.glob("trends.damaged-*")
    assert kept.read_bytes().startswith(b"no database")
    assert f"it is kept as {kept.name}" in caplog.text


def test_while_the_disk_fails_trends_go_on_in_memory_and_nothing_is_left_out_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    whole = TrendFile.write
    full = [True]

    def write(self: TrendFile, *arguments: Any) -> None:
        if full[0]:
            error = sqlite3.OperationalError("database or disk is full")
            error.sqlite_errorname = "SQLITE_FULL"
            raise error
        whole(self, *arguments)

    monkeypatch.setattr(TrendFile, "write", write)

    async def work() -> None:
        cell = Cell(tmp_path)
        await cell.disk.start()
        cell.says(1.0)
        await when(lambda: cell.robot.history.fault)
        assert render(cell.robot.history.fault) == "Not kept on disk: no space left on device"
        tried = caplog.text.count("trends are not written")
        cell.says(9.0)
        await when(lambda: not cell.disk._busy)
        assert max(cell.peaks()) == 9.0
        assert tried == caplog.text.count("trends are not written") == 1
        full[0] = False
        await when(lambda: not cell.robot.history.fault)
        assert "again" in caplog.text
        await cell.disk.stop()
        again = Cell(tmp_path)
        await again.disk.start()
        assert max(again.peaks()) == 9.0
        await again.disk.stop()

    run(work())


def test_a_folder_that_cannot_be_made_is_a_fault_and_no_end(tmp_path: Path) -> None:
    async def work() -> None:
        (tmp_path / "file").write_text("")
        cell = Cell(tmp_path / "file" / "data")
        await cell.disk.start()
        cell.says(1.0)
        await when(lambda: cell.robot.history.fault)
        assert render(cell.robot.history.fault).startswith("Not kept on disk: ")
        await cell.disk.stop()

    run(work())


def test_a_disk_that_stands_still_does_not_keep_the_panel_from_its_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trends, "LOAD_TIMEOUT_S", 0.05)
    opened = TrendFile.__init__
    freed = threading.Event()

    def stands(self: TrendFile, folder: Path) -> None:
        assert freed.wait(ENOUGH_S)
        opened(self, folder)

    async def work() -> None:
        first = Cell(tmp_path)
        await first.disk.start()
        first.says(5.0)
        await first.disk.stop()
        monkeypatch.setattr(TrendFile, "__init__", stands)
        cell = Cell(tmp_path)
        await cell.disk.start()
        cell.says(1.0)
        assert max(cell.peaks()) == 1.0
        freed.set()
        await when(lambda: max(cell.peaks()) == 5.0)
        await cell.disk.stop()

    run(work())


def test_a_field_that_is_not_kept_on_disk_is_not_in_the_file(tmp_path: Path) -> None:
    async def work() -> None:
        other = {**PEN, "topic": "/other"}
        cell = Cell(tmp_path, panel_of(TREND, {**TREND, "id": "b", "disk": False, "pen": [other]}))
        await cell.disk.start()
        cell.says(1.0)
        await cell.disk.stop()
        with sqlite3.connect(tmp_path / NAME) as file:
            assert file.execute("SELECT topic FROM field").fetchall() == [("/speed",)]
        file.close()

    run(work())


@pytest.mark.parametrize("how", ["removed", "moved", "replaced", "emptied", "journal"])
def test_a_file_that_goes_while_it_is_written_is_begun_again_with_all_that_is_known(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    """Values of the run before and of this one, in several transactions."""
    caplog.set_level(logging.INFO)
    monkeypatch.setattr(trends, "MOST_ROWS", 2)
    folder = tmp_path / "data"
    path = folder / NAME
    now = time.time()
    before = [Bucket(now - 60 + n, 0.0, 5.0 + n, 0.0, gap=False) for n in range(7)]

    async def work() -> None:
        file = TrendFile(folder)
        file.write({FIELD: {1: before}}, {}, now)
        file.close()
        cell = Cell(folder)
        await cell.disk.start()
        cell.says(1.0)
        await when(lambda: path.with_name(f"{NAME}-wal").stat().st_size)
        go(path, how)
        cell.says(20.0)
        await when(lambda: cell.robot.history.fault)
        cell.says(21.0)
        await when(lambda: not cell.robot.history.fault)
        await cell.disk.stop()
        again = Cell(folder)
        await again.disk.start()
        kept = again.robot.history.fields["speed", "data"].levels[0]
        assert set(kept.high) >= {5.0 + n for n in range(7)}
        assert 21.0 in kept.high
        await again.disk.stop()

    run(work())
    assert caplog.text.count("trends are not written") == 1
    assert "are written to" in caplog.text


def go(path: Path, how: str) -> None:
    if how == "removed":
        path.unlink()
    elif how == "moved":
        path.rename(path.with_name("elsewhere"))
    elif how == "emptied":
        os.truncate(path, 0)
    elif how == "journal":
        path.with_name(f"{NAME}-wal").unlink()
    else:
        other = TrendFile(path.parent.parent / "other")
        other.close()
        other.path.replace(path)


@pytest.mark.parametrize("at", [1e300, NOW + 1e9, math.inf])
def test_values_far_in_the_future_are_dropped_at_the_start(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, at: float
) -> None:
    """Else no value would come after them."""
    file = TrendFile(tmp_path)
    rows = [Bucket(at, 0.0, 99.0, 0.0, gap=False), Bucket(time.time() - 5, 0.0, 3.0, 0.0, gap=False)]
    file.write({FIELD: {1: [*rows, rows[1]._replace(at=rows[1].at + 1, high=math.inf)]}}, {}, NOW)
    file.close()

    async def work() -> None:
        cell = Cell(tmp_path)
        await cell.disk.start()
        cell.says(7.0)
        assert max(cell.peaks()) == 7.0
        assert list(cell.field.levels[0].high) == [3.0, 7.0]
        await cell.disk.stop()

    run(work())
    assert "1 stored values are in the future" in caplog.text
