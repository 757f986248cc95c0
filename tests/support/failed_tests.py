"""A pytest plugin: the ids of failed tests in a file, and a run of just those."""

from pathlib import Path
from typing import Final

import pytest

MOST: Final = 8  # if more failed, a busy machine was not their cause


class FailedTests:
    """Writes the ids of the tests that failed to `path`, and nothing if there are none."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._failed: set[str] = set()
        path.unlink(missing_ok=True)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        if self._failed:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.write_text("\n".join(sorted(self._failed)))


def read(path: Path) -> set[str]:
    """The ids in a file of `FailedTests`; ends pytest if there are too many."""
    ids = set(path.read_text().splitlines())
    if len(ids) > MOST:
        pytest.exit(f"{len(ids)} tests failed: only {MOST} are repeated", returncode=1)
    return ids
