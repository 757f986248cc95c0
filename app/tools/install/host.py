"""The machine that is installed on, or a folder that becomes one (`--root`)."""

import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.system.errors import SettingsError
from app.tools.install.file_tree import FileTree

APT_ENV: Final = {"DEBIAN_FRONTEND": "noninteractive"}


class StepFailed(SettingsError):
    """A step could not be done: what was done before it stays, and the next run goes on from there."""


@dataclass(frozen=True, slots=True)
class Host:
    """`root` is "/" for this machine; else commands run in it by chroot, and no unit is started."""

    root: Path = Path("/")

    @property
    def is_this_machine(self) -> bool:
        return self.root == Path("/")

    @property
    def runs_systemd(self) -> bool:
        """Whether units can be started: sd_booted(3)."""
        return self.is_this_machine and Path("/run/systemd/system").is_dir()

    @property
    def files(self) -> FileTree:
        """The machine's files by their absolute paths: no link leads out of `root`."""
        return FileTree(self.root)

    def run(self, command: Sequence[str], env: Mapping[str, str] | None = None) -> str:
        """The standard output of a command on the machine; StepFailed with its last lines."""
        inside = [] if self.is_this_machine else ["chroot", str(self.root)]
        try:
            done = subprocess.run(
                [*inside, *command],
                env={**_without_own(os.environ), **(env or {})},
                check=False,
                text=True,
                capture_output=True,
            )
        except OSError as error:
            raise StepFailed(f"{command[0]} can't be run: {error.strerror}") from error
        if done.returncode:
            last = "\n".join((done.stderr or done.stdout).strip().splitlines()[-8:])
            raise StepFailed(f"{' '.join(command)} failed:\n{last}")
        return done.stdout

    def succeeds(self, command: Sequence[str]) -> bool:
        try:
            self.run(command)
        except StepFailed:
            return False
        return True


def _without_own(env: Mapping[str, str]) -> dict[str, str]:
    """Without what is meant for this program: a release's Python has modules of its own."""
    return {name: value for name, value in env.items() if not name.startswith(("PYTHON", "KIOSK_"))}


def release_of(host: Host) -> tuple[str, str]:
    """(id, version) of the system, such as ("debian", "12"); os-release(5)."""
    keys = {}
    for name in ("/etc/os-release", "/usr/lib/os-release"):
        if host.files.is_file(name):
            for line in host.files.read(name).decode(errors="replace").splitlines():
                key, _, value = line.partition("=")
                keys[key] = value.strip('"')
            break
    return keys.get("ID", ""), keys.get("VERSION_ID", "")
