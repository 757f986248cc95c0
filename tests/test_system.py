"""What `make run` says while it installs what is missing on a bare Debian."""

import os
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.support.parts import ROOT

DEBCONF = "debconf: delaying package configuration, since apt-utils is not installed"


def installed(folder: Path, apt_get: str, user: int = 0) -> subprocess.CompletedProcess[str]:
    """`tests/system.sh python3-venv` where Python has no ensurepip."""
    commands = {"apt-get": apt_get, "id": f"echo {user}", "no-python": "exit 1"}
    return system(folder, commands, "python3-venv", PYTHON="no-python", TMPDIR=str(folder))


def system(
    folder: Path, commands: Mapping[str, str], *arguments: str, **env: str
) -> subprocess.CompletedProcess[str]:
    """`tests/system.sh` with these scripts in place of the system's commands."""
    for name, script in commands.items():
        (folder / name).write_text(f"#!/bin/sh\n{script}\n")
        (folder / name).chmod(0o755)
    return subprocess.run(
        ["sh", "tests/system.sh", *arguments],
        cwd=ROOT,
        env={**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", **env},
        capture_output=True,
        text=True,
        check=False,
    )


def test_installing_a_package_prints_no_warnings(tmp_path: Path) -> None:
    done = installed(tmp_path, f'echo "{DEBCONF}" >&2; echo "$@" >>{tmp_path}/called')
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "installing python3-venv (once, by apt-get)\n"
    update, install = (tmp_path / "called").read_text().splitlines()
    assert update == "update -qq"
    assert install.endswith("--no-install-recommends python3-venv")
    assert not list(tmp_path.glob("tmp.*"))


@pytest.mark.parametrize("step", ["update", "install"])
def test_package_that_cannot_be_installed_is_named_with_the_reason(tmp_path: Path, step: str) -> None:
    done = installed(tmp_path, f'[ "$1" != {step} ] || {{ echo "E: no network" >&2; exit 100; }}')
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "E: no network",
        "apt-get could not install python3-venv: install that, then run this again",
    ]


def test_missing_packages_are_named_without_the_right_to_install(tmp_path: Path) -> None:
    done = installed(tmp_path, "exit 9", user=1000)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.splitlines() == [
        "missing, by Debian's names: python3-venv. Install that, then run this again:",
        "sudo apt-get install --no-install-recommends python3-venv",
    ]


@pytest.mark.parametrize(
    ("kind", "words"), [("--net", "mount and network namespaces"), ("--user", "in a user namespace")]
)
def test_a_kind_of_namespace_that_is_not_allowed_is_named_before_the_tests(
    tmp_path: Path, kind: str, words: str
) -> None:
    done = system(tmp_path, {"unshare": f'case "$*" in *{kind}*) exit 1;; esac', "apt-get": "exit 9"})
    assert done.returncode == 1
    assert words in done.stderr
    assert "not allowed here" in done.stderr


def test_missing_packages_are_only_named_for_some_tests(tmp_path: Path) -> None:
    """`make system` with ARGS, also as root on Debian."""
    called = tmp_path / "called"
    commands = {"apt-get": f"touch {called}", "id": "echo 0", "cmake": "exit 1"}
    for name, script in commands.items():
        (tmp_path / name).write_text(f"#!/bin/sh\n{script}\n")
        (tmp_path / name).chmod(0o755)
    done = subprocess.run(
        ["make", "system", "ARGS=-k clock"],
        cwd=ROOT,
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "missing, by Debian's names: cmake. `make system` installs them" in done.stderr
    assert not called.exists()
