"""The steps of a plan: files and folders, packages, users and units."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from app.tools.install.host import APT_ENV, Host, StepFailed

# Steps of the operating system: packages, users, units.

WANTS_FOLDER: Final = "/etc/systemd/system/multi-user.target.wants"


@dataclass(frozen=True, slots=True)
class Packages:
    """Debian packages. `undo` keeps them: other programs may use them."""

    names: Sequence[str]

    def _missing(self, host: Host) -> list[str]:
        return [name for name in self.names if not _is_installed(host, name)]

    def describe(self, host: Host) -> str:
        return f"install the packages {', '.join(self._missing(host) or self.names)} (apt-get)"

    def is_done(self, host: Host) -> bool:
        return not self._missing(host)

    def do(self, host: Host) -> None:
        host.run(["apt-get", "update", "-qq"], APT_ENV)
        get = ["apt-get", "install", "-y", "-qq", "--no-install-recommends"]
        host.run([*get, *self._missing(host)], APT_ENV)

    def undo(self, host: Host) -> str:
        there = [name for name in self.names if _is_installed(host, name)]
        return f"kept the packages {', '.join(there)}" if there else ""


def _is_installed(host: Host, package: str) -> bool:
    query = ["dpkg-query", "--show", "--showformat=${db:Status-Status}", package]
    try:
        return host.run(query) == "installed"
    except StepFailed:  # a package that dpkg does not know
        return False


@dataclass(frozen=True, slots=True)
class User:
    """A system user, as a file of sysusers.d(5) that a step before has written describes it."""

    name: str
    file: str

    def describe(self, host: Host) -> str:
        return f"add the user {self.name}, without log-in"

    def is_done(self, host: Host) -> bool:
        if not host.files.is_file("/etc/passwd"):
            return False
        users = host.files.read("/etc/passwd").splitlines()
        return any(user.startswith(f"{self.name}:".encode()) for user in users)

    def do(self, host: Host) -> None:
        host.run(["systemd-sysusers", self.file])

    def undo(self, host: Host) -> str:
        if not self.is_done(host):
            return ""
        host.run(["userdel", self.name])
        return f"removed the user {self.name}"


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit that starts with the machine, and now: again after a step that changed something. Its file
    is another step's."""

    name: str

    def describe(self, host: Host) -> str:
        return f"enable {self.name}" + (" and start it" if host.runs_systemd else "")

    def is_done(self, host: Host) -> bool:
        if not host.files.link_target(f"{WANTS_FOLDER}/{self.name}"):
            return False
        return not host.runs_systemd or host.succeeds(["systemctl", "is-active", "--quiet", self.name])

    def do(self, host: Host) -> None:
        host.run(["systemctl", "enable", "--quiet", self.name])
        if host.runs_systemd:
            host.run(["systemctl", "daemon-reload"])
            host.run(["systemctl", "restart", "--no-block", self.name])

    def undo(self, host: Host) -> str:
        if not host.files.link_target(f"{WANTS_FOLDER}/{self.name}"):
            return ""
        if host.runs_systemd:
            host.run(["systemctl", "stop", self.name])
        host.run(["systemctl", "disable", "--quiet", self.name])
        return f"stopped and disabled {self.name}"


# What a plan consists of.


class InstallStep(Protocol):
    """One thing that is so when it is done. `do` and `undo` may be repeated."""

    def describe(self, host: Host) -> str:
        """What `do` does, in the imperative."""

    def is_done(self, host: Host) -> bool: ...

    def do(self, host: Host) -> None:
        """StepFailed if it can't be done."""

    def undo(self, host: Host) -> str:
        """Takes it back; returns what was done, "" for nothing."""


def describe(steps: Sequence[InstallStep], host: Host) -> Iterator[str]:
    """A line for each step: what it would do, or that it is done."""
    for step in steps:
        yield f"{'done' if step.is_done(host) else 'to do':5}  {step.describe(host)}"


def apply(steps: Sequence[InstallStep], host: Host, say: Callable[[str], object]) -> int:
    """Does the steps that are not done, in their order; returns how many there were. A unit that
    runs is started again after any of them, so that it has what they changed."""
    done = 0
    for step in steps:
        if (done and isinstance(step, Unit)) or not step.is_done(host):
            say(step.describe(host))
            step.do(host)
            done += 1
    return done


def revert(steps: Sequence[InstallStep], host: Host, say: Callable[[str], object]) -> None:
    """Takes the steps back, the last first."""
    for step in reversed(steps):
        if said := step.undo(host):
            say(said)


# Steps that write files, and the folders around them.


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnFile:
    """A file that belongs to the installation: written again when it differs, removed at the end."""

    path: str
    content: str
    about: str
    mode: int = 0o644

    def describe(self, host: Host) -> str:
        return f"write {self.path} ({self.about})"

    def is_done(self, host: Host) -> bool:
        return has_content(host, self.path, self.content.encode())

    def do(self, host: Host) -> None:
        host.files.write(self.path, self.content.encode(), self.mode)

    def undo(self, host: Host) -> str:
        if not host.files.is_file(self.path):
            return ""
        host.files.remove(self.path)
        return f"removed {self.path}"


@dataclass(frozen=True, slots=True, kw_only=True)
class UsersFile:
    """A file that the user changes: written if there is none, or if a new one is given; kept at the
    end. A new one has the mode and owner of the one before."""

    path: str
    content: str
    about: str
    replaces: bool = False

    def describe(self, host: Host) -> str:
        return f"write {self.path} ({self.about})"

    def is_done(self, host: Host) -> bool:
        if not self.replaces:
            return host.files.exists(self.path)
        return has_content(host, self.path, self.content.encode())

    def do(self, host: Host) -> None:
        if host.files.is_file(self.path):
            host.files.copy(self.path, f"{self.path}.before")
        host.files.write(self.path, self.content.encode())

    def undo(self, host: Host) -> str:
        return f"kept {self.path}" if host.files.exists(self.path) else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Masked:
    """A unit that systemd does not start."""

    unit: str
    about: str

    @property
    def path(self) -> str:
        return f"/etc/systemd/system/{self.unit}"

    def describe(self, host: Host) -> str:
        return f"mask {self.unit} ({self.about})"

    def is_done(self, host: Host) -> bool:
        return host.files.link_target(self.path) == "/dev/null"

    def do(self, host: Host) -> None:
        if host.files.link_target(self.path) or host.files.exists(self.path):
            raise StepFailed(f"{self.path} is not of this installation: remove it, then run this again")
        host.files.link(self.path, "/dev/null")

    def undo(self, host: Host) -> str:
        if not self.is_done(host):
            return ""
        host.files.remove(self.path)
        return f"unmasked {self.unit}"


def has_content(host: Host, path: str, content: bytes) -> bool:
    """Whether a file is there, with this content."""
    return host.files.is_file(path) and host.files.read(path) == content
