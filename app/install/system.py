"""Steps of the operating system: packages, users, units."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from app.install.host import APT_ENV, Host, StepFailed

WANTED: Final = "/etc/systemd/system/multi-user.target.wants"


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
        if not host.files.link_target(f"{WANTED}/{self.name}"):
            return False
        return not host.runs_systemd or host.succeeds(["systemctl", "is-active", "--quiet", self.name])

    def do(self, host: Host) -> None:
        host.run(["systemctl", "enable", "--quiet", self.name])
        if host.runs_systemd:
            host.run(["systemctl", "daemon-reload"])
            host.run(["systemctl", "restart", "--no-block", self.name])

    def undo(self, host: Host) -> str:
        if not host.files.link_target(f"{WANTED}/{self.name}"):
            return ""
        if host.runs_systemd:
            host.run(["systemctl", "stop", self.name])
        host.run(["systemctl", "disable", "--quiet", self.name])
        return f"stopped and disabled {self.name}"
