"""Files below a folder, reached name by name from its descriptor, so that no link and no race leads out
of it: the system follows no link here. A link is read, and its names are resolved below the folder."""

import errno
import os
import shutil
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Final

MOST_LINKS: Final = 40  # as many as Linux follows
FOLDER: Final = os.O_PATH | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
# O_NONBLOCK: a pipe does not block.
READ: Final = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
CREATE: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
FILE_MODE: Final = 0o644
FOLDER_MODE: Final = 0o755


class OutsideError(OSError):
    """What a path leads to is not the folder's: `filename2` is where its link leads."""


@dataclass(frozen=True, slots=True)
class FileTree:
    """The files below `root`, which is as "/" to its links (chroot(2)). If `confined`, a link may lead
    only to what is really below `root`, else OutsideError. Paths are relative to `root`, also with a
    first "/". All functions raise OSError."""

    root: Path
    confined: bool = False

    def read(self, path: str) -> bytes:
        """The content of a regular file."""
        return self._open(path)[0]

    def is_file(self, path: str) -> bool:
        return self._is(path, stat.S_ISREG)

    def is_folder(self, path: str) -> bool:
        return self._is(path, stat.S_ISDIR)

    def exists(self, path: str) -> bool:
        return self._is(path, lambda mode: True)

    def link_target(self, path: str) -> str:
        """Where a link leads; "" if it is not a link."""
        try:
            with self._place(path) as (folder, name):
                return os.readlink(name, dir_fd=folder)
        except OSError:
            return ""

    def names(self, path: str) -> list[str]:
        """What a folder has; empty if it is not there."""
        try:
            with self._place(f"{path}/.", follows=True) as (folder, name):
                descriptor = os.open(name, READ | os.O_DIRECTORY, dir_fd=folder)
        except FileNotFoundError:
            return []
        try:
            return sorted(os.listdir(descriptor))
        finally:
            os.close(descriptor)

    def make_folder(self, path: str) -> None:
        with self._place(f"{path}/.", makes=True):
            pass

    def write(self, path: str, content: bytes, mode: int | None = None) -> None:
        """Writes a file as a whole: after a power cut it is the old one or the new one. Without a mode
        it has the mode and owner of the file that it replaces. A link is replaced, not followed."""
        with self._place(path, makes=True) as (folder, name):
            before = _stat(folder, name) if mode is None else None
            if before is not None and stat.S_ISREG(before.st_mode):
                _write(folder, name, content, stat.S_IMODE(before.st_mode), before)
            else:
                _write(folder, name, content, FILE_MODE if mode is None else mode)

    def copy(self, path: str, to: str) -> None:
        """Writes a regular file once more, with its mode and owner."""
        content, about = self._open(path)
        with self._place(to, makes=True) as (folder, name):
            _write(folder, name, content, stat.S_IMODE(about.st_mode), about)

    def link(self, path: str, target: str) -> None:
        """Makes a link; at each moment it is the old one or the new one."""
        with self._place(path, makes=True) as (folder, name):
            draft = _draft(folder, name)
            os.symlink(target, draft, dir_fd=folder)
            os.replace(draft, name, src_dir_fd=folder, dst_dir_fd=folder)

    def remove(self, path: str) -> None:
        """Removes a file or a link."""
        with self._place(path) as (folder, name):
            os.unlink(name, dir_fd=folder)

    def remove_tree(self, path: str) -> bool:
        """Removes a folder with all that is in it; whether it was there. A link is not a folder."""
        with suppress(FileNotFoundError, NotADirectoryError), self._place(path) as (folder, name):
            shutil.rmtree(name, dir_fd=folder)
            return True
        return False

    def _open(self, path: str) -> tuple[bytes, os.stat_result]:
        """A regular file's content, and about it."""
        with self._place(path, follows=True) as (folder, name):
            descriptor = os.open(name, READ, dir_fd=folder)
        try:
            about = os.fstat(descriptor)
            self._check(path, about)
            with open(descriptor, "rb", closefd=False) as file:
                return file.read(), about
        finally:
            os.close(descriptor)

    def _is(self, path: str, kind: Callable[[int], bool]) -> bool:
        try:
            with self._place(path, follows=True) as (folder, name):
                about = _stat(folder, name)
        except OSError:
            return False
        return about is not None and kind(about.st_mode)

    def _check(self, path: str, about: os.stat_result) -> None:
        if not stat.S_ISREG(about.st_mode):
            raise OSError(errno.EINVAL, "it is not a regular file", path)
        # Who makes a second name for a file (link(2)) may have no right to read it.
        if self.confined and about.st_nlink > 1 and about.st_uid != self.root.stat().st_uid:
            raise OutsideError(errno.EXDEV, "it is a second name of another user's file", path)

    @contextmanager
    def _place(
        self, path: str, *, follows: bool = False, makes: bool = False
    ) -> Iterator[tuple[int, str]]:
        """The descriptor of the folder of a path's last name, and that name. With `follows` it is not a
        link; with `makes` folders that are missing are made."""
        walk = _Walk(self, path)
        try:
            yield walk.place(follows, makes)
        finally:
            walk.go_up(0)


