"""Files that are written whole or not at all: a reader finds the old content or the new one, also after
a crash, a full disk or a loss of power.

A new file beside it takes its place. Below folders that others may write, see
`app/tools/install/file_tree.py`.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Final, TypedDict, Unpack

SUFFIX: Final = ".new"  # of a file that is being written, or was left by a process that was killed
PRIVATE: Final = 0o600
LEFT_AFTER_S: Final = 600.0  # no process is writing such a file any more
NEW: Final = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC


class Options(TypedDict, total=False):
    """How a file is written.

    `mode`: its bits; None is what the umask leaves. Nobody else reads it before it has them.
    `like`: a file whose mode and, where that is permitted, owner it gets instead.
    `of_folder`: what root writes belongs to the owner of its folder, so that the server can use it.
    `durable`: it is on the disk then, and so is its place.
    `replaces`: without it, FileExistsError for a file that is there.
    `check`: called right before it takes its place; what it raises keeps the old content.
    """

    mode: int | None
    like: os.stat_result | None
    of_folder: bool
    durable: bool
    replaces: bool
    check: Callable[[], None]


@contextmanager
def whole_file(path: Path, **options: Unpack[Options]) -> Iterator[BinaryIO]:
    """A new file that takes the place of `path` after the block; its `name` is its own path. If the
    block fails, or the disk, nothing of it is left and `path` is as before. OSError."""
    mode, like = options.get("mode", PRIVATE), options.get("like")
    draft = path.with_name(f".{path.name}.{os.urandom(4).hex()}{SUFFIX}")
    first_mode = 0o666 if mode is None and like is None else PRIVATE
    try:
        with open(draft, "wb", opener=lambda name, _: os.open(name, NEW, first_mode)) as written:
            descriptor = written.fileno()
            if options.get("of_folder", False):
                give_to_owner_of(path.parent, descriptor)
            yield written
            written.flush()
            if like is not None:
                _make_like(like, descriptor)
            elif mode is not None and mode != first_mode:
                os.fchmod(descriptor, mode)
            if options.get("durable", True):
                os.fsync(descriptor)
        options.get("check", lambda: None)()
        if options.get("replaces", True):
            draft.replace(path)
        else:
            os.link(draft, path)
            draft.unlink()
    except BaseException:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
        raise
    _remove_left(path)
    if options.get("durable", True):
        sync_folder(path.parent)


def _remove_left(path: Path) -> None:
    """Removes what processes that were killed have left of earlier writes of this file."""
    begin, oldest = f".{path.name}.", time.time() - LEFT_AFTER_S
    with suppress(OSError):
        for name in os.listdir(path.parent):
            if name.startswith(begin) and name.endswith(SUFFIX):
                left = path.with_name(name)
                if left.lstat().st_mtime < oldest:
                    left.unlink()


def write_whole(path: Path, content: bytes, **options: Unpack[Options]) -> None:
    """Writes a file as `whole_file` does. OSError."""
    with whole_file(path, **options) as file:
        file.write(content)


def sync_folder(folder: Path) -> None:
    """What was put into a folder, or removed from it, is on the disk then. OSError."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def give_to_owner_of(folder: Path, file: int | Path) -> None:
    """What root makes belongs to the owner of the folder that it is in."""
    if os.geteuid() == 0:
        owner = folder.stat()
        with suppress(OSError):
            os.chown(file, owner.st_uid, owner.st_gid)


def _make_like(like: os.stat_result, descriptor: int) -> None:
    if (like.st_uid, like.st_gid) != (os.geteuid(), os.getegid()):
        with suppress(OSError):
            os.fchown(descriptor, like.st_uid, like.st_gid)
    os.fchmod(descriptor, like.st_mode & 0o777)
