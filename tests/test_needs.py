"""What `make test` sets up for the tests that ARGS name, before it runs them."""

import subprocess
import sys

import pytest

from tests.support.parts import ROOT


def needs(*arguments: str) -> subprocess.CompletedProcess[str]:
    return run(sys.executable, "-m", "tests.needs", *arguments)


def run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("arguments", "target"),
    [
        (["tests/test_clock.py"], ""),
        (["tests/bridge/test_publishers_on_bridge.py"], "test-parts\n"),
        (["--version"], ""),
    ],
)
def test_real_parts_are_set_up_for_the_tests_that_use_them(arguments: list[str], target: str) -> None:
    done = needs(*arguments)
    assert (done.returncode, done.stdout) == (0, target)


@pytest.mark.parametrize("arguments", [["tests/nothing.py"], ["tests/test_clock.py", "-k", "nothing"]])
def test_tests_that_are_not_collected_set_up_nothing(arguments: list[str]) -> None:
    done = needs(*arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr


def test_make_ends_with_the_collection_error() -> None:
    done = run("make", "--old-file=.venv/test", "test", "ARGS=tests/nothing.py")
    assert done.returncode == 2
    assert "file or directory not found: tests/nothing.py" in done.stderr
    assert "system.sh" not in done.stdout
