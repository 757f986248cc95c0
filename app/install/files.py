"""Steps that write files, and the folders around them."""

import shutil
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
        path = host.path(self.path)
        return path.is_file() and path.read_text(errors="replace") == self.content

    def do(self, host: Host) -> None:
        write(host, self.path, self.content.encode(), self.mode)

    def undo(self, host: Host) -> str:
        path = host.path(self.path)
        if not path.is_file():
            return ""
        path.unlink()
        return f"removed {self.path}"


@dataclass(frozen=True, slots=True, kw_only=True)
class UsersFile:
    """A file that the user changes: written if there is none, or if a new one is given; kept at the
    end."""

    path: str
    content: str
    about: str
    replaces: bool = False

    def describe(self, host: Host) -> str:
        return f"write {self.path} ({self.about})"

    def is_done(self, host: Host) -> bool:
        path = host.path(self.path)
        if not self.replaces:
            return path.exists()
        return path.is_file() and path.read_text(errors="replace") == self.content

    def do(self, host: Host) -> None:
        path = host.path(self.path)
        if path.exists():
            shutil.copy2(path, path.with_name(f"{path.name}.before"))
        write(host, self.path, self.content.encode(), 0o644)

    def undo(self, host: Host) -> str:
        return f"kept {self.path}" if host.path(self.path).exists() else ""


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
        path = host.path(self.path)
        return path.is_symlink() and str(path.readlink()) == "/dev/null"

    def do(self, host: Host) -> None:
        path = host.path(self.path)
        if path.exists() or path.is_symlink():
            raise StepFailed(f"{self.path} is not of this installation: remove it, then run this again")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to("/dev/null")

    def undo(self, host: Host) -> str:
        if not self.is_done(host):
            return ""
        host.path(self.path).unlink()
        return f"unmasked {self.unit}"


def write(host: Host, path: str, content: bytes, mode: int) -> None:
    """Writes a file as a whole: after a power cut it is the old one or the new one."""
    target = host.path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    draft = target.with_name(f".{target.name}.new")
    draft.write_bytes(content)
    draft.chmod(mode)
    draft.replace(target)
