"""Steps that write files, and the folders around them."""

from dataclasses import dataclass

from app.install.host import Host, StepFailed


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
