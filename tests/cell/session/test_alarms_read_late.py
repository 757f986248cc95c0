"""Alarms whose earlier records the disk gives late, or at a later try."""

import asyncio
import sqlite3
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest

from app.cell.alarms import store as disk
from app.cell.alarms.states import ActResult, AlarmStatus, Definition, acknowledge
from app.cell.alarms.store import AlarmStore
from app.cell.session import alarms as runtime
from app.cell.session.alarms import Alarms
from app.panel import load_panel
from app.records import NullLog
from app.system.texts import say
from tests.cell.alarms.test_engine import PANEL
from tests.support.builders import robot_there
from tests.support.waiting import when

RAISED = """
[[alarm]]
id = "air"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air pressure low"
low = 5.0
on_unknown = "raise"
[alarms]
panel = false
"""
Work = Callable[[Alarms], Awaitable[None]]


def run(folder: Path, work: Work) -> None:
    """Runs something with the alarms of a server, whose one alarm is raised as unknown."""
    (folder / "cell.toml").write_text(PANEL + RAISED)
    panel = load_panel(folder / "cell.toml")

    async def with_alarms() -> None:
        alarms = Alarms(panel)
        alarms.add_robot("", robot_there(panel))
        try:
            async with asyncio.timeout(60):
                await alarms.start(folder / "data", NullLog())
                await work(alarms)
        finally:
            await alarms.stop()

    asyncio.run(with_alarms())


def is_shown(alarms: Alarms) -> bool:
    return "air" in alarms.view()["rows"]


async def acknowledge_it(alarms: Alarms) -> None:
    def apply(status: AlarmStatus, definition: Definition) -> ActResult:
        return acknowledge(status, definition.rules, status.occurrence)

    await when(lambda: is_shown(alarms))
    alarms.engine.act("air", "acknowledge", apply, "Ann")
    assert await alarms.written(20.0)


def standing(folder: Path) -> str:
    with sqlite3.connect(folder / "data" / disk.NAME) as db:
        (record,) = db.execute("SELECT record FROM standing WHERE id = 'air'").fetchone()
    db.close()
    return str(record)


def test_no_alarm_is_evaluated_before_a_slow_disk_has_given_those_of_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(tmp_path, acknowledge_it)
    readable, read = threading.Event(), AlarmStore.standing

    def slow(store: AlarmStore) -> dict[str, str]:
        readable.wait(60.0)
        return read(store)

    monkeypatch.setattr(AlarmStore, "standing", slow)
    monkeypatch.setattr(runtime, "LOAD_TIMEOUT_S", 0.05)

    async def work(alarms: Alarms) -> None:
        alarms.evaluate()
        await when(lambda: alarms.view()["fault"] == say("alarms_not_read_yet"))
        assert not is_shown(alarms)
        readable.set()
        await when(lambda: is_shown(alarms))
        await when(lambda: alarms.view()["fault"] == "")
        assert alarms.view()["rows"]["air"]["acknowledged"]
        assert alarms.view()["rows"]["air"]["occurrence"] == 1

    try:
        run(tmp_path, work)
    finally:
        readable.set()


def test_records_that_are_read_after_the_disk_failed_are_merged_and_not_overwritten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(tmp_path, acknowledge_it)
    before = standing(tmp_path)
    tried: list[str] = []

    class FailsFirst(AlarmStore):
        def __init__(self, path: Path, *, days: float, size_mb: float) -> None:
            if not tried:
                tried.append("")
                raise sqlite3.OperationalError("disk I/O error")
            tried.append(standing(tmp_path))
            super().__init__(path, days=days, size_mb=size_mb)

    monkeypatch.setattr(disk, "AlarmStore", FailsFirst)

    async def work(alarms: Alarms) -> None:
        assert alarms.engine.has_begun
        await when(lambda: is_shown(alarms))
        assert not alarms.view()["rows"]["air"]["acknowledged"]
        await when(lambda: alarms.view()["rows"]["air"]["acknowledged"])
        assert await alarms.written(20.0)

    run(tmp_path, work)
    assert tried == ["", before]
    assert '"state": "acknowledged"' in standing(tmp_path)


def test_a_record_is_not_lost_by_a_kill_before_late_records_are_merged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(tmp_path, acknowledge_it)
    before = standing(tmp_path)
    tried: list[str] = []

    class FailsFirst(AlarmStore):
        def standing(self) -> dict[str, str]:
            if not tried:
                tried.append("")
                raise sqlite3.OperationalError("disk I/O error")
            return super().standing()

    monkeypatch.setattr(disk, "AlarmStore", FailsFirst)
    monkeypatch.setattr(Alarms, "_restore", lambda *_: None)  # it ends before

    async def work(alarms: Alarms) -> None:
        await when(lambda: bool(tried))
        assert await alarms.written(20.0)

    run(tmp_path, work)
    assert standing(tmp_path) == before
