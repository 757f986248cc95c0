"""Whether the clock of this machine follows a time source: from the kernel, files and `timedatectl`."""

import stat
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from app.system import time_source
from app.system.time_source import TimeSource, kernel_error_us, read_time_source, timedatectl_says


def test_the_kernel_of_this_machine_answers_or_says_nothing() -> None:
    error = kernel_error_us()
    assert error is None or error >= 0


@pytest.mark.parametrize(
    ("folder", "error_us", "said", "expected"),
    [
        ("chrony", 1500, "", TimeSource(True, "chrony", 0.0015)),
        ("systemd/timesync", 16_000_000, "", TimeSource(False, "systemd-timesyncd")),
        ("", 1500, "", TimeSource(True, "", 0.0015)),
        # In the server's unit the kernel does not answer.
        ("systemd/timesync/synchronized", None, "no", TimeSource(True, "systemd-timesyncd")),
        ("systemd/timesync", None, "no", TimeSource(False, "systemd-timesyncd")),
        ("chrony", None, "yes", TimeSource(True, "chrony")),
        ("chrony", None, "", TimeSource()),
        ("", None, "", TimeSource()),
    ],
)
def test_the_first_that_knows_it_counts(
    tmp_path: Path, folder: str, error_us: int | None, said: str, expected: TimeSource
) -> None:
    (tmp_path / folder).mkdir(parents=True, exist_ok=True)
    assert read_time_source(tmp_path, lambda: error_us, lambda: said) == expected


@pytest.fixture
def timedatectl(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Makes a program of this name that runs a line of shell."""

    def make(line: str) -> None:
        program = tmp_path / "timedatectl"
        program.write_text(f"#!/bin/sh\n{line}\n")
        program.chmod(stat.S_IRWXU)

    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.setattr(time_source, "ANSWERS_WITHIN_S", 0.5)
    return make


@pytest.mark.parametrize(
    ("line", "expected"), [("echo yes", "yes"), ("echo no", "no"), ("echo yes; exit 1", "")]
)
def test_timedatectl_is_asked(timedatectl: Callable[[str], None], line: str, expected: str) -> None:
    timedatectl(line)
    assert timedatectl_says() == expected


def test_timedatectl_that_hangs_is_ended(timedatectl: Callable[[str], None]) -> None:
    timedatectl("exec sleep 60")
    began = time.monotonic()
    assert timedatectl_says() == ""
    assert time.monotonic() - began < 30
