"""Files that are written whole or not at all: what is there after each way to fail, modes, owners."""

import os
import re
import resource
import signal
import stat
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from app.system.whole_file import Options, give_to_owner_of, whole_file, write_whole
from tests.support.parts import ROOT

NEW: Final = b"new content" * 10_000
OLD: Final = b"old"
NOBODY: Final = 65_534


class Broken(Exception):
    """What a caller raises."""


def fail(*_: Any, **__: Any) -> Any:
    raise Broken


def break_block(path: Path) -> None:
    with whole_file(path) as file:
        file.write(NEW)
        raise Broken


def break_check(path: Path) -> None:
    write_whole(path, NEW, check=fail)


def fill_disk(path: Path) -> None:
    """The file can't grow further: `write` answers an error halfway, as on a full disk."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (len(NEW) // 2, len(NEW) // 2))
    write_whole(path, NEW)


def take_permission(path: Path) -> None:
    """The folder belongs to another user."""
    path.parent.chmod(0o755)
    if os.geteuid() == 0:
        os.seteuid(NOBODY)
    else:
        path.parent.chmod(0o500)
    try:
        write_whole(path, NEW)
    finally:
        if os.getuid() == 0:
            os.seteuid(0)
        path.parent.chmod(0o755)


def keep_existing(path: Path) -> None:
    write_whole(path, NEW, replaces=False)


def replace_folder(path: Path) -> None:
    """A folder stands in the place of the file."""
    inside = path.with_name("folder")
    inside.mkdir()
    write_whole(inside, NEW)


def sync_fails(path: Path) -> None:
    """The disk says at the sync that it has not taken all."""
    before = os.fsync
    try:
        os.fsync = fail
        write_whole(path, NEW)
    finally:
        os.fsync = before


# How a write fails → the error that its caller gets.
FAILURES: Final[dict[str, tuple[Callable[[Path], None], type[BaseException]]]] = {
    "in its block": (break_block, Broken),
    "the check before it takes its place": (break_check, Broken),
    "a full disk": (fill_disk, OSError),
    "at the sync": (sync_fails, Broken),
    "a folder without permission": (take_permission, PermissionError),
    "a file that is there": (keep_existing, FileExistsError),
    "a folder in its place": (replace_folder, IsADirectoryError),
}


def in_child(call: Callable[[], None]) -> None:
    """Calls it in a process of its own, whose limits and rights it changes."""
    child = os.fork()
    if child == 0:
        try:
            call()
        except BaseException as error:
            sys.__stderr__ and print(repr(error), file=sys.__stderr__)
            os._exit(1)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0


@pytest.mark.parametrize("case", FAILURES)
def test_a_write_that_fails_keeps_the_old_content_and_leaves_nothing(tmp_path: Path, case: str) -> None:
    attempt, error = FAILURES[case]
    for parent in (*tmp_path.parents[:3], tmp_path):
        if parent.owner() != "root" or parent.name != "tmp":
            parent.chmod(0o755)
    file = tmp_path / "file.json"
    file.write_bytes(OLD)

    def attempted() -> None:
        with pytest.raises(error):
            attempt(file)

    in_child(attempted)
    assert file.read_bytes() == OLD
    assert {path.name for path in tmp_path.iterdir()} <= {"file.json", "folder"}


@pytest.mark.parametrize("replaces", [True, False])
def test_a_write_that_succeeds_leaves_the_new_content_alone(tmp_path: Path, replaces: bool) -> None:
    file = tmp_path / "file.json"
    if replaces:
        file.write_bytes(OLD)
    write_whole(file, NEW, replaces=replaces)
    assert file.read_bytes() == NEW
    assert [path.name for path in tmp_path.iterdir()] == ["file.json"]


def test_what_a_killed_process_has_left_goes_with_a_later_write(tmp_path: Path) -> None:
    """Not what another process may be writing, and not what is left of other files."""
    mine, new, other = (tmp_path / name for name in (".file.1.new", ".file.2.new", ".more.1.new"))
    for left in (mine, new, other):
        left.write_bytes(OLD)
    for left in (mine, other):
        os.utime(left, (0, 0))
    write_whole(tmp_path / "file", NEW)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".file.2.new", ".more.1.new", "file"]


def test_a_link_is_replaced_and_not_followed(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.write_bytes(OLD)
    file = tmp_path / "file"
    file.symlink_to(outside)
    write_whole(file, NEW)
    assert (outside.read_bytes(), file.read_bytes(), file.is_symlink()) == (OLD, NEW, False)


# Options → the mode of the new file with the umask 027; `like` is the mode of another file.
MODES: Final[dict[str, tuple[dict[str, Any], int]]] = {
    "private": ({}, 0o600),
    "public": ({"mode": 0o644}, 0o644),
    "of the umask": ({"mode": None}, 0o640),
    "of another file": ({"like": 0o664}, 0o664),
    "of another file, not of the umask": ({"like": 0o666, "mode": None}, 0o666),
}


@pytest.mark.parametrize("case", MODES)
def test_modes(tmp_path: Path, case: str) -> None:
    options, mode = MODES[case]
    seen: list[int] = []

    def note(draft: str) -> None:
        seen.append(stat.S_IMODE(os.stat(draft).st_mode))

    def written() -> None:
        os.umask(0o027)
        if "like" in options:
            other = tmp_path / "other"
            other.touch()
            other.chmod(options["like"])
            options["like"] = other.stat()
        with whole_file(tmp_path / "file", **options) as file:
            note(file.name)
            file.write(NEW)
        assert seen[0] & ~mode & 0o077 == 0, "others could read it before"
        assert stat.S_IMODE((tmp_path / "file").stat().st_mode) == mode

    in_child(written)


def test_what_root_writes_belongs_to_whom_it_is_for(tmp_path: Path) -> None:
    """Without root all of it is the user's own."""
    own = os.geteuid()
    folder_owner, other_owner = (NOBODY, 1) if own == 0 else (own, own)
    like = tmp_path / "like"
    like.touch()
    os.chown(like, other_owner, -1)
    os.chown(tmp_path, folder_owner, -1)
    rows: tuple[tuple[str, Options, int], ...] = (
        ("own", {}, own),
        ("of folder", {"of_folder": True}, folder_owner),
        ("of another", {"like": like.stat()}, other_owner),
    )
    for name, options, owner in rows:
        write_whole(tmp_path / name, NEW, **options)
        assert (tmp_path / name).stat().st_uid == owner, name
    (tmp_path / "folder").mkdir()
    give_to_owner_of(tmp_path, tmp_path / "folder")
    assert (tmp_path / "folder").stat().st_uid == folder_owner


