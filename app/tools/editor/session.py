"""A panel file that is edited, on the disk: opened, saved, merged with what others write into it, with
backups, and with unsaved work that is there again after a crash."""

import fcntl
import hashlib
import json
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Final, Literal

from app.panel.file.keys import place_of
from app.panel.file.toml_lines import Path
from app.system.errors import InputError, os_error_text
from app.system.texts import TextLike, say
from app.system.whole_file import sync_folder, write_whole
from app.tools.editor.document import (
    BOM,
    Change,
    Delete,
    Document,
    Duplicate,
    Edit,
    EditError,
    Insert,
    Move,
    Paste,
    Rename,
    ReplaceText,
    SetValue,
)
from app.tools.editor.merge import FILE, Conflict, Side, merge
from app.tools.editor.sections import LISTS, SINGLE, Tables, keys_of

MOST_BACKUPS: Final = 50
MOST_BACKUP_BYTES: Final = 20_000_000
REMEMBERED: Final = 1000  # revisions to which an edit may refer
TRIES: Final = 3  # to save a file that another program writes at the same time
BACKUPS: Final = "backups"
LOCK: Final = "editor.lock"
RECOVERED: Final = "recovered.json"
SLOTS: Final = ("unsaved-0.json", "unsaved-1.json")  # written in turn: a torn one leaves the other
PATH: Final = "path"

DiskState = Literal["same", "changed", "gone"]


class SessionError(InputError):
    """A file that can't be read or written; nothing is lost by it."""


class EditBehind(EditError):
    """An edit of an older revision, of a table that has changed since."""

    status = 409


class SaveConflict(InputError):
    """The file has changed on the disk in tables that are changed here too. `EditSession.conflicts`
    lists them."""

    status = 409


class _ChangedAgain(Exception):
    """The file was written by another program while it was saved."""


@dataclass(frozen=True, slots=True)
class Saved:
    """`merged`: with changes that others have made in the file. `problem`: why there is no backup."""

    backup: FilePath | None
    merged: bool = False
    problem: TextLike = ""


@dataclass(frozen=True, slots=True)
class Recovered:
    """Work that was not saved when the editor ended. `saved_s`: when, since 1970."""

    text: str
    base: str
    saved_s: float


@dataclass(frozen=True, slots=True)
class HistoryEntry:
    """Who has made which change."""

    change: Change
    author: str


def state_folder(file: FilePath, environment: Mapping[str, str] = os.environ) -> FilePath:
    """Where the backups and the unsaved work of a panel file are: below $XDG_STATE_HOME, by default
    ~/.local/state."""
    home = environment.get("XDG_STATE_HOME") or FilePath.home() / ".local/state"
    name = re.sub(r"[^A-Za-z0-9._-]", "_", file.name)[:60]
    digest = hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:12]
    return FilePath(home) / "operator-panel/editor" / f"{name}-{digest}"


