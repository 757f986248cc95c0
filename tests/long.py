"""`python -m tests.long`: the tests of the tier `long`, then a soak and a quick benchmark.

Writes docs/test-report.json (the commit, each step, what failed or was repeated and why) and
docs/test-report.md. Exit status 1: something failed. `python -m tests.long --check`: exit status 1
unless the report is green and of the current commit. A commit that changes only the report is the same.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest

from tests import tiers
from tests.support.places import ROOT

WORKERS: Final = os.environ.get("WORKERS", "4")
IN_WORKERS: Final = ("-n", WORKERS, "--dist", "loadfile", "--no-loadscope-reorder")
SOAK_S: Final = "300"
REASON_MOST: Final = 200
REPORTS: Final = ("docs/test-report.json", "docs/test-report.md")


class Step(NamedTuple):
    """A part of the run: its name and what it does, as the report says it, its command and its
    environment."""

    name: str
    text: str
    command: tuple[str, ...]
    env: Mapping[str, str]


def steps(outcomes: Path) -> tuple[Step, ...]:
    # With "=": pytest takes a path after a space for a test, and looks for its options there.
    test = (sys.executable, "-m", "pytest", "--tier=long", f"--outcomes={outcomes}")
    make = ("make", "--no-print-directory")
    return (
        Step(
            "tests beside each other",
            f"all but those of real time, in {WORKERS} processes, with many random inputs",
            (*test, "--alone=without", *IN_WORKERS),
            {"EXAMPLES": "long"},
        ),
        Step(
            "tests of real time, alone",
            "one after the other; one that fails is repeated once",
            (*test, "--alone=only"),
            {},
        ),
        Step(
            f"soak of {SOAK_S} s",
            "normal operation: no event lost, no press received twice",
            (sys.executable, "-m", "tests.faults.soak"),
            {"SOAK_S": SOAK_S},
        ),
        Step(
            "rivals, installed",
            "`make bench-setup`: builds the rivals that are not there yet",
            (*make, "bench-setup"),
            {},
        ),
        Step(
            "rivals, quick",
            "`QUICK=1 make bench`: each phase of the benchmark works with each rival",
            (*make, "bench"),
            {"QUICK": "1"},
        ),
    )


class Outcomes:
    """A plugin that appends a line of JSON to a file for each test: its id, whether it failed, whether
    it was repeated, the reason of each failure, and its duration in seconds."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seconds: defaultdict[str, float] = defaultdict(float)
        self._repeated: set[str] = set()
        self._failed: set[str] = set()
        self._reasons: defaultdict[str, list[str]] = defaultdict(list)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        test = report.nodeid
        self._seconds[test] += report.duration
        repeated = str(report.outcome) == "rerun"
        if repeated:
            self._repeated.add(test)
        elif report.failed:
            self._failed.add(test)
        if repeated or report.failed:
            self._reasons[test].append(failure(report))
        if report.when == "teardown" and not repeated:
            row = {
                "test": test,
                "failed": test in self._failed,
                "repeated": test in self._repeated,
                "reasons": self._reasons[test],
                "seconds": round(self._seconds[test], 1),
            }
            with self._path.open("a") as file:
                file.write(json.dumps(row) + "\n")


def failure(report: pytest.TestReport) -> str:
    """Why a test failed, in one line without this checkout's path."""
    crash = getattr(report.longrepr, "reprcrash", None)
    lines = (crash.message if crash else report.longreprtext).strip().splitlines()
    return lines[0].replace(f"{ROOT}/", "")[:REASON_MOST] if lines else ""


def commit() -> str:
    """The current commit; a commit that changes only the report counts as the one before."""
    for name in git("rev-list", "-n", "20", "HEAD").split():
        changed = git("diff-tree", "--no-commit-id", "--name-only", "-r", name).split()
        if not changed or not set(changed) <= set(REPORTS):
            return name
    raise ValueError("the last 20 commits change only the report")


def changed_files() -> list[str]:
    """Files that differ from the current commit, except for the report."""
    names = [line.split()[-1] for line in git("status", "--porcelain").splitlines()]
    return [name for name in names if name not in REPORTS]


