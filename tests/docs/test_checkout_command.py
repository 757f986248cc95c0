"""`operator-panel` of a checkout, as `make run` and `make wheel` set it up."""

import os
import subprocess
from pathlib import Path

import pytest

from tests.support.parts import ROOT
from tests.support.processes.shell import Shell
from tests.support.shown_commands import commands_for

pytestmark = pytest.mark.long("documents")

INSTALLS = "tests/docs/test_checkout_command.py::test_the_command_of_a_checkout_installs_its_wheel"


@pytest.fixture(scope="module")
def checkout(namespaces: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout of its own after `make wheel`."""
    shell = Shell(tmp_path_factory.mktemp("machine"))
    done = shell.run("make wheel")
    shell.close()
    assert done.returncode == 0, done.stdout
    return shell.checkout


def run(command: str, folder: Path, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env={**os.environ, **env},
        capture_output=True,
        text=True,
        check=False,
    )


def test_checkout_command_runs_in_any_folder(checkout: Path, tmp_path: Path) -> None:
    for folder in ("here", "path"):
        (tmp_path / folder / "app").mkdir(parents=True)
        (tmp_path / folder / "app/__init__.py").write_text("raise SystemExit('another app')\n")
    (tmp_path / "link").symlink_to(checkout / ".venv/bin/operator-panel")
    for command in (checkout / ".venv/bin/operator-panel", tmp_path / "link"):
        done = run(f"{command} --version", tmp_path / "here", PYTHONPATH=str(tmp_path / "path"))
        assert (done.returncode, done.stderr) == (0, "")
        assert done.stdout.startswith("operator-panel ")


def test_the_command_of_a_checkout_installs_its_wheel(checkout: Path) -> None:
    (checkout / "cell1.toml").write_text("")
    (command,) = commands_for(INSTALLS)
    done = run(f"{command} --any-system", checkout)
    assert done.returncode == 0, done.stderr
    assert "install operator_panel-" in done.stdout
    assert "(zenoh.json5)" in done.stdout


def test_a_wheel_is_built_with_the_locked_packages_of_a_build_alone(tmp_path: Path) -> None:
    told = ["make", "--dry-run", "--assume-new=deploy/build.lock", "wheel"]
    done = subprocess.run(told, cwd=ROOT, capture_output=True, text=True, check=True)
    assert "--require-hashes --no-deps -r deploy/build.lock" in done.stdout
    assert "tests/requirements.lock" not in done.stdout


def test_first_run_says_why_it_takes_time() -> None:
    """Each step that takes seconds is named before it begins."""
    command = ["make", "--dry-run", "--assume-new=deploy/requirements.lock", "run"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    steps = [line for line in done.stdout.splitlines() if not line.startswith("touch")]
    for slow in ("pip install", "app.cli run"):
        (number,) = (i for i, line in enumerate(steps) if slow in line)
        assert steps[number - 1].startswith("echo "), steps