class EditSession:
    """One panel file and its document. All browsers of an editor share it.

    Not thread-safe but for the syncs of the journal, which have a thread of their own. Call `close` at
    the end.
    """

    def __init__(
        self, path: FilePath, folder: FilePath | None = None, clock: Callable[[], float] = time.time
    ) -> None:
        """SessionError if the file can't be read, or is open in another editor."""
        self.path = path
        self.folder = folder or state_folder(path)
        self.conflicts: tuple[Conflict, ...] = ()
        self.recovered: Recovered | None = None
        self._clock = clock
        self._choices: dict[str, Side | tuple[str]] = {}
        self._conflicting = b""  # what the file had that the conflicts are with
        self._lock: int | None = None
        self._base = self._read()
        self.document = Document(_decoded(self._base, path))
        self._tables: dict[int, Tables] = {0: self.document.tables}
        self._history: list[HistoryEntry] = []
        self._journal = _Journal(self.folder)
        self._open_folder()

    def close(self) -> None:
        """Waits for the journal. Unsaved work stays in it."""
        self._journal.close()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    @property
    def unsaved(self) -> bool:
        return self.document.data != self._base

    @property
    def base_text(self) -> str:
        """The text of the file as it was opened or saved last: what a diff is against."""
        return self._base.decode("utf-8-sig", errors="replace")

    @property
    def history(self) -> tuple[HistoryEntry, ...]:
        return tuple(self._history)

    # edits

    def apply(
        self, edits: Iterable[Edit], label: TextLike, *, revision: int | None = None, author: str = ""
    ) -> Change:
        """Makes edits that were made at a revision, by default the newest. On an older one they are
        followed to where their tables are now; EditBehind if those have changed since."""
        made = list(edits)
        if revision is not None and revision != self.document.revision:
            made = [self._rebased(edit, revision) for edit in made]
        return self._changed(self.document.apply(made, label), author)

    def undo(self, author: str = "") -> Change:
        return self._changed(self.document.undo(), author)

    def redo(self, author: str = "") -> Change:
        return self._changed(self.document.redo(), author)

    def _changed(self, change: Change, author: str) -> Change:
        self._history.append(HistoryEntry(change, author))
        del self._history[:-REMEMBERED]
        self._tables[self.document.revision] = self.document.tables
        self._tables.pop(self.document.revision - REMEMBERED, None)
        self._keep()
        return change

    def _keep(self) -> None:
        """Writes what is not saved into the journal; what the disk refuses is tried again with the next
        change."""
        if self.unsaved:
            self._journal.write(self.document.text, self.base_text, self._clock())
        else:
            self._journal.clear()

    @property
    def journal_problem(self) -> TextLike:
        """Why unsaved work would be lost in a crash; "" if it would not."""
        return self._journal.problem

    def _rebased(self, edit: Edit, revision: int) -> Edit:
        before = self._tables.get(revision)
        if before is None:
            raise EditBehind(say("edit_too_old"), edit.path)
        now = self.document.tables
        try:
            match edit:
                case Insert(path, value):
                    return Insert(_followed_place(before, now, path), value)
                case Paste(path, text):
                    return Paste(_followed_place(before, now, path), text)
                case Move(path, to):
                    return Move(_followed_table(before, now, path), _followed_place(before, now, to))
                case Duplicate(path, to):
                    return Duplicate(
                        _followed_table(before, now, path), _followed_place(before, now, to)
                    )
                case Delete(path):
                    return Delete(_followed_table(before, now, path))
                case ReplaceText(path, text):
                    return ReplaceText(_followed_table(before, now, path), text)
                case Paste(path, text):
                    return Paste(_followed_place(before, now, path), text)
                case Rename(path, name):
                    return Rename(_followed_key(before, now, path), name)
                case SetValue(path, value):
                    return SetValue(_followed_key(before, now, path), value)
        except LookupError as error:
            raise EditBehind(self._who_changed(edit.path, revision), edit.path) from error
        raise AssertionError(edit)

    def _who_changed(self, path: Path, revision: int) -> TextLike:
        later = [entry for entry in self._history if entry.change.revision > revision]
        near = [
            entry
            for entry in later
            if any(
                _table_of(each)[: len(path)] == path[: len(_table_of(each))]
                for each in entry.change.paths
            )
        ]
        entry = (near or later)[-1]
        place, label = place_of(path), entry.change.label
        if entry.author:
            return say("edit_behind", place=place, author=entry.author, label=label)
        return say("edit_changed_since", place=place, label=label)

    # disk

    def _read(self) -> bytes:
        try:
            return self.path.read_bytes()
        except OSError as error:
            raise SessionError(os_error_text(error)) from error

    @property
    def disk_state(self) -> DiskState:
        """Whether the file is as it was opened or saved last."""
        try:
            return "same" if self.path.read_bytes() == self._base else "changed"
        except FileNotFoundError:
            return "gone"
        except OSError:
            return "same"  # it can't be read now: nothing is known to have changed

    @property
    def has_old_conflicts(self) -> bool:
        """Whether its conflicts are with a text that the file no longer has, as with the half of one
        that a program was writing."""
        try:
            return bool(self.conflicts) and self.path.read_bytes() != self._conflicting
        except OSError:
            return False

    def merge_from_disk(self, author: str = "") -> bool:
        """Takes the changes that others have made in the file, as one step. Returns whether there are
        some; SaveConflict if both have changed the same tables."""
        disk = self._read()
        if disk == self._base:
            self.conflicts = ()
            return False
        theirs = _decoded(disk, self.path).removeprefix(BOM)
        merged = merge(self.base_text, self.document.text, theirs, self._choices)
        self.conflicts = merged.conflicts
        if merged.conflicts:
            self._conflicting = disk
            raise SaveConflict(say("edit_conflicts", number=len(merged.conflicts)))
        self._choices = {}
        self._base = disk
        if merged.text != self.document.text:
            change = self.document.apply([ReplaceText((), merged.text)], say("edit_merged"))
            self._changed(change, author)
        else:
            self._keep()
        return True

    def resolve(self, name: str, choice: Side | tuple[str]) -> None:
        """Chooses a side of a conflict, or another text in a tuple. `save` merges when all are
        chosen."""
        conflict = next((each for each in self.conflicts if each.name == name), None)
        if conflict is None:
            raise EditError(say("edit_no_conflict", name=name))
        if name == FILE:
            texts = {"base": conflict.base, "ours": conflict.ours, "theirs": conflict.theirs}
            text = choice[0] if isinstance(choice, tuple) else texts[choice]
            if (fault := Document(text or "").unreadable) is not None:
                raise EditError(say("edit_not_toml", reason=str(fault)))
        self._choices[name] = choice
        self.conflicts = tuple(each for each in self.conflicts if each.name != name)

    def save(self, *, recreate: bool = False, author: str = "") -> Saved:
        """Writes the file whole, or not at all: SessionError, or SaveConflict if it has changed on the
        disk in the same tables. `recreate`: also if the file was removed."""
        merged = False
        for _ in range(TRIES):
            on_disk = self._on_disk(recreate)
            if on_disk is not None and on_disk != self._base:
                merged = self.merge_from_disk(author) or merged
            try:
                backup, problem = self._write(on_disk)
            except _ChangedAgain:
                continue
            except OSError as error:
                raise SessionError(os_error_text(error)) from error
            return Saved(backup, merged, problem)
        raise SessionError(say("edit_file_changes", file=str(self.path)))

    def _on_disk(self, recreate: bool) -> bytes | None:
        """The bytes of the file; None if it was removed, and may be written again."""
        try:
            return self.path.read_bytes()
        except FileNotFoundError as error:
            if recreate:
                return None
            raise SessionError(say("edit_file_gone", file=str(self.path))) from error
        except OSError as error:
            raise SessionError(os_error_text(error)) from error

    def _write(self, on_disk: bytes | None) -> tuple[FilePath | None, TextLike]:
        """Writes the document; returns the backup of what the file had, or why there is none."""
        data = self.document.data
        backup: FilePath | None = None
        problem: TextLike = ""
        if on_disk != data:
            if on_disk is not None:
                try:
                    backup = self._back_up(on_disk)
                except OSError as error:
                    problem = os_error_text(error)
            _write_whole(self.path, data, on_disk)
        self._base = data
        self._journal.clear()
        return backup, problem

    # state of its own

    def _open_folder(self) -> None:
        """Locks the state folder, and finds what the last editor has left there."""
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            (self.folder / PATH).write_text(f"{self.path.resolve()}\n")
            lock = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            self._journal.problem = os_error_text(error)
            return
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            os.close(lock)
            raise SessionError(say("edit_open_already", file=str(self.path))) from error
        self._lock = lock
        newest = self._journal.newest()
        if newest is not None and newest.text != self.document.text:
            older = self._journal.aside()
            if older is not None and older.text != newest.text:
                with suppress(OSError):
                    self._back_up(older.text.encode(), "unsaved")
            self._journal.set_aside(newest)
        self._journal.clear()
        kept = self._journal.aside()
        if kept is not None and kept.text != self.document.text:
            self.recovered = kept

    def take_recovered(self, author: str = "") -> Change:
        """Goes on with what was not saved, as one step that can be undone. If the file has changed
        since, saving merges both."""
        if self.recovered is None:
            raise EditError(say("edit_nothing_recovered"))
        kept = self.recovered
        change = self.document.apply([ReplaceText((), kept.text)], say("edit_recovered"))
        self._base = (BOM * self._base.decode(errors="replace").startswith(BOM) + kept.base).encode()
        self._changed(change, author)
        self.drop_recovered()
        return change

    def drop_recovered(self) -> None:
        """Forgets what was not saved: it stays among the backups."""
        if self.recovered is not None:
            with suppress(OSError):
                self._back_up(self.recovered.text.encode(), "unsaved")
        self.recovered = None
        self._journal.forget_aside()

    def backups(self) -> list[FilePath]:
        """The newest first."""
        with suppress(OSError):
            numbered = (self.folder / BACKUPS).glob("[0-9]*.toml")
            return sorted(numbered, key=_number, reverse=True)
        return []

    def _back_up(self, data: bytes, name: str = "") -> FilePath:
        folder = self.folder / BACKUPS
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        before = self.backups()
        number = _number(before[0]) + 1 if before else 1
        file = folder / f"{number:04d}{f'-{name}' if name else ''}.toml"
        write_whole(file, data, replaces=False)
        size = len(data)
        for count, old in enumerate(before, 1):
            size += old.stat().st_size
            if count >= MOST_BACKUPS or size > MOST_BACKUP_BYTES:
                old.unlink(missing_ok=True)
        return file


