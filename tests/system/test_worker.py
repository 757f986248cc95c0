"""Work in a child process: its results, each way to fail, its limits, and its end."""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from app.system.errors import DoctorError
from app.system.texts import TextLike
from app.system.worker import Limits, Worker, WorkerError, Workers
from tests.support.parts import ROOT, until

WORK: Final = "tests.support.child_work:"
MEMORY: Final = 50_000_000
VALUES: Final = (None, True, 2**70, 0.5, "é\n", b"\0" * 100_000, [1, ("a",)], {"a": [b"b"]})


def is_running(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_plain_values_arrive_one_by_one_and_what_is_printed_is_none() -> None:
    assert tuple(Worker(WORK + "echo", *VALUES).results()) == VALUES


@pytest.mark.parametrize(
    ("how", "reason", "ended_with"),
    [
        ("a sentence", "no space left on device", 0),
        ("an exception", "ZeroDivisionError: by nothing", 1),
        ("a status", "", 3),
        ("a signal", "", -signal.SIGTERM),
        ("memory", "MemoryError", 1),
        ("time", "", -signal.SIGALRM),
    ],
)
def test_each_failure_comes_after_the_results_before_it(how: str, reason: str, ended_with: int) -> None:
    limits = Limits(within_s=0.5 if how == "time" else 30.0, memory=MEMORY)
    work = Worker(WORK + "end", how, limits=limits).results()
    results = [next(work)]
    with pytest.raises(WorkerError) as caught:
        next(work)
    assert results == [how]
    assert (str(caught.value), caught.value.ended_with) == (reason, ended_with)


def test_a_child_that_writes_much_to_stderr_is_not_stopped_by_it() -> None:
    assert list(Worker(WORK + "talk", 1_000_000, limits=Limits(within_s=20)).results()) == ["done"]


def test_no_other_value_is_created() -> None:
    assert list(Worker(WORK + "end", "a strange value").results()) == ["a strange value"]


def test_a_child_ends_with_its_parent(tmp_path: Path) -> None:
    file = tmp_path / "pid"
    code = (
        "import sys, pathlib; from app.system.worker import Worker\n"
        f"print(list(Worker({WORK + 'own_pid'!r}, pathlib.Path(sys.argv[1])).results()))"
    )
    parent = subprocess.Popen([sys.executable, "-c", code, str(file)], cwd=ROOT)
    child = int(until(lambda: file.is_file() and file.read_text(), "its child works"))
    parent.kill()
    parent.wait()
    until(lambda: not is_running(child), "the child has ended")


def test_workers_end_when_they_are_left_killed_or_closed(tmp_path: Path) -> None:
    def failed(why: TextLike) -> DoctorError:
        return DoctorError(f"because: {why}")

    def leave(workers: Workers) -> None:
        pass

    async def work(file: Path, end: Callable[[Workers], Any], fails: bool) -> None:
        workers = Workers(failed)
        async with workers.run(Worker(WORK + "own_pid", file)) as running:
            assert await running.next_result() == "begun"
            assert is_running(int(file.read_text()))
            end(workers)
            if fails:
                with pytest.raises(DoctorError, match="because: "):
                    await running.next_result()
        assert not is_running(int(file.read_text()))

    asyncio.run(work(tmp_path / "left", leave, False))
    asyncio.run(work(tmp_path / "closed", Workers.close, True))


def test_closed_workers_do_nothing(tmp_path: Path) -> None:
    async def work() -> None:
        workers = Workers(lambda why: DoctorError(why or "ended"))
        workers.close()
        async with workers.run(Worker(WORK + "own_pid", tmp_path / "pid")) as running:
            with pytest.raises(DoctorError, match="ended"):
                await running.all_results()

    asyncio.run(work())
    assert os.listdir(tmp_path) == []