def git(*arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def run(outcomes: Path) -> dict[str, Any]:
    began = datetime.now(UTC)
    done = []
    for step in steps(outcomes):
        started = time.monotonic()
        status = subprocess.run(step.command, cwd=ROOT, env={**os.environ, **step.env}).returncode
        seconds = round(time.monotonic() - started)
        done.append({"name": step.name, "text": step.text, "status": status, "seconds": seconds})
    tests = results(outcomes.read_text()) if outcomes.exists() else []
    return {
        "commit": commit(),
        "changed": changed_files(),
        "began": began.isoformat(timespec="seconds"),
        "cores": os.cpu_count(),
        "steps": done,
        "tests": len(tests),
        "failed": {row["test"]: row["reasons"] for row in tests if row["failed"]},
        "repeated": {row["test"]: row["reasons"] for row in tests if row["repeated"]},
        "slowest": sorted(tests, key=lambda row: -row["seconds"])[:20],
    }


def results(outcomes: str) -> list[dict[str, Any]]:
    """The last result of each test: a test that was repeated has a line for each time."""
    rows = map(json.loads, outcomes.splitlines())
    return list({row["test"]: row for row in rows}.values())


def faults(result: Mapping[str, Any]) -> list[str]:
    """Why these results do not permit a release; empty if they do."""
    reasons = [
        f"{step['name']}: exit status {step['status']}" for step in result["steps"] if step["status"]
    ]
    reasons += [f"{test} failed" for test in result["failed"]]
    if result["changed"]:
        reasons.append(f"files were changed since the commit: {', '.join(result['changed'])}")
    if result["commit"] != commit():
        reasons.append(f"they are of commit {result['commit'][:8]}, not of {commit()[:8]}")
    return reasons


TITLE: Final = "# Report of the long tests"
NO_RUN: Final = (
    f"{TITLE}\n\n`make test-long` has not run to its end since these tests have their tiers.\n"
)


def page(result: Mapping[str, Any]) -> str:
    """The report, as Markdown."""
    began = datetime.fromisoformat(result["began"])
    minutes = sum(step["seconds"] for step in result["steps"]) / 60
    failed_steps = sum(bool(step["status"]) for step in result["steps"])
    green = not (failed_steps or result["failed"] or result["changed"])
    lines = [
        TITLE,
        "",
        f"The last run of `make test-long` is **{'green' if green else 'red'}**."
        + ("" if green else " `make release` needs a green one."),
        "",
        *rows(("", "")),
        f"| commit | `{result['commit'][:8]}` |",
        *([f"| changed since | {', '.join(result['changed'])} |"] if result["changed"] else []),
        f"| began | {began:%d %B %Y, %H:%M} UTC |",
        f"| took | {minutes:.0f} minutes, on {result['cores']} cores |",
        f"| tests | {result['tests']:,}: {len(result['failed'])} failed, "
        f"{len(result['repeated'])} repeated |",
        "",
        "## Steps",
        "",
        *rows(("step", "what ran", "exit status", "minutes")),
        *(
            f"| {step['name']} | {step['text']} | {step['status']} | {step['seconds'] / 60:.1f} |"
            for step in result["steps"]
        ),
        "",
        "## Failed",
        "",
        *with_reasons(result["failed"]),
        "",
        "## Repeated",
        "",
        "Tests of real time that failed at first. Those that failed again are above, too.",
        "",
        *with_reasons(result["repeated"]),
        "",
        "## Slowest",
        "",
        *rows(("seconds", "test")),
        *(f"| {row['seconds']:.0f} | `{row['test']}` |" for row in result["slowest"]),
        "",
        "## Why a test is in this tier",
        "",
        *rows(("reason", "what it says")),
        *(f"| {reason} | {text} |" for reason, text in tiers.REASONS.items()),
    ]
    return "\n".join(lines) + "\n"


def with_reasons(tests: Mapping[str, Sequence[str]]) -> list[str]:
    """A list of tests, each with the reasons of its failures as they were printed."""
    if not tests:
        return ["None."]
    lines = []
    for test, reasons in tests.items():
        lines += [f"- `{test}`", *(f"  - ``{reason}``" for reason in reasons)]
    return lines


def rows(names: Sequence[str]) -> tuple[str, str]:
    return f"| {' | '.join(names)} |", f"|{' --- |' * len(names)}"


def main(arguments: Sequence[str]) -> int:
    results, written = (ROOT / name for name in REPORTS)
    if arguments == ["--check"]:
        if not results.exists():
            print(f"no {results.name}: `make test-long` writes it", file=sys.stderr)
            return 1
        reasons = faults(json.loads(results.read_text()))
    else:
        with tempfile.TemporaryDirectory() as folder:
            result = run(Path(folder) / "outcomes.jsonl")
        results.write_text(json.dumps(result, indent=1) + "\n")
        written.write_text(page(result))
        reasons = faults(result)
    for fault in reasons:
        print(f"make test-long is not green: {fault}", file=sys.stderr)
    return 1 if reasons else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
