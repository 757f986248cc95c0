"""The processes of a run (robot, crowd of bare clients), and measurements of processes."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from tests.support.parts import CYCLONE_ON_LOOPBACK, ROOT
from tests.support.processes.commanded import Commanded

CACHE: Final = Path(os.environ.get("BENCH_CACHE") or Path.home() / ".cache/operator-panel/bench")
KIOSK_PYTHON: Final = CACHE / "kiosk/bin/python"
ROBOT_PYTHON: Final = Path(os.environ.get("BENCH_ROBOT_PYTHON") or CACHE / "robot/bin/python")
ENABLED: Final = "/operation_enabled"
COMMAND: Final = "/operation1"
TICKS_PER_S: Final = os.sysconf("SC_CLK_TCK")
ENDS_WITHIN_S: Final = 10.0


def of_domain(domain: int) -> dict[str, str]:
    """The environment of a ROS 2 process, on loopback only."""
    return {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "CYCLONEDDS_URI": CYCLONE_ON_LOOPBACK,
        "RCUTILS_LOGGING_USE_STDOUT": "0",
    }


def end_process(process: "subprocess.Popen[Any]", number: signal.Signals = signal.SIGTERM) -> None:
    """Ends a process and waits; kills it after `ENDS_WITHIN_S`."""
    if process.poll() is None:
        process.send_signal(signal.SIGCONT)
        process.send_signal(number)
    try:
        process.wait(ENDS_WITHIN_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def commanded(python: str | Path, module: str, env: Mapping[str, str]) -> Commanded:
    """A process of the benchmark in its own session, so that Ctrl-C reaches only the harness."""
    return Commanded([python, "-m", module], env, cwd=ROOT, start_new_session=True)


def robot(domain: int) -> Commanded:
    """See `bench/robot.py`; `first` is its Zenoh locator."""
    return commanded(ROBOT_PYTHON, "bench.robot", of_domain(domain))


@contextmanager
def crowd() -> Iterator[Commanded]:
    """See `bench/crowd.py`."""
    mine = commanded(sys.executable, "bench.crowd", {})
    try:
        yield mine
    finally:
        mine.end()


def family(pids: Iterable[int]) -> set[int]:
    """These processes and all their descendants."""
    children: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and (stat := _stat(int(entry.name))):
            children.setdefault(int(stat[1]), []).append(int(entry.name))
    members: set[int] = set()
    new = set(pids)
    while new:
        members |= new
        new = {child for pid in new for child in children.get(pid, [])} - members
    return members


def cpu_s(pids: Iterable[int]) -> float:
    """The CPU time of these processes in seconds; 0 for ended ones."""
    return sum((int(s[11]) + int(s[12])) / TICKS_PER_S for pid in pids if (s := _stat(pid)))


def rss_mib(pids: Iterable[int]) -> float:
    """Resident memory in MiB, with shared pages counted for each process."""
    return sum(_kib(pid, "status", "VmRSS") for pid in pids) / 1024


def pss_mib(pids: Iterable[int]) -> float:
    """Resident memory in MiB; of shared pages each process has its share."""
    return sum(_kib(pid, "smaps_rollup", "Pss") for pid in pids) / 1024


def _stat(pid: int) -> list[str]:
    """The fields after the process's name: [1] is the parent, [11] and [12] are CPU time."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return []


def _kib(pid: int, file: str, name: str) -> int:
    try:
        lines = Path(f"/proc/{pid}/{file}").read_text().splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in lines if line.startswith(f"{name}:")), 0)


class Meter:
    """CPU time since `restart`, in % of one core."""

    def __init__(self, pids: Callable[[], Iterable[int]]) -> None:
        self._pids = pids
        self.restart()

    def restart(self) -> None:
        self._at, self._used = time.monotonic(), cpu_s(self._pids())

    def percent(self) -> float:
        return 100 * (cpu_s(self._pids()) - self._used) / (time.monotonic() - self._at)