@pytest.mark.parametrize("durable", [True, False])
def test_the_file_is_synced_before_it_takes_its_place_and_the_folder_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, durable: bool
) -> None:
    acts: list[str] = []
    fsync, replace = os.fsync, Path.replace

    def noted_sync(descriptor: int) -> None:
        is_folder = stat.S_ISDIR(os.fstat(descriptor).st_mode)
        acts.append("folder" if is_folder else "file")
        fsync(descriptor)

    def noted_replace(self: Path, target: Path) -> Path:
        acts.append("place")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", noted_sync)
    monkeypatch.setattr(Path, "replace", noted_replace)
    write_whole(tmp_path / "file", NEW, durable=durable)
    assert acts == (["file", "place", "folder"] if durable else ["place"])


def test_no_other_code_writes_beside_a_file_and_replaces_it() -> None:
    """Each other call that puts a file into its place, with why it is none of these."""
    reasons = {
        "app/system/whole_file.py": "the rule",
        "app/records/sent_panel.py": "several files take their places together",
        "app/cell/recipes/book.py": "a recipe goes to those that were deleted",
        "app/tools/prove/answers.py": "old answers are set aside",
        "app/tools/install/file_tree.py": "each folder of the path is opened without following links",
    }
    targets = r"(path|file|target|draft|self\._?path|self\.aside)"
    places = re.compile(rf"\bos\.replace\(|\.replace\({targets}\)")
    files = {path for path in (ROOT / "app").rglob("*.py") if places.search(path.read_text())}
    assert {path.relative_to(ROOT).as_posix() for path in files} == reasons.keys()