class _Journal:
    """Unsaved work, in a file that is written whole after each change and synced by a thread."""

    def __init__(self, folder: FilePath) -> None:
        self.problem: TextLike = ""
        self._folder = folder
        self._number = 0
        self._wanted = threading.Condition()
        self._to_sync: FilePath | None = None
        self._ending = False
        self._thread: threading.Thread | None = None

    def write(self, text: str, base: str, saved_s: float) -> None:
        self._number += 1
        content = {"number": self._number, "saved_s": saved_s, "text": text, "base": base}
        data = json.dumps(content, ensure_ascii=False)
        file = self._folder / SLOTS[self._number % 2]
        try:
            write_whole(file, f"{_digest(data)}\n{data}".encode(), durable=False)
        except OSError as error:
            self.problem = os_error_text(error)
            return
        self.problem = ""
        with self._wanted:
            self._to_sync = file
            self._wanted.notify()
        if self._thread is None:
            self._thread = threading.Thread(target=self._sync, name="editor journal", daemon=True)
            self._thread.start()

    def clear(self) -> None:
        for name in SLOTS:
            with suppress(OSError):
                (self._folder / name).unlink()

    def newest(self) -> Recovered | None:
        """What the last editor has left."""
        left = [read for name in SLOTS if (read := self._read(self._folder / name))]
        return max(left, key=lambda read: read[0])[1] if left else None

    def set_aside(self, kept: Recovered) -> None:
        """Keeps it in a file that no change writes."""
        content = {"number": 0, "saved_s": kept.saved_s, "text": kept.text, "base": kept.base}
        data = json.dumps(content, ensure_ascii=False)
        with suppress(OSError):
            write_whole(self._folder / RECOVERED, f"{_digest(data)}\n{data}".encode())

    def aside(self) -> Recovered | None:
        read = self._read(self._folder / RECOVERED)
        return read[1] if read else None

    def forget_aside(self) -> None:
        with suppress(OSError):
            (self._folder / RECOVERED).unlink()

    def close(self) -> None:
        with self._wanted:
            self._ending = True
            self._wanted.notify()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _sync(self) -> None:
        while True:
            with self._wanted:
                self._wanted.wait_for(lambda: self._to_sync is not None or self._ending)
                file, self._to_sync = self._to_sync, None
                if file is None:
                    return
            with suppress(OSError):  # it is saved already, or the next change says why
                _sync_path(file)
                sync_folder(self._folder)

    @staticmethod
    def _read(file: FilePath) -> tuple[int, Recovered] | None:
        """(number, content); None for a file that is not there or torn."""
        try:
            digest, _, data = file.read_bytes().decode().partition("\n")
            if digest != _digest(data):
                return None
            content = json.loads(data)
            kept = Recovered(content["text"], content["base"], float(content["saved_s"]))
            return int(content["number"]), kept
        except (OSError, ValueError, KeyError, TypeError):
            return None


