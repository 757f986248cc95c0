"""Releases of the panel: their environments, and the files of a wheel."""

import hashlib
import os
import sys
import zipfile
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import Final

from app.system.errors import SettingsError
from app.system.settings import PACKAGE, shipped_path
from app.tools.install.file_tree import FileTree
from app.tools.install.host import Host, StepFailed

# The files of deploy/ as a wheel has them, and which wheel this program was read from.

WHEEL_SUFFIX: Final = ".whl"
NAME: Final = "operator_panel-"


class Assets:
    """The shipped files of a wheel; without one those of this program."""

    def __init__(self, wheel: Path | BytesIO | None = None) -> None:
        self._wheel = wheel

    def text(self, name: str) -> str:
        """The text of a file, such as `deploy/kiosk.toml` or `panel.toml`; SettingsError if the wheel
        does not have it."""
        if self._wheel is None:
            return shipped_path(name).read_text()
        try:
            with zipfile.ZipFile(self._wheel) as archive:
                return archive.read(f"app/{name}").decode()
        except (OSError, KeyError, zipfile.BadZipFile) as error:
            name = f"{self._wheel}" if isinstance(self._wheel, Path) else "the release's wheel"
            raise SettingsError(f"{name} is no wheel of the operator panel: {error}") from error


def own_wheel() -> Path | None:
    """The wheel that this program runs from: its file, or that which its release was made of. None in a
    checkout."""
    runs_from = (part for part in PACKAGE.parents if part.name.endswith(WHEEL_SUFFIX))
    return next(runs_from, None) or next(Path(sys.prefix).glob(f"{NAME}*{WHEEL_SUFFIX}"), None)


def checked_wheel(path: Path | None) -> Path:
    """The wheel to install; SettingsError says which is expected."""
    wheel = path or own_wheel()
    if wheel is None:
        raise SettingsError(
            "the wheel is missing: name it, such as dist/operator_panel-0.1.0-py3-none-any.whl"
            " (`make wheel` builds it)"
        )
    if not (wheel.is_file() and wheel.name.startswith(NAME) and wheel.name.endswith(WHEEL_SUFFIX)):
        raise SettingsError(f"{wheel} is no wheel of the operator panel: operator_panel-….whl")
    return wheel.resolve()


# Releases: each is a Python environment of its own in /opt/operator-panel/releases. The link `current`
# says which one runs, `previous` which one ran before.

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
    return PurePosixPath(host.files.link_target(f"{BASE}/{link}")).name


def link_to(host: Host, link: str, name: str) -> None:
    """Points `current` or `previous` to a release. At each moment it leads to the old or the new."""
    host.files.link(f"{BASE}/{link}", f"releases/{name}")


def forget(host: Host, name: str) -> None:
    """Removes a release that is no good: nothing goes back to it."""
    if linked(host, "previous") == name:
        host.files.remove(f"{BASE}/previous")
    host.files.remove_tree(f"{RELEASES}/{name}")


def wheel_in(host: Host, name: str) -> bytes:
    """The wheel that a release was made of; StepFailed if it is gone."""
    wheels = [file for file in host.files.names(f"{RELEASES}/{name}") if file.endswith(WHEEL_SUFFIX)]
    if not wheels:
        raise StepFailed(
            f"{RELEASES}/{name} has no wheel: remove the folder and install that release again"
        )
    return host.files.read(f"{RELEASES}/{name}/{wheels[0]}")


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
        return host.files.exists(f"{self.folder}/{COMPLETE}")

    def do(self, host: Host) -> None:
        files = host.files
        files.remove_tree(self.folder)  # a run that was cut off
        files.make_folder(RELEASES)
        host.run(["python3", "-m", "venv", self.folder])
        files.write(f"{self.folder}/{self.wheel.name}", self.wheel.read_bytes())
        files.write(f"{self.folder}/requirements.lock", self.lock.encode())
        pip = [f"{self.folder}/bin/python", "-m", "pip", "install", "--quiet"]
        pip += ["--disable-pip-version-check", "--no-cache-dir", *self._sources(host)]
        host.run([*pip, "--require-hashes", "-r", f"{self.folder}/requirements.lock"])
        host.run([*pip, "--no-deps", f"{self.folder}/{self.wheel.name}"])
        os.sync()
        files.write(f"{self.folder}/{COMPLETE}", b"")

    def undo(self, host: Host) -> str:
        return f"removed {BASE}" if host.files.remove_tree(BASE) else ""

    def _sources(self, host: Host) -> list[str]:
        if self.wheels is None:
            return []
        if not host.is_this_machine:  # the command runs inside
            wheels = FileTree(self.wheels, confined=True)
            for name in wheels.names(""):
                if wheels.is_folder(name):
                    continue
                host.files.write(f"{self.folder}/wheels/{name}", wheels.read(name))
            return ["--no-index", f"--find-links={self.folder}/wheels"]
        return ["--no-index", f"--find-links={self.wheels}"]


def remove_old(host: Host) -> None:
    """Removes all releases but that which runs and the one before it."""
    keep = {linked(host, "current"), linked(host, "previous")}
    for release in host.files.names(RELEASES):
        if release not in keep:
            host.files.remove_tree(f"{RELEASES}/{release}")


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
        return host.files.exists(self._command()[0]) and host.succeeds(self._command())

    def do(self, host: Host) -> None:
        host.run(self._command())

    def undo(self, host: Host) -> str:
        return ""
