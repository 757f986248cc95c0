"""Releases: each is a Python environment of its own in /opt/operator-panel/releases. The link `current`
says which one runs, `previous` which one ran before."""

import hashlib
import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.install.host import Host, StepFailed

BASE: Final = "/opt/operator-panel"
RELEASES: Final = f"{BASE}/releases"
COMPLETE: Final = ".complete"
HASH_LENGTH: Final = 8


def release_name(wheel: Path) -> str:
    """`0.1.0-3fa2c1d0`: the version, and which build of it."""
    version = wheel.name.split("-")[1]
    return f"{version}-{hashlib.sha256(wheel.read_bytes()).hexdigest()[:HASH_LENGTH]}"


def linked(host: Host, link: str) -> str:
    """The name of the release that `current` or `previous` leads to; "" for none."""
    path = host.path(f"{BASE}/{link}")
    return Path(os.readlink(path)).name if path.is_symlink() else ""


def link_to(host: Host, link: str, name: str) -> None:
    """Points `current` or `previous` to a release. At each moment it leads to the old or the new."""
    draft = host.path(f"{BASE}/.{link}.new")
    draft.unlink(missing_ok=True)
    draft.symlink_to(f"releases/{name}")
    draft.replace(host.path(f"{BASE}/{link}"))


def forget(host: Host, name: str) -> None:
    """Removes a release that is no good: nothing goes back to it."""
    if linked(host, "previous") == name:
        host.path(f"{BASE}/previous").unlink()
    shutil.rmtree(host.path(f"{RELEASES}/{name}"), ignore_errors=True)


def wheel_in(host: Host, name: str) -> Path:
    """The wheel that a release was made of; StepFailed if it is gone."""
    found = list(host.path(f"{RELEASES}/{name}").glob("*.whl"))
    if not found:
        raise StepFailed(
            f"{RELEASES}/{name} has no wheel: remove the folder and install that release again"
        )
    return found[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Release:
    """The environment of a wheel, with the locked versions of what it needs. `wheels` is a folder to
    take them from, for a machine without a package index."""

    wheel: Path
    lock: str
    wheels: Path | None = None

    @property
    def name(self) -> str:
        return release_name(self.wheel)

    @property
    def folder(self) -> str:
        return f"{RELEASES}/{self.name}"

    def describe(self, host: Host) -> str:
        source = f"the wheels in {self.wheels}" if self.wheels else "the package index"
        return f"install {self.wheel.name} into {self.folder} (needs from {source})"

    def is_done(self, host: Host) -> bool:
        return host.path(f"{self.folder}/{COMPLETE}").exists()

    def do(self, host: Host) -> None:
        folder = host.path(self.folder)
        shutil.rmtree(folder, ignore_errors=True)  # a run that was cut off
        host.path(RELEASES).mkdir(parents=True, exist_ok=True)
        host.run(["python3", "-m", "venv", self.folder])
        shutil.copy2(self.wheel, folder)
        (folder / "requirements.lock").write_text(self.lock)
        pip = [f"{self.folder}/bin/python", "-m", "pip", "install", "--quiet"]
        pip += ["--disable-pip-version-check", "--no-cache-dir", *self._sources(host)]
        host.run([*pip, "--require-hashes", "-r", f"{self.folder}/requirements.lock"])
        host.run([*pip, "--no-deps", f"{self.folder}/{self.wheel.name}"])
        os.sync()
        (folder / COMPLETE).touch()

    def undo(self, host: Host) -> str:
        base = host.path(BASE)
        if not base.exists():
            return ""
        shutil.rmtree(base)
        return f"removed {BASE}"

    def _sources(self, host: Host) -> list[str]:
        if self.wheels is None:
            return []
        if not host.is_this_machine:  # the command runs inside
            shutil.copytree(self.wheels, host.path(f"{self.folder}/wheels"))
            return ["--no-index", f"--find-links={self.folder}/wheels"]
        return ["--no-index", f"--find-links={self.wheels}"]


def remove_old(host: Host) -> None:
    """Removes all releases but that which runs and the one before it."""
    keep = {linked(host, "current"), linked(host, "previous")}
    for release in host.path(RELEASES).iterdir():
        if release.name not in keep:
            shutil.rmtree(release, ignore_errors=True)


@dataclass(frozen=True, slots=True)
class Current:
    """The release that runs. With `removes_old` releases older than the one before are removed."""

    name: str
    removes_old: bool = True

    def describe(self, host: Host) -> str:
        return f"make {self.name} the release that runs"

    def is_done(self, host: Host) -> bool:
        return linked(host, "current") == self.name

    def do(self, host: Host) -> None:
        before = linked(host, "current")
        if before:
            link_to(host, "previous", before)
        link_to(host, "current", self.name)
        if self.removes_old:
            remove_old(host)

    def undo(self, host: Host) -> str:
        return ""  # goes with the releases


@dataclass(frozen=True, slots=True)
class CheckedPanel:
    """The panel file is good for a release."""

    name: str
    panel: str

    def _command(self) -> list[str]:
        return [f"{RELEASES}/{self.name}/bin/operator-panel", "check", self.panel]

    def describe(self, host: Host) -> str:
        return f"check {self.panel}"

    def is_done(self, host: Host) -> bool:
        program = host.path(self._command()[0])
        return program.exists() and host.succeeds(self._command())

    def do(self, host: Host) -> None:
        host.run(self._command())

    def undo(self, host: Host) -> str:
        return ""