def _digest(data: str) -> str:
    return hashlib.sha256(data.encode()).hexdigest()


def _number(file: FilePath) -> int:
    digits = re.match(r"[0-9]+", file.name)
    return int(digits[0]) if digits else 0


def _decoded(data: bytes, path: FilePath) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise SessionError(say("edit_not_utf8", file=str(path), line=line)) from error


def _sync_path(path: FilePath) -> None:
    fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def _write_whole(path: FilePath, data: bytes, before: bytes | None) -> None:
    """Replaces a file, with the same mode and owner; a link leads to the new file too. OSError if it
    is not there then, also if someone else has written it since it was read."""
    target = path.resolve()

    def check() -> None:
        if before is not None and target.read_bytes() != before:
            raise _ChangedAgain

    like = target.stat() if before is not None else None
    write_whole(target, data, mode=0o644, like=like, check=check)


# The place of an edit of an older revision in the tables of now. LookupError if it has changed.


def _table_of(path: Path) -> Path:
    """The nearest table with a header around a path."""
    for end in range(len(path), 0, -1):
        keys = keys_of(path[:end])
        if keys in (LISTS if isinstance(path[end - 1], int) else SINGLE):
            return path[:end]
    return ()


def _value(tables: Any, path: Path) -> Any:
    for step in path:
        tables = tables[step]
    return tables


