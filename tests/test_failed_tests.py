"""Tests that failed beside others are run once more, unless there are many."""

from pathlib import Path
from typing import Literal

import pytest

from tests.support import failed_tests
from tests.support.failed_tests import FailedTests


def report(nodeid: str, outcome: Literal["passed", "failed"]) -> pytest.TestReport:
    return pytest.TestReport(nodeid, ("", 0, ""), {}, outcome, None, "call")


def test_ids_of_failed_tests_are_read_back(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "failed"
    failed = FailedTests(path)
    failed.pytest_runtest_logreport(report("b", "passed"))
    for name in ("a", "c[x y]"):
        failed.pytest_runtest_logreport(report(name, "failed"))
    failed.pytest_sessionfinish()
    assert failed_tests.read(path) == {"a", "c[x y]"}


def test_a_run_without_failures_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "failed"
    path.write_text("of an earlier run")
    failed = FailedTests(path)
    failed.pytest_runtest_logreport(report("a", "passed"))
    failed.pytest_sessionfinish()
    assert not path.exists()


def test_many_failed_tests_are_not_repeated(tmp_path: Path) -> None:
    path = tmp_path / "failed"
    failed = FailedTests(path)
    for number in range(failed_tests.MOST + 1):
        failed.pytest_runtest_logreport(report(str(number), "failed"))
    failed.pytest_sessionfinish()
    with pytest.raises(pytest.exit.Exception, match="9 tests failed: only 8 are repeated"):
        failed_tests.read(path)
