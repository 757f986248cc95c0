"""Signals, with a wait for their effect. After SIGSTOP, the threads of a process still run until the
thread that gets the signal has run: on a busy machine some milliseconds, in which it may answer."""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

STANDS_WITHIN_S: Final = 10.0
LOOKS_EVERY_S: Final = 0.0005
STANDS: Final = "T"
ENDED: Final = "ZX"


def send_signal(pid: int, number: signal.Signals) -> None:
    """Sends it; SIGSTOP returns when no thread of the process runs any more."""
    os.kill(pid, number)
    if number == signal.SIGSTOP:
        end = time.monotonic() + STANDS_WITHIN_S
        while running := set(_states(pid)) - {STANDS, *ENDED}:
            assert time.monotonic() < end, f"threads of process {pid} do not stop: {running}"
            time.sleep(LOOKS_EVERY_S)


def _states(pid: int) -> Iterator[str]:
    """The state of each thread, as in proc(5): it follows the name, which may have brackets in it."""
    for thread in Path(f"/proc/{pid}/task").iterdir():
        with suppress(FileNotFoundError, ProcessLookupError):  # one that has ended
            yield (thread / "stat").read_text().rpartition(")")[2].split()[0]
