"""The command as a process: its exit status, its output, and Ctrl-C. Other tests fork it from a process
that has imported what it needs; here it is also started as a user starts it."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from app.system.settings import PACKAGE
from tests.support.parts import ROOT, free_port
from tests.support.processes import command
from tests.support.processes.command import COMMAND, Started

Start = Callable[..., Started]


@pytest.fixture(params=[command.start, command.start_new], ids=["forked", "new"])
def start(request: pytest.FixtureRequest) -> Start:
    started: Start = request.param
    return started


def test_forked_command_has_the_given_folder_and_environment(start: Start, tmp_path: Path) -> None:
    shutil.copy(PACKAGE / "panel.toml", tmp_path / "cell1.toml")
    env = {"KIOSK_PANEL": "cell1.toml"}
    done = command.finished(start(COMMAND, "check", folder=tmp_path, env=env))
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f'{tmp_path}/cell1.toml: good: "Robot cell 1"')


def test_run_starts_a_shipped_panel_by_its_name(start: Start, tmp_path: Path) -> None:
    env = {"KIOSK_DATA": str(tmp_path)}
    words = ("run", "mobile-robot", "--port", str(free_port()))
    process = start(COMMAND, *words, folder=tmp_path, env=env)
    assert process.stderr is not None
    lines = iter(process.stderr.readline, "")
    assert any('panel "Shuttle 1"' in line and "robot simulated" in line for line in lines)
    assert any("the panel is at http://127.0.0.1:" in line for line in lines)
    process.send_signal(signal.SIGINT)
    assert command.finished(process).returncode in (0, 128 + signal.SIGINT)


def test_a_mistake_is_one_sentence_and_status_2(start: Start) -> None:
    done = command.finished(start(COMMAND, "topics", "--conect", "tcp/127.0.0.1:1"))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("operator-panel topics: --conect is not an option of this command")


@pytest.mark.long("table")
@pytest.mark.parametrize(
    ("module", "words"),
    [
        (COMMAND, ("check", str(PACKAGE / "panel.toml"))),
        (COMMAND, ("check", "none.toml")),  # its error goes nowhere either
        (COMMAND, ("doctor", "--mode", "demo", "--verbose")),
        (COMMAND, ("completion", "bash")),
        (COMMAND, ("bridge-config", str(PACKAGE / "panel.toml"))),
        (COMMAND, ("--help",)),
        ("app.check", (str(PACKAGE / "panel.toml"),)),
        ("app.log", ("--help",)),
    ],
)
def test_closed_output_ends_the_command_silently_with_the_status_of_sigpipe(
    module: str, words: tuple[str, ...], tmp_path: Path
) -> None:
    """As before `| head`, which has read enough."""
    read, write = os.pipe()
    os.close(read)
    errors = tmp_path / "errors"
    env = {**os.environ, "PYTHONPATH": str(ROOT), "KIOSK_DATA": str(tmp_path)}
    env.pop("PYTHONUNBUFFERED", None)  # with it, argparse ignores an error of its output
    with errors.open("w") as file:
        stderr = write if "none.toml" in words else file
        command_line = [sys.executable, "-m", module, *words]
        done = subprocess.run(
            command_line, cwd=tmp_path, env=env, stdout=write, stderr=stderr, check=False
        )
    os.close(write)
    assert (done.returncode, errors.read_text()) == (128 + signal.SIGPIPE, "")


def test_ctrl_c_ends_the_command_silently(start: Start) -> None:
    process = start("app.simulator", f"tcp/127.0.0.1:{free_port()}")
    assert process.stderr is not None
    assert "listening at tcp/127.0.0.1:" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    done = command.finished(process)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