def _followed(before: Any, now: Any, path: Path) -> Path:
    """A path that was in the tables before, in those of now: tables of lists are the same by identity,
    by id, or by their place in a list that is as long."""
    followed: Path = ()
    for step in path:
        if isinstance(step, int):
            step = _index_of(before[step], before, now, step)
        old_step = path[len(followed)]
        if isinstance(now, Mapping) and old_step not in now and old_step not in before:
            return (*followed, *path[len(followed) :])  # a key that is new
        followed = (*followed, step)
        before, now = (
            before[old_step] if _has(before, old_step) else None,
            now[step] if _has(now, step) else None,
        )
        if before is None or now is None:
            return (*followed, *path[len(followed) :])
    return followed


def _has(container: Any, step: str | int) -> bool:
    if isinstance(container, list):
        return isinstance(step, int) and 0 <= step < len(container)
    return isinstance(container, Mapping) and step in container


def _index_of(element: Any, before: list[Any], now: list[Any], at: int) -> int:
    same = [n for n, each in enumerate(now) if each is element]
    if len(same) == 1:
        return same[0]
    name = _name(element)
    if name is not None and sum(_name(each) == name for each in before) == 1:
        named = [n for n, each in enumerate(now) if _name(each) == name]
        if len(named) == 1:
            return named[0]
        raise LookupError(at)
    if len(before) == len(now) and all(
        _name(old) == _name(new) for old, new in zip(before, now, strict=True)
    ):
        return at
    raise LookupError(at)


def _name(element: Any) -> Any:
    if isinstance(element, Mapping):
        return next((element[key] for key in ("id", "same") if isinstance(element.get(key), str)), None)
    return None


def _followed_key(before: Tables, now: Tables, path: Path) -> Path:
    """That of a key in a table whose own keys are as they were."""
    followed = _followed(before, now, path)
    table = _table_of(path[:-1])
    if _own(before, table) != _own(now, followed[: len(table)]):
        raise LookupError(path)
    return followed


def _own(tables: Tables, path: Path) -> Any:
    """The keys of a table, without the tables in it that have headers. Empty if it is not there."""
    try:
        table = _value(tables, path)
    except LookupError:
        return {}
    keys = keys_of(path)
    return {key: value for key, value in table.items() if (*keys, key) not in (*LISTS, *SINGLE)}


def _followed_table(before: Tables, now: Tables, path: Path) -> Path:
    """That of a table with all tables in it, as it was."""
    if not path:
        raise LookupError(path)
    followed = _followed(before, now, path)
    if _value(before, path) != _value(now, followed):
        raise LookupError(path)
    return followed


def _followed_place(before: Tables, now: Tables, path: Path) -> Path:
    """That of a place in a list: after the element that was before it."""
    *_, index = path
    around = path[:-1]
    try:
        old = _value(before, around)
    except LookupError:
        return path  # of a list that is new
    new_around = _followed(before, now, around)
    try:
        new = _value(now, new_around)
    except LookupError:
        return (*new_around, 0)
    if not isinstance(index, int) or not isinstance(old, list):
        return (*new_around, index)
    if index == 0:
        return (*new_around, 0)
    if index > len(old):
        raise LookupError(path)
    return (*new_around, _index_of(old[index - 1], old, new, index - 1) + 1)
