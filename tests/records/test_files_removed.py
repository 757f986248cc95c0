"""The operator's log whose files are taken away while it runs: noticed before a press is sent."""

import asyncio
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from app.records import Entry, Filter, Limits, NullLog, OperatorLog
from app.records.data_dir import LOCK, DataDir
from app.records.database import NAME, rows
from app.records.verify import verify
from app.system.errors import FolderInUse, LogError
from tests.support.operator_log import pressed, run, sent, until_good
from tests.support.parts import ROOT, Server, until
from tests.support.waiting import when

LOGROTATE = f"{NAME}.1"
WAL = f"{NAME}-wal"


def entries(folder: Path) -> list[Entry]:
    """The oldest first."""
    return [row.entry for row in reversed(rows(folder, Filter(every=True), None, 10_000))]


async def until_locked(log: OperatorLog) -> None:
    await when(lambda: log.lock)


def removed(folder: Path) -> None:
    (folder / NAME).unlink()


def renamed(folder: Path) -> None:
    (folder / NAME).rename(folder / LOGROTATE)


def all_removed(folder: Path) -> None:
    for path in folder.glob(f"{NAME}*"):
        path.unlink()


def replaced(folder: Path) -> None:
    other = folder / "other"
    shutil.copy(folder / NAME, other)
    other.rename(folder / NAME)


def moved(folder: Path) -> None:
    folder.rename(folder.with_name("elsewhere"))


@pytest.mark.parametrize("take", [removed, renamed, all_removed, replaced, moved])
def test_no_press_is_sent_when_the_log_is_gone_and_the_new_log_records_that(
    tmp_path: Path, take: Callable[[Path], None]
) -> None:
    folder = tmp_path / "data"
    heads = []

    async def work(log: OperatorLog) -> None:
        first = await log.pressed(pressed(1))
        assert log.head is not None
        heads.append(log.head)
        take(folder)
        with pytest.raises(LogError, match=r"cannot be written: .* was removed or renamed"):
            await log.pressed(pressed(2))
        assert "was removed or renamed" in str(log.lock)
        log.add(sent(first))
        await until_good(log)
        await log.closed(sent(await log.pressed(pressed(3))))

    run(folder, work)
    (head,) = heads
    written = entries(folder)
    assert (written[0].kind, written[0].prev) == ("began", head.hash)
    assert json.loads(written[0].values) == {"first": written[0].seq} == {"first": head.seq + 1}
    assert f"up to entry {head.seq}, was removed or renamed" in written[0].reason
    assert [(e.kind, e.press) for e in written[1:]] == [
        ("closed", "p1"),
        ("resumed", ""),
        ("pressed", "p3"),
        ("closed", "p3"),
    ]
    assert verify(folder, head.hash).fault == ""


