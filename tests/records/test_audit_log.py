"""The operator's log beside the event loop: it never blocks it, and says what it can't do."""

import asyncio
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import pytest

from app.records import Entry, Filter, Limits, OperatorLog, data_dir, writer
from app.records import log as audit_log
from app.records.database import rows
from app.records.store import Results, Store
from app.records.verify import verify
from app.system import disk_writer
from app.system.errors import FolderInUse, LogCorrupt, LogError
from app.system.process.shutdown import SHUTDOWN_TIMEOUT_S
from app.system.texts import render
from tests.support.operator_log import pressed, run, sent, until_good
from tests.support.parts import until
from tests.support.waiting import turns, when
from tests.support.words import english

pytestmark = pytest.mark.promise("log")

FREE = Limits(required=False)


def kinds(folder: Path) -> list[tuple[str, str, str]]:
    """(kind, press, outcome), the oldest first."""
    entries = [row.entry for row in rows(folder, Filter(every=True), None, 10_000)]
    return [(entry.kind, entry.press, entry.outcome) for entry in reversed(entries)]


async def until_commits(disk: "Disk", count: int) -> None:
    await when(lambda: disk.commits >= count)


class Disk:
    """The real file, with a disk that can be made slow, full or broken."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.open = threading.Event()
        self.open.set()
        self.syncing = threading.Event()
        self.syncing.set()
        self.fails: LogError | None = None
        self.sync_fails: LogError | None = None
        self.commits = 0
        self.syncs = 0
        append, sync = Store.append, Store.sync

        def appended(store: Store, entries: Sequence[Entry]) -> list[Entry]:
            self.commits += 1
            self.open.wait(10)
            if self.fails:
                raise self.fails
            return append(store, entries)

        def synced(store: Store) -> None:
            self.syncs += 1
            self.syncing.wait(10)
            if self.sync_fails:
                raise self.sync_fails
            sync(store)

        monkeypatch.setattr(Store, "append", appended)
        monkeypatch.setattr(Store, "sync", synced)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    mine = Disk(monkeypatch)
    yield mine
    mine.open.set()
    mine.syncing.set()


def test_a_press_and_its_outcome_are_in_the_file(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        entry = await log.pressed(pressed())
        assert kinds(tmp_path) == [("began", "", ""), ("pressed", "p1", "")]
        assert await log.closed(sent(entry)) == ""
        assert kinds(tmp_path)[-1] == ("closed", "p1", "published")

    run(tmp_path, work)
    assert verify(tmp_path).fault == ""


def test_waiting_entries_are_written_before_shutdown(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        entry = await log.pressed(pressed())
        log.add(sent(entry))

    run(tmp_path, work)
    assert kinds(tmp_path)[-1] == ("closed", "p1", "published")


def test_no_press_waits_for_the_sync_of_another(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        entry, before = await log.pressed(pressed(1)), disk.syncs
        disk.syncing.clear()
        first = asyncio.create_task(log.closed(sent(entry)))
        await when(lambda: disk.syncs != before)
        await log.pressed(pressed(2))
        assert not first.done()
        disk.syncing.set()
        assert await first == ""

    run(tmp_path, work)


def test_concurrent_entries_share_a_commit_and_a_sync(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        disk.open.clear()
        disk.commits = disk.syncs = 0
        presses = [asyncio.create_task(log.pressed(pressed(n))) for n in range(100)]
        await turns()
        disk.open.set()
        entries = await asyncio.gather(*presses)
        assert [entry.press for entry in entries if entry] == [f"p{n}" for n in range(100)]
        assert disk.commits <= 3
        assert await asyncio.gather(*(log.closed(sent(e)) for e in entries)) == [""] * 100
        assert disk.syncs <= 10

    run(tmp_path, work)
    assert verify(tmp_path).count == 201


SHIPPED: Final = (audit_log.PRESSED_WITHIN_S, audit_log.CLOSED_WITHIN_S)  # before tests change them


def test_all_waits_for_the_disk_end_before_a_shutdown_does() -> None:
    assert SHIPPED == (2.0, 3.0)
    assert sum(SHIPPED) + audit_log.ENDED_WITHIN_S < SHUTDOWN_TIMEOUT_S


def test_a_result_does_not_wait_for_a_disk_that_hangs(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_log, "CLOSED_WITHIN_S", 0.1)

    async def work(log: OperatorLog) -> None:
        entry = await log.pressed(pressed(1))
        disk.open.clear()
        assert "the disk did not store the entry" in str(await log.closed(sent(entry)))
        disk.open.set()

    run(tmp_path, work)
    assert kinds(tmp_path)[1:] == [("pressed", "p1", ""), ("closed", "p1", "published")]


@pytest.mark.long("real time")
def test_a_disk_that_hangs_blocks_no_loop_and_locks(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_log, "PRESSED_WITHIN_S", 0.5)
    changes: list[str] = []

    async def work(log: OperatorLog) -> None:
        with log.notifying(lambda: changes.append(str(log.lock))):
            disk.open.clear()
            with pytest.raises(LogError, match=r"cannot be written: the disk did not store .* 0\.5 s"):
                await log.pressed(pressed(1))
            began = time.monotonic()
            with pytest.raises(LogError):
                await log.pressed(pressed(2))
            assert time.monotonic() - began < 0.4
            assert "the disk did not store the entry" in str(log.lock)
            disk.open.set()
            await until_good(log)
            await log.pressed(pressed(3))
        assert changes[-1] == ""
        assert len(changes) == 2

    run(tmp_path, work)
    # The one that came late was not sent, and the log says so; the other never was in it.
    assert kinds(tmp_path)[1:] == [
        ("pressed", "p1", ""),
        ("closed", "p1", "refused"),
        ("pressed", "p3", ""),
    ]


def test_a_press_that_no_client_waits_for_any_more_is_closed(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        disk.open.clear()
        before = disk.commits
        task = asyncio.create_task(log.pressed(pressed(1)))
        await until_commits(disk, before + 1)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        disk.open.set()
        await until_commits(disk, before + 2)

    run(tmp_path, work)
    assert kinds(tmp_path)[1:] == [("pressed", "p1", ""), ("closed", "p1", "refused")]


def test_press_cancelled_during_its_write_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    presses: list[asyncio.Task[Entry | None]] = []
    deliver = OperatorLog._deliver_results

    def deliver_too_late(log: OperatorLog, results: Results, changed: bool) -> None:
        deliver(log, results, changed)
        for press in presses:
            press.cancel()

    async def work(log: OperatorLog) -> None:
        monkeypatch.setattr(OperatorLog, "_deliver_results", deliver_too_late)
        presses.append(asyncio.create_task(log.pressed(pressed(1))))
        (cancelled,) = await asyncio.gather(*presses, return_exceptions=True)
        assert isinstance(cancelled, asyncio.CancelledError)

    run(tmp_path, work)
    assert kinds(tmp_path)[1:] == [("pressed", "p1", ""), ("closed", "p1", "refused")]


def test_too_many_at_once_are_refused_in_words(
    tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "MOST_WAITING", 10)

    async def work(log: OperatorLog) -> None:
        disk.open.clear()
        before = disk.commits
        presses = [asyncio.create_task(log.pressed(pressed(0)))]
        await until_commits(disk, before + 1)  # the writer has this one, and takes no other
        presses += [asyncio.create_task(log.pressed(pressed(n))) for n in range(1, 50)]
        await when(lambda: sum(press.done() for press in presses) >= 39)
        disk.open.set()
        results = await asyncio.gather(*presses, return_exceptions=True)
        refused = [result for result in results if isinstance(result, LogError)]
        assert len(refused) == 39
        assert "presses arrive faster than the disk can store them" in str(refused[0])
        assert log.fault == ""

    run(tmp_path, work)


def test_unwritten_result_of_a_sent_press_is_written_later(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        entry = await log.pressed(pressed(1))
        disk.fails = LogError("no space left on device")
        assert await log.closed(sent(entry)) == "no space left on device"
        assert english(log.lock) == "The operator's log cannot be written: no space left on device."
        with pytest.raises(LogError, match="no space left"):
            await log.pressed(pressed(2))
        disk.fails = None
        await until_good(log)
        await log.pressed(pressed(3))

    run(tmp_path, work)
    assert kinds(tmp_path)[1:] == [
        ("pressed", "p1", ""),
        ("closed", "p1", "published"),
        ("resumed", "", ""),
        ("pressed", "p3", ""),
    ]
    assert verify(tmp_path).fault == ""


def test_receipt_says_that_an_entry_may_not_be_on_disk(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        entry = await log.pressed(pressed(1))
        disk.sync_fails = LogError("input/output error")
        assert await log.closed(sent(entry)) == "input/output error"
        await when(lambda: log.lock)
        disk.sync_fails = None
        await until_good(log)
        assert await log.closed(sent(await log.pressed(pressed(2)))) == ""

    run(tmp_path, work)
    assert verify(tmp_path).fault == ""


def test_pauses_between_write_attempts_grow(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        disk.fails, began = LogError("no space left on device"), time.monotonic()
        await asyncio.gather(log.pressed(pressed(1)), return_exceptions=True)
        disk.commits = 0
        await when(lambda: disk.commits >= 2)  # after 0.5 s and 1 s more
        assert time.monotonic() - began >= 1.4

    run(tmp_path, work)
    assert disk_writer.RETRY_DELAYS_S[-1] <= 10


def test_where_the_log_is_not_required_presses_go_on(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        disk.fails = LogError("no space left on device")
        assert await log.pressed(pressed(1)) is None
        assert log.lock == ""
        assert english(log.fault) == (
            "The operator's log cannot be written, so nothing is logged: no space left on device."
        )
        disk.fails = None
        await until_good(log)
        assert await log.pressed(pressed(2)) is not None

    run(tmp_path, work, FREE)
    assert [press for kind, press, _ in kinds(tmp_path) if kind == "pressed"] == ["p2"]


def test_damage_while_it_runs_begins_a_new_log_whose_numbers_go_on(tmp_path: Path, disk: Disk) -> None:
    async def work(log: OperatorLog) -> None:
        entry = await log.pressed(pressed(1))
        disk.fails = LogCorrupt("the file is damaged")
        assert "damaged" in str(await log.closed(sent(entry)))
        disk.fails = None
        await until_good(log)

    run(tmp_path, work)
    (aside,) = tmp_path.glob("*damaged*.sqlite3")
    assert aside.stat().st_size > 0
    entries = [row.entry for row in rows(tmp_path, Filter(every=True), None, 10)]
    assert [(e.seq, e.kind, e.of) for e in reversed(entries)][:2] == [
        (3, "began", None),
        (4, "closed", 2),
    ]
    assert aside.name in entries[-1].reason
    assert verify(tmp_path).fault == ""


def test_garbage_at_the_start_is_put_aside_and_said(tmp_path: Path) -> None:
    (tmp_path / "operators-log.sqlite3").write_bytes(b"garbage" * 1000)

    async def work(log: OperatorLog) -> None:
        assert log.fault == ""
        await log.pressed(pressed(1))

    run(tmp_path, work)
    (aside,) = tmp_path.glob("*damaged*")
    assert aside.read_bytes() == b"garbage" * 1000
    assert verify(tmp_path).fault == ""


def test_the_error_of_the_disk_reads_in_the_readers_language(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    async def work(log: OperatorLog) -> None:
        where = tmp_path / "file"
        german = f"Das Bedienprotokoll kann nicht geschrieben werden: kein Ordner ({where})."
        assert render(log.lock, "de") == german

    run(tmp_path / "file", work)


def test_missing_data_folder_locks_until_it_can_be_created(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")

    async def work(log: OperatorLog) -> None:
        where = tmp_path / "file"
        assert english(log.lock) == f"The operator's log cannot be written: not a folder ({where})."
        assert log.head is None
        (tmp_path / "file").unlink()
        await until_good(log)
        await log.pressed(pressed(1))

    run(tmp_path / "file/data", work)
    assert verify(tmp_path / "file/data").count == 3


def test_a_second_log_waits_for_the_first_to_end_and_then_gives_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work(log: OperatorLog) -> None:
        second = OperatorLog(tmp_path, Limits())
        monkeypatch.setattr(data_dir, "HELD_BY_OTHER_S", 0.3)
        with pytest.raises(FolderInUse, match="is in use by process"):
            await second.start()
        monkeypatch.setattr(data_dir, "HELD_BY_OTHER_S", 5.0)
        starting = asyncio.create_task(second.start())
        await turns()
        assert not starting.done()
        await log.stop()
        await starting
        assert second.fault == ""
        await second.stop()

    run(tmp_path, work)


def test_no_thread_is_left(tmp_path: Path) -> None:
    async def work(log: OperatorLog) -> None:
        await log.rows(Filter(), None, 10)

    def left() -> list[str]:
        return [t.name for t in threading.enumerate() if t.name.startswith("operators-log")]

    run(tmp_path, work)
    until(lambda: not left(), "an idle reader ends a moment later")
