"""The report of `make test-long`, and what it permits."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests import long
from tests.support.places import ROOT

GREEN: dict[str, Any] = {
    "commit": "c0ffee00",
    "changed": [],
    "began": "2026-05-04T08:00:00+00:00",
    "cores": 2,
    "steps": [
        {"name": "tests beside each other", "text": "in 4 processes", "status": 0, "seconds": 60}
    ],
    "tests": 2,
    "failed": {},
    "repeated": {"tests/a.py::test_hold": ["AssertionError: it goes on"]},
    "slowest": [{"test": "tests/a.py::test_hold", "failed": False, "repeated": True, "seconds": 3.2}],
}


@pytest.fixture(autouse=True)
def head(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(long, "commit", lambda: "c0ffee00")


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({}, None),
        ({"failed": {"tests/a.py::test_hold": []}}, "tests/a.py::test_hold failed"),
        ({"changed": ["app/main.py"]}, "files were changed since the commit: app/main.py"),
        ({"commit": "0ddba11000"}, "they are of commit 0ddba110, not of c0ffee00"),
        ({"steps": [{"name": "soak", "status": 2, "seconds": 1}]}, "soak: exit status 2"),
    ],
)
def test_a_release_needs_green_results_of_its_commit(change: dict[str, Any], fault: str | None) -> None:
    assert long.faults(GREEN | change) == ([] if fault is None else [fault])


def test_each_repeat_is_on_the_report_with_its_reason() -> None:
    page = long.page(GREEN)
    assert "is **green**." in page
    assert "| tests | 2: 0 failed, 1 repeated |" in page
    assert "\n- `tests/a.py::test_hold`\n  - ``AssertionError: it goes on``\n" in page
    assert "| tests beside each other | in 4 processes | 0 | 1.0 |" in page


@pytest.mark.parametrize(
    "change",
    [
        {"failed": {"tests/a.py::test_hold": []}},
        {"changed": ["app/main.py"]},
        {"steps": [{"name": "soak", "text": "", "status": 2, "seconds": 1}]},
    ],
)
def test_a_page_of_a_failed_run_is_red(change: dict[str, Any]) -> None:
    assert "is **red**." in long.page(GREEN | change)


def test_a_repeated_test_is_one_test() -> None:
    rows = [{"test": "a", "failed": False}, {"test": "b"}, {"test": "a", "failed": True}]
    outcomes = "\n".join(map(json.dumps, rows))
    assert long.results(outcomes) == [rows[2], rows[1]]


def test_a_commit_of_the_report_alone_is_the_one_before(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    files = {"b": "docs/test-report.json\ndocs/test-report.md", "a": "app/main.py\ndocs/test-report.md"}
    monkeypatch.setattr(
        long, "git", lambda *words: "b\na" if words[0] == "rev-list" else files[words[-1]]
    )
    assert long.commit() == "a"


def test_no_fault_of_the_kiosk_falls_between_the_steps(tmp_path: Path) -> None:
    """Which of them are measured depends on the form, and with it the step that has them."""
    collected = []
    for step in long.steps(tmp_path / "outcomes")[:2]:
        command = (*step.command, "-n0", "--collect-only", "tests/tools/kiosk/test_watcher.py")
        env = {**os.environ, "FAULTS": "", "EXAMPLES": "", **step.env}
        done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=True)
        collected += [line for line in done.stdout.splitlines() if "is_restarted[" in line]
    assert len(collected) == len({*collected}) == 9, collected
