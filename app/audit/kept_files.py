"""Files by their SHA-256, kept beside the operator's log: each content once, bounded in number and
bytes. Blocks."""

import hashlib
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.errors import LogError

FOLDER: Final = "kept-files"
MOST_FILES: Final = 5000
MOST_BYTES: Final = 256_000_000
TEMPORARY: Final = ".new"
HASH: Final = re.compile(r"[0-9a-f]{64}")


class FileNotKept(LogError):
    """There is no file with this hash: it was never kept, or was removed since."""


class FileChanged(LogError):
    """The content of a kept file does not have its hash."""


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


class KeptFiles:
    """The folder of kept files; the newest use of each is its time of modification."""

    def __init__(self, data: Path, most_files: int = MOST_FILES, most_bytes: int = MOST_BYTES) -> None:
        self.folder = data / FOLDER
        self._most_files = most_files
        self._most_bytes = most_bytes

    def keep(self, contents: Mapping[str, bytes]) -> list[str]:
        """Keeps each content by its hash, in this order as long as all of them fit; returns the hashes
        of those that do not. Files that were not used for the longest time make room. OSError."""
        self.folder.mkdir(mode=0o700, exist_ok=True)
        self.folder.chmod(0o700)
        kept: list[str] = []
        too_many: list[str] = []
        room = self._most_bytes
        for digest, data in contents.items():
            if len(data) > room or len(kept) == self._most_files:
                too_many.append(digest)
                continue
            room -= len(data)
            kept.append(digest)
        self._prune(kept, sum(len(contents[digest]) for digest in kept))
        for digest in kept:
            self._write(digest, contents[digest])
        return too_many

    def read(self, digest: str) -> bytes:
        """The content with this hash; FileNotKept, FileChanged, OSError."""
        path = self.folder / digest
        if not HASH.fullmatch(digest):
            raise FileNotKept(f'"{digest}" is not the SHA-256 of a file')
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            raise FileNotKept(f"{path} is not there") from None
        if sha256(data) != digest:
            raise FileChanged(f"{path} was changed: its SHA-256 is no longer its name")
        return data

    def _write(self, digest: str, data: bytes) -> None:
        path = self.folder / digest
        with suppress(OSError):
            if path.stat().st_size == len(data):
                os.utime(path)
                return
        new = self.folder / (digest + TEMPORARY)
        with suppress(FileNotFoundError):
            new.unlink()
        fd = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        with open(fd, "wb") as file:
            file.write(data)
            file.flush()
            os.fdatasync(fd)
        new.replace(path)

    def _prune(self, needed: Collection[str], needed_bytes: int) -> None:
        """Removes files until those that are needed fit, the longest unused first."""
        others = sorted(self._files(without=frozenset(needed)))
        used = needed_bytes + sum(size for _, size, _ in others)
        count = len(needed) + len(others)
        for _, size, path in others:
            if count <= self._most_files and used <= self._most_bytes:
                return
            path.unlink(missing_ok=True)
            used, count = used - size, count - 1

    def _files(self, without: Collection[str]) -> Iterator[tuple[float, int, Path]]:
        """Time, size and path of each file; what a server that was killed left behind is removed."""
        for path in self.folder.iterdir():
            if path.name.endswith(TEMPORARY):
                path.unlink(missing_ok=True)
            elif path.name not in without and path.is_file():
                about = path.stat()
                yield about.st_mtime, about.st_size, path


def list_text(files: Iterable[tuple[str, str]]) -> bytes:
    """What `sha256sum` prints for files, by the order of their names: (name, hash) of each."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(files)).encode()


def list_digest(files: Iterable[tuple[str, str]]) -> str:
    """One hash for files: that of their list. "" without files."""
    text = list_text(files)
    return sha256(text) if text else ""