def test_renamed_log_has_all_written_entries(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        for number in range(20):
            await log.closed(sent(await log.pressed(pressed(number))))
        renamed(tmp_path)
        await until_locked(log)
        await until_good(log)

    run(tmp_path, work)
    apart = tmp_path / "apart"
    apart.mkdir()
    (tmp_path / LOGROTATE).rename(apart / NAME)
    verified = verify(apart)
    assert (verified.fault, verified.count) == ("", 41)
    assert verify(tmp_path, verified.head).fault == ""


def test_file_in_the_place_of_the_log_is_kept(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        await log.pressed(pressed(1))
        removed(tmp_path)
        (tmp_path / NAME).write_bytes(b"somebody's")
        await until_locked(log)
        await until_good(log)

    run(tmp_path, work)
    (kept,) = tmp_path.glob("operators-log.found-*.sqlite3")
    assert kept.read_bytes() == b"somebody's"
    assert kept.name in entries(tmp_path)[0].reason


def test_a_file_that_belongs_to_the_log_is_made_again_and_nothing_is_lost(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        await log.closed(sent(await log.pressed(pressed(1))))
        (tmp_path / WAL).unlink()
        await until_locked(log)
        await until_good(log)
        await log.pressed(pressed(2))

    run(tmp_path, work)
    verified = verify(tmp_path)
    assert (verified.fault, verified.count) == ("", 5)
    assert f"{WAL} was removed or renamed" in entries(tmp_path)[3].reason


def test_a_log_that_was_emptied_in_its_place_is_put_aside(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        await log.pressed(pressed(1))
        (tmp_path / NAME).open("wb").close()
        await until_locked(log)
        assert "the file was emptied" in str(log.lock)
        await until_good(log)

    run(tmp_path, work)
    assert verify(tmp_path).fault == ""
    assert entries(tmp_path)[0].seq == 3


def test_an_idle_server_notices_without_a_press(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        removed(tmp_path)
        await until_locked(log)

    run(tmp_path, work)


def test_a_lock_that_is_gone_is_taken_again_and_said(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        (tmp_path / LOCK).unlink()
        with pytest.raises(LogError, match=f"{LOCK} was removed or renamed"):
            await log.pressed(pressed(1))
        await until_good(log)
        await log.pressed(pressed(2))
        with pytest.raises(FolderInUse):
            DataDir(tmp_path).claim()

    run(tmp_path, work)
    assert f"{LOCK} was removed or renamed" in entries(tmp_path)[-2].reason
    assert verify(tmp_path).fault == ""


@pytest.mark.parametrize("required", [True, False])
def test_no_press_is_sent_while_another_server_has_the_folder(tmp_path: Path, required: bool) -> None:
    async def work(log: OperatorLog) -> None:
        (tmp_path / LOCK).unlink()
        other = DataDir(tmp_path)
        other.claim()
        with pytest.raises(LogError):
            await log.pressed(pressed(1))
        await when(lambda: "is in use by process" in str(log.lock))
        with pytest.raises(LogError, match="is in use by process"):
            await log.pressed(pressed(2))
        other.release()
        await until_good(log)
        assert await log.pressed(pressed(3))

    run(tmp_path, work, Limits(required=required))


def test_without_a_log_too_the_lock_is_looked_at(tmp_path: Path) -> None:
    async def work() -> None:
        log = NullLog(tmp_path)
        await log.start()
        assert await log.pressed(pressed(1)) is None
        (tmp_path / LOCK).unlink()
        assert await log.pressed(pressed(2)) is None  # taken again
        (tmp_path / LOCK).unlink()
        other = DataDir(tmp_path)
        other.claim()
        with pytest.raises(LogError, match="is in use by process"):
            await log.pressed(pressed(3))
        other.release()
        assert await log.pressed(pressed(4)) is None
        await log.stop()

    asyncio.run(work())


def test_a_server_sends_nothing_that_its_log_does_not_have(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(Server(ROOT, KIOSK_DATA=str(tmp_path)))
    until(kiosk.ready, "ready")
    assert kiosk.press("operation", "kept").json()["outcome"] == "published"

    def press_after_renaming() -> httpx.Response | None:
        """Answers if it is refused: the server may have noticed it by itself, and have a new log."""
        renamed(tmp_path)
        answer = kiosk.press("operation", "lost")
        return None if answer.status_code == 200 else answer

    refused = until(press_after_renaming, "a press is refused")
    assert (refused.status_code, refused.json()["outcome"]) == (503, "refused")
    assert f"{NAME} was removed or renamed" in refused.json()["reason"]
    until(lambda: kiosk.press("operation", "new").status_code == 200, "it opens again")
    assert "was removed or renamed while the server was running" in kiosk.http.get("/log").text
    logged = [json.loads(e.values).get("message") for e in entries(tmp_path) if e.kind == "pressed"]
    assert logged == ["new"]
    until(lambda: "new" in kiosk.widget("last_heard")["text"], "the robot has it")
    (tmp_path / LOCK).unlink()
    other = DataDir(tmp_path)
    other.claim()
    refused = kiosk.press("operation", "twice")
    assert refused.status_code == 503
    until(lambda: "is in use by process" in kiosk.snapshot()["notice"]["fault"], "it says who has it")
    other.release()
    until(lambda: kiosk.press("operation", "again").status_code == 200, "it has its folder again")
