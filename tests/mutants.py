"""Changes the code that decides, one place at a time, and names each change that no unit test notices.

`make mutants`, or `python -m tests.mutants [--most N] [--only TEXT]`. The tests are collected once. For
each mutant a forked process replaces the code of the changed function, or the changed constant, and
runs the tests of its room up to the first that fails. Nothing is written into the checkout.
"""

import argparse
import gc
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, Final

import pytest
from _pytest.runner import runtestprotocol

from tests.support.mutations import Mutant, mutants_of
from tests.support.parts import ROOT

# Of each room: its modules, and the tests that must notice a change.
ROOMS: Final = {
    "app/cell/permission/*.py": (
        "tests/cell/permission/", "tests/cell/robot/test_definitions.py",
        "tests/cell/commands/test_control_acts.py", "tests/cell/commands/test_steps.py",
        "tests/cell/commands/test_parameters.py", "tests/cell/commands/test_option_lists.py",
        "tests/cell/session/test_robots_on_one_page.py",
    ),
    "app/cell/commands/holds.py": (
        "tests/cell/commands/test_holds.py", "tests/cell/commands/test_joysticks.py",
    ),
    "app/cell/commands/presses.py": (
        "tests/cell/commands/test_presses.py", "tests/cell/commands/test_press_limits.py",
        "tests/cell/commands/test_calls_and_goals.py", "tests/records/test_press_record.py",
        "tests/records/test_refusal_quota.py",
    ),
    "app/cell/people/*.py": ("tests/cell/people/",),
    "app/cell/alarms/states.py": (
        "tests/cell/alarms/test_states.py", "tests/cell/alarms/test_delays.py",
        "tests/cell/alarms/test_engine.py", "tests/cell/alarms/test_restored.py",
    ),
    "app/cell/commands/judge.py": (
        "tests/cell/commands/test_bound_presses.py", "tests/cell/commands/test_final_check.py",
        "tests/cell/commands/test_presses.py", "tests/cell/commands/test_press_limits.py",
        "tests/cell/commands/test_control_acts.py", "tests/cell/commands/test_acts.py",
    ),
    "app/records/verify.py": ("tests/records/test_store.py", "tests/records/test_files_removed.py",
        "tests/records/test_signed.py",),
    "app/cell/robot/topics.py": ("tests/cell/robot/", "tests/cell/permission/test_interlocks.py"),
}  # fmt: skip
# Fixtures with a process of their own, which reads the files.
PROCESSES: Final = {"bridge", "demo", "kiosk", "server", "servers", "start"}
OPTIONS: Final = (
    "-qq", "-p", "no:cacheprovider", "--capture=no", "--tier", "test"
)  # fmt: skip
LIMIT_S: Final = 40.0  # a mutant that runs longer counts as noticed


def codes(code: CodeType) -> Iterator[CodeType]:
    """The code and that of all functions in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from codes(constant)


def apply(mutant: Mutant) -> None:
    """Makes the mutant's functions and constants those of this process."""
    new = {(code.co_qualname, code.co_firstlineno): code for code in codes(mutant.code)}
    gc.unfreeze()  # pytest's collection has frozen them
    for function in gc.get_objects():
        if isinstance(function, FunctionType) and function.__code__.co_filename == str(mutant.path):
            old = function.__code__
            function.__code__ = new[old.co_qualname, old.co_firstlineno]
    name = ".".join(mutant.path.relative_to(ROOT).with_suffix("").parts)
    changed: dict[str, Any] = {"__name__": name, "__file__": str(mutant.path)}
    exec(mutant.code, changed)
    known = vars(sys.modules[name])
    for key, value in changed.items():
        if isinstance(value, int | float) and known[key] != value:
            for module in [*sys.modules.values()]:  # also those that have imported it
                if vars(module).get(key) is known[key]:
                    setattr(module, key, value)


class Run:
    """A plug-in of pytest: runs the mutants in place of the tests."""

    def __init__(self, only: str, most: int) -> None:
        paths = [(path, tests) for glob, tests in ROOMS.items() for path in sorted(ROOT.glob(glob))]
        every = [(m, tests) for path, tests in paths if only in str(path) for m in mutants_of(path)]
        count = min(most, len(every))
        self._chosen = [every[number * len(every) // count] for number in range(count)]
        self._total = len(every)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        items = [item for item in session.items if not PROCESSES & {*getattr(item, "fixturenames", ())}]
        _failure(items[0], session)  # what all share is made once, before the forks
        made, noticed = Counter[Path](), Counter[Path]()
        for tests in dict.fromkeys(tests for _, tests in self._chosen):
            assert self._passes(items, tests, None), f"without a change {tests} fail"
        for mutant, tests in self._chosen:
            made[mutant.path] += 1
            if self._passes(items, tests, mutant):
                print(f"{mutant.path.relative_to(ROOT)}:{mutant.line}: {mutant.change}", flush=True)
            else:
                noticed[mutant.path] += 1
        print(f"\n{len(self._chosen)} of {self._total} mutants\n")
        print("| module | mutants | noticed | not noticed |")
        print("| --- | --- | --- | --- |")
        for path, number in made.items():
            missed = number - noticed[path]
            print(f"| `{path.relative_to(ROOT)}` | {number} | {noticed[path]} | {missed} |")
        session._setupstate.teardown_exact(None)
        return True

    def _passes(self, items: list[pytest.Item], tests: tuple[str, ...], mutant: Mutant | None) -> bool:
        """Whether a room's tests pass in a forked process; first those that are named as the module."""
        own = f"test_{mutant.path.stem}.py" if mutant else ""
        room = [item for item in items if item.nodeid.startswith(tests)]
        room.sort(key=lambda item: item.path.name != own)
        if not (pid := os.fork()):
            os.setsid()
            os._exit(_run(room, mutant))
        end = time.monotonic() + LIMIT_S
        while time.monotonic() < end:
            if (ended := os.waitpid(pid, os.WNOHANG))[0]:
                return ended[1] == 0
            time.sleep(0.01)
        os.killpg(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        return False


def _failure(item: pytest.Item, following: Any) -> str:
    """How a test fails, "" if it passes. `following` is the next test, or the session, to keep its
    fixtures."""
    reports = runtestprotocol(item, log=False, nextitem=following)
    return next((report.longreprtext or "failed" for report in reports if report.failed), "")


def _run(room: list[pytest.Item], mutant: Mutant | None) -> int:
    """1 if a test fails, or the mutant can't even be loaded."""
    try:
        if mutant is not None:
            sink = os.open(os.devnull, os.O_RDWR)
            for stream in range(3):
                os.dup2(sink, stream)
            apply(mutant)
        for item, following in zip(room, [*room[1:], room[0].session], strict=True):
            if failure := _failure(item, following):
                print(failure)
                return 1
    except BaseException as error:  # also one that would end the run
        print(repr(error))
        return 1
    return 0


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants")
    parser.add_argument("--most", type=int, default=10_000, help="so many of all, evenly spread")
    parser.add_argument("--only", default="", help="of modules whose path has this in it")
    options = parser.parse_args()
    tests = sorted({test for tests in ROOMS.values() for test in tests})
    run = Run(options.only, options.most)
    pytest.main([*OPTIONS, *tests], plugins=[run])


if __name__ == "__main__":
    main()
