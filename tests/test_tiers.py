"""Which command runs a test, and what `make test` sets up for the tests that ARGS name."""

import os
import subprocess
import sys

import pytest

from tests import tiers
from tests.support.places import ROOT


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


def needs(*arguments: str) -> subprocess.CompletedProcess[str]:
    return run(sys.executable, "-m", "tests.tiers", *arguments)


@pytest.mark.long("table")
@pytest.mark.parametrize(
    ("arguments", "targets"),
    [
        (["tests/browser/test_zoom.py"], "browser\n"),
        (["tests/system/test_clock.py"], ""),
        (["--version"], ""),
        (["tests/bridge/test_publishers_on_bridge.py"], "test-parts\n"),
    ],
)
def test_real_parts_are_set_up_for_the_tests_that_use_them(arguments: list[str], targets: str) -> None:
    done = needs(*arguments)
    assert (done.returncode, done.stdout) == (0, targets)


@pytest.mark.parametrize("arguments", [["tests/nothing.py"], ["tests/test_names.py", "-k", "nothing"]])
def test_tests_that_are_not_collected_set_up_nothing(arguments: list[str]) -> None:
    done = needs(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr


def test_make_ends_with_the_collection_error() -> None:
    done = run("make", "--old-file=.venv/test", "test", "ARGS=tests/nothing.py")
    assert done.returncode == 2
    assert "file or directory not found: tests/nothing.py" in done.stderr
    assert "system.sh" not in done.stdout


def test_tier_follows_from_fixtures_and_marker() -> None:
    files = {
        "tests/system/test_clock.py": "test",
        "tests/bridge/test_publishers_on_bridge.py": "robot",
        "tests/browser/test_joystick_in_browser.py": "long",
    }
    done = run(sys.executable, "-m", "pytest", "--tiers", "-qq", *files)
    lines = [line.split() for line in done.stdout.splitlines() if line.endswith(".py")]
    assert {
        file: tiers.TIERS[[count != "0" for count in counts].index(True)] for *counts, file in lines
    } == files


def test_every_promise_has_a_test_and_the_table_of_contributing_names_it() -> None:
    done = needs("--promises")
    assert done.returncode == 0, done.stderr
    assert done.stdout in (ROOT / "CONTRIBUTING.md").read_text(), (
        "python -m tests.tiers --promises CONTRIBUTING.md"
    )


@pytest.mark.parametrize("content", [os.urandom(8), b"", bytearray(os.urandom(8))])
def test_workers_collect_the_same_tests_with_different_bytes(
    content: bytes, request: pytest.FixtureRequest
) -> None:
    assert request.node.name.split("[")[1].rstrip("]") in {"content0", "content1", "content2"}, content