@dataclass(slots=True)
class _Walk:
    """The way to a path's last name. `folders` are the open folders from the root on."""

    tree: FileTree
    path: str
    folders: list[int] = field(default_factory=list)
    links: int = 0

    def place(self, follows: bool, makes: bool) -> tuple[int, str]:
        self.folders.append(os.open(self.tree.root, FOLDER & ~os.O_NOFOLLOW))
        names = _names(self.path)
        if self.path.endswith("/."):  # the name before it is that of a folder on the way
            names.append(".")
        while names:
            name = names.pop(0)
            if name == "..":
                self._up()
                continue
            target = _target(self.folders[-1], name) if names or follows else None
            if target is not None:
                names = [*self._names_of(target), *names]
            elif not names:
                return self.folders[-1], name
            else:
                self._down(name, makes)
        return self.folders[-1], "."

    def go_up(self, depth: int) -> None:
        while len(self.folders) > depth:
            os.close(self.folders.pop())

    def _down(self, name: str, makes: bool) -> None:
        folder = self.folders[-1]
        if makes:
            with suppress(FileExistsError):
                os.mkdir(name, FOLDER_MODE, dir_fd=folder)
        self.folders.append(os.open(name, FOLDER, dir_fd=folder))

    def _up(self) -> None:
        if len(self.folders) == 1 and self.tree.confined:
            raise OutsideError(errno.EXDEV, "it leads out of the folder", self.path, None, "..")
        self.go_up(max(1, len(self.folders) - 1))

    def _names_of(self, target: str) -> list[str]:
        """The names that a link leads to, from the folder that is reached."""
        self.links += 1
        if self.links > MOST_LINKS:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), self.path)
        if not target.startswith("/"):
            return _names(target)
        self.go_up(1)
        if not self.tree.confined:
            return _names(target)
        try:
            return _names(str(PurePosixPath(target).relative_to(self.tree.root)))
        except ValueError:
            why = f"it is a link to {target}"
            raise OutsideError(errno.EXDEV, why, self.path, None, target) from None


def _names(path: str) -> list[str]:
    return [name for name in path.split("/") if name not in ("", ".")]


def _target(folder: int, name: str) -> str | None:
    """Where a link leads; None if it is not a link, or not there."""
    try:
        return os.readlink(name, dir_fd=folder)
    except OSError:
        return None


def _stat(folder: int, name: str) -> os.stat_result | None:
    """About a file, or a link itself; None if it is not there."""
    try:
        return os.stat(name, dir_fd=folder, follow_symlinks=False)
    except FileNotFoundError:
        return None


def _write(
    folder: int, name: str, content: bytes, mode: int, owner: os.stat_result | None = None
) -> None:
    draft = _draft(folder, name)
    with open(os.open(draft, CREATE, 0o600, dir_fd=folder), "wb") as file:
        if owner is not None:
            os.fchown(file.fileno(), owner.st_uid, owner.st_gid)
        os.fchmod(file.fileno(), mode)
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    os.replace(draft, name, src_dir_fd=folder, dst_dir_fd=folder)


def _draft(folder: int, name: str) -> str:
    """A name beside it that is free."""
    draft = f".{name}.new"
    with suppress(FileNotFoundError):
        os.unlink(draft, dir_fd=folder)
    return draft
