"""A shell in a checkout with its own network namespace, for the commands that pages show."""

import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Final

from tests.support.checkout import copy_project
from tests.support.parts import BRIDGE, CYCLONE_ON_LOOPBACK, Process, until

# Programs that a reader has: the installed command, and the bridge, whose options the tests' own lacks.
PROGRAMS: Final = {
    "operator-panel": 'exec .venv/bin/python -m app.cli "$@"',
    "zenoh-bridge-ros2dds": f'[ "$1 $#" = "-c 2" ] || exit 2\nexec {shlex.quote(str(BRIDGE))} "$2"',
}


class Shell:
    """Its ports are free and visible to its commands only. `close` ends running commands."""

    def __init__(self, folder: Path) -> None:
        """Makes the checkout in `folder`."""
        self.checkout = folder / "operator-panel"
        self._make_checkout()
        programs = folder / "bin"
        programs.mkdir()
        for name, script in PROGRAMS.items():
            (programs / name).write_text(f"#!/bin/sh\n{script}\n")
            (programs / name).chmod(0o755)
        self.home = folder / "home"
        self.home.mkdir()
        path = [str(programs), str(self.checkout / ".venv/bin"), os.environ["PATH"]]
        self._env = {
            "HOME": str(self.home),
            "PATH": ":".join(path),
            "KIOSK_DATA": str(folder / "data"),
            "CYCLONEDDS_URI": CYCLONE_ON_LOOPBACK,
            "PYTHONPATH": "",
            "MAKEFLAGS": "",
        }
        self._holder = subprocess.Popen(
            ["unshare", "--net", "sh", "-c", "ip link set lo up && echo up && exec cat"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        assert self._holder.stdout is not None
        assert self._holder.stdout.readline() == b"up\n"
        self._running: list[Process] = []

    def _make_checkout(self) -> None:
        """Copies the project, with a `.venv` of the tests' packages, as after `make run`."""
        copy_project(self.checkout)
        environment = self.checkout / ".venv"
        environment.mkdir()
        for name in ("lib", "include", "pyvenv.cfg"):
            (environment / name).symlink_to(Path(sys.prefix) / name)
        (environment / "bin").mkdir()  # `make run` adds a command to it
        for path in Path(sys.prefix, "bin").iterdir():
            if path.name != "operator-panel":
                (environment / "bin" / path.name).symlink_to(path)
        for done in ("run", "build", "test"):
            (environment / done).touch()

    def _command(self, command: str) -> list[str]:
        return ["nsenter", f"--net=/proc/{self._holder.pid}/ns/net", "sh", "-c", command]

    def run(self, command: str) -> subprocess.CompletedProcess[str]:
        """To its end; stdout has stderr too. A test that is stopped leaves none of its processes."""
        process = subprocess.Popen(
            self._command(command),
            cwd=self.checkout,
            env={**os.environ, **self._env},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        try:
            stdout, _ = process.communicate()
        except BaseException:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            raise
        return subprocess.CompletedProcess(process.args, process.returncode, stdout)

    def start(self, command: str, ready: str) -> Process:
        """Until it has printed `ready`."""
        process = Process(
            self._command(f"exec 1>&2\n{command}"), self._env, cwd=self.checkout, start_new_session=True
        )
        self._running.append(process)
        try:
            until(lambda: ready in process.text or not process.running, ready, within_s=60)
            assert ready in process.text, process.text
        except BaseException:
            self.interrupt(process)
            raise
        return process

    def interrupt(self, process: Process) -> None:
        """As Ctrl-C does: all processes of the command get SIGINT."""
        self._running.remove(process)
        if process.running:
            os.killpg(process.pid, signal.SIGINT)
            process.wait(30)
        process.end()

    def close(self) -> None:
        for process in list(self._running):
            self.interrupt(process)
        self._holder.communicate(timeout=10)
