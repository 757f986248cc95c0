"""One thread writes to a file: in batches, in order, again after errors, and within its limits."""

import asyncio
import math
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise

import pytest

from app.system import disk_writer
from app.system.disk_writer import REST_S, DiskWriter
from app.system.errors import LogError
from tests.support.parts import ENOUGH_S, until


class TextFile:
    """A `DiskFile` in memory: `fails` is what opening and writing raise."""

    def __init__(self) -> None:
        self.fails: Exception | None = None
        self.go_on = threading.Event()  # else a write waits
        self.go_on.set()
        self.writing = threading.Event()
        self.batches: list[list[str]] = []
        self.refused: list[tuple[str, str]] = []
        self.events: list[str] = []
        self.times: list[float] = []  # of each write, in monotonic seconds

    def open(self) -> None:
        self.events.append("open")
        if self.fails is not None:
            raise self.fails

    def write(self, items: Sequence[str]) -> None:
        self.writing.set()
        assert self.go_on.wait(ENOUGH_S)
        if self.fails is not None:
            raise self.fails
        self.batches.append([*items])
        self.times.append(time.monotonic())

    def refuse(self, items: Sequence[str], error: LogError) -> None:
        self.refused += [(item, str(error)) for item in items]

    def tidy(self, quiet: bool) -> None:
        self.events.append("quiet" if quiet else "tidy")

    def idle_s(self) -> float:
        return math.inf

    def close(self, error: LogError | None) -> None:
        self.events.append("end" if error is None else "close")

    @property
    def written(self) -> list[str]:
        return [item for batch in self.batches for item in batch]

    def block(self) -> None:
        self.go_on.clear()
        self.writing.clear()


Start = Callable[..., DiskWriter[str]]
FULL = LogError("no space left on device")


@pytest.fixture
def file() -> TextFile:
    return TextFile()


@pytest.fixture
def start(file: TextFile, monkeypatch: pytest.MonkeyPatch) -> Iterator[Start]:
    monkeypatch.setattr(disk_writer, "RETRY_DELAYS_S", (0.01, 0.02))
    writers: list[DiskWriter[str]] = []

    def started(
        *, most: int = 100, batch_most: int | None = None, keep: bool = False, rests: bool = False
    ) -> DiskWriter[str]:
        writer = DiskWriter("test", file, most=most, batch_most=batch_most, keep=keep, rests=rests)
        writers.append(writer)
        writer.start()
        assert writer.tried.wait(ENOUGH_S)
        return writer

    yield started
    file.go_on.set()
    for writer in writers:
        writer.close(ENOUGH_S)


def flush(writer: DiskWriter[str]) -> bool:
    return asyncio.run(asyncio.wait_for(writer.flushed(), ENOUGH_S))


def test_waiting_items_are_written_in_one_batch_in_order(file: TextFile, start: Start) -> None:
    writer = start()
    file.block()
    writer.put("a")
    assert file.writing.wait(ENOUGH_S)
    for item in "bcd":
        writer.put(item)
    file.go_on.set()
    assert flush(writer)
    assert file.batches == [["a"], ["b", "c", "d"]]
    assert "tidy" in file.events


def test_a_thread_that_rests_leaves_the_disk_to_others_between_writes(
    file: TextFile, start: Start
) -> None:
    writer = start(rests=True, most=1000)
    items: list[str] = []

    def put_more() -> bool:
        items.append(str(len(items)))
        writer.put(items[-1])
        return len(file.times) > 3

    until(put_more, "it writes while more comes")
    assert flush(writer)
    assert file.written == items
    assert all(later - earlier >= REST_S[0] for earlier, later in pairwise(file.times))
    writer.put("last")
    assert writer.close(ENOUGH_S)
    assert file.written == [*items, "last"]


def test_a_batch_has_no_more_items_than_allowed(file: TextFile, start: Start) -> None:
    writer = start(batch_most=2)
    file.block()
    for item in "abcde":
        writer.put(item)
    file.go_on.set()
    assert flush(writer)
    assert file.written == [*"abcde"]
    assert max(map(len, file.batches)) == 2


def test_full_queue_accepts_only_unbounded_items(file: TextFile, start: Start) -> None:
    writer = start(most=10)
    file.block()
    writer.put("a")
    assert file.writing.wait(ENOUGH_S)  # what is being written counts no more
    assert writer.put("b", 6)
    assert not writer.put("c", 5)
    assert writer.put("d", 4)
    assert not writer.put("e")
    assert writer.put("f", 5, bounded=False)
    assert writer.waiting == 15
    file.go_on.set()
    assert flush(writer)
    assert file.written == [*"abdf"]
    assert writer.waiting == 0


def test_refused_items_are_returned_at_once(file: TextFile, start: Start) -> None:
    writer = start()
    file.fails = FULL
    writer.put("a")
    assert not flush(writer)
    assert file.refused == [("a", "no space left on device")]
    file.fails = None
    until(lambda: file.events.count("open") > 1 and file.events[-1] != "close", "open again")
    writer.put("b")
    assert flush(writer)
    assert file.written == ["b"]


def test_kept_items_are_written_in_order_once_the_disk_takes_them(file: TextFile, start: Start) -> None:
    writer = start(most=3, keep=True)
    file.fails = FULL
    for item in "ab":
        writer.put(item)
    assert not flush(writer)
    writer.put("c")
    assert not flush(writer)
    assert not writer.put("d")  # three are kept
    file.fails = None
    until(lambda: file.written == [*"abc"], "written later")
    assert flush(writer)
    assert writer.put("d")
    assert file.refused == []


def test_kept_items_are_refused_at_the_end(file: TextFile, start: Start) -> None:
    writer = start(keep=True)
    file.fails = FULL
    writer.put("a")
    assert not flush(writer)
    assert writer.close(ENOUGH_S)
    assert [item for item, _ in file.refused] == ["a"]
    assert file.events[-1] == "end"


def test_at_the_end_the_queue_is_written_even_after_an_error(file: TextFile, start: Start) -> None:
    file.fails = FULL
    writer = start()
    file.fails = None
    writer.put("a")
    assert writer.close(ENOUGH_S)
    assert file.written + [item for item, _ in file.refused] == ["a"]
    assert file.events[-1] == "end"


def test_a_disk_that_stands_still_delays_no_shutdown(file: TextFile, start: Start) -> None:
    writer = start()
    file.block()
    writer.put("a")
    assert not writer.close(0.05)
    file.go_on.set()
    assert writer.close(ENOUGH_S)
    assert file.written == ["a"]


def test_an_error_elsewhere_closes_the_file_and_opens_it_again(file: TextFile, start: Start) -> None:
    writer = start()
    writer.report(LogError("sync failed"))
    until(lambda: file.events.count("open") == 2, "open again")
    assert "close" in file.events
    writer.put("a")
    assert flush(writer)
    assert file.written == ["a"]


def test_an_unexpected_error_does_not_end_the_thread(file: TextFile, start: Start) -> None:
    writer = start()
    file.fails = ValueError("wrong")
    writer.put("a")
    assert not flush(writer)
    assert file.refused == [("a", "wrong")]
    file.fails = None
    until(lambda: file.events.count("open") > 1 and file.events[-1] != "close", "open again")
    writer.put("b")
    assert flush(writer)
