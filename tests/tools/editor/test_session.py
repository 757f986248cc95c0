"""A panel file on the disk while it is edited: saved, merged, backed up, recovered after a crash."""

import json
import os
import random
import resource
import signal
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.system.texts import Text
from app.tools.editor import session as session_module
from app.tools.editor.document import (
    Delete,
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
from app.tools.editor.session import (
    EditBehind,
    EditSession,
    SaveConflict,
    SessionError,
    state_folder,
)
from tests.support.form import several
from tests.support.parts import ROOT
from tests.tools.editor.test_merge import BASE, START, STOP, changed

pytestmark = pytest.mark.promise("panel file")

GO: Final = SetValue((*START, "label"), "Go")


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "cell.toml"
    path.write_text(BASE)
    return path


Open = Callable[[Path], EditSession]


@pytest.fixture
def opened(tmp_path: Path) -> Iterator[Open]:
    sessions = []

    def make(path: Path) -> EditSession:
        sessions.append(EditSession(path, tmp_path / "state", lambda: 5.0))
        return sessions[-1]

    yield make
    for session in sessions:
        session.close()


def code(error: pytest.ExceptionInfo[Any]) -> str:
    text = error.value.text
    if isinstance(text, Text) and text.code == "with_file":
        text = dict(text.params)["why"]
    return text.code if isinstance(text, Text) else str(text)


def files_beside(path: Path) -> list[str]:
    return sorted(each.name for each in path.parent.iterdir() if each.is_file())


@pytest.mark.parametrize("written", [BASE, "\ufeff" + BASE, BASE.replace("\n", "\r\n"), "a = [\n"])
def test_a_saved_file_has_its_bytes_and_mode(file: Path, opened: Open, written: str) -> None:
    file.write_bytes(written.encode())
    file.chmod(0o640)
    session = opened(file)
    saved = session.save()
    assert (saved.backup, saved.merged, session.unsaved) == (None, False, False)
    assert file.read_bytes() == written.encode()
    session.apply([ReplaceText((), session.document.text.replace("\r", "") + "x = 1\n")], "x") if (
        written == "a = [\n"
    ) else session.apply([SetValue(("title",), "New")], "title")
    assert session.unsaved
    saved = session.save()
    assert saved.backup is not None
    assert saved.backup.read_bytes() == written.encode()
    assert file.read_bytes() == session.document.data != written.encode()
    assert file.stat().st_mode & 0o777 == 0o640
    assert files_beside(file) == ["cell.toml"]
    session.undo()
    assert session.unsaved
    session.save()
    assert file.read_bytes() == written.encode()


def test_a_link_to_the_file_stays_a_link(file: Path, opened: Open, tmp_path: Path) -> None:
    link = tmp_path / "links" / "panel.toml"
    link.parent.mkdir()
    link.symlink_to("../cell.toml")
    session = opened(link)
    session.apply([GO], "go")
    session.save()
    assert link.is_symlink()
    assert file.read_text() == changed(GO)
    assert files_beside(link) == ["panel.toml"]


@pytest.mark.parametrize(
    ("theirs", "merged"),
    [
        (SetValue((*STOP, "label"), "Halt"), True),
        (Insert(("page", 2), {"id": "third", "title": "3"}), True),
        (Delete(("interlock", 0)), True),
        (GO, True),
        (SetValue((*START, "label"), "Los"), False),
        (Delete(START), False),
    ],
)
def test_what_another_program_writes_is_merged_or_named(
    file: Path, opened: Open, theirs: Edit, merged: bool
) -> None:
    session = opened(file)
    session.apply([GO], "go")
    file.write_text(changed(theirs))
    assert session.disk_state == "changed"
    if merged:
        assert session.save().merged
        assert tomllib.loads(file.read_text()) == tomllib.loads(
            changed(GO, text=changed(theirs)) if theirs != GO else changed(GO)
        )
        assert (session.unsaved, session.disk_state) == (False, "same")
        return
    with pytest.raises(SaveConflict) as refused:
        session.save()
    assert code(refused) == "edit_conflicts"
    assert file.read_text() == changed(theirs)
    (conflict,) = session.conflicts
    with pytest.raises(EditError):
        session.resolve("other", "ours")
    session.resolve(conflict.name, "ours")
    assert session.conflicts == ()
    assert session.save().merged
    assert tomllib.loads(file.read_text()) == tomllib.loads(changed(GO))
    assert any(backup.read_text() == changed(theirs) for backup in session.backups())


def test_a_half_written_file_leaves_no_conflict(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    for whole in (changed(SetValue((*STOP, "label"), "Halt")), changed(GO)):
        file.write_text("")
        with pytest.raises(SaveConflict):
            session.merge_from_disk()
        assert not session.has_old_conflicts
        file.write_text(whole)
        assert session.has_old_conflicts
        session.merge_from_disk()
        assert session.conflicts == ()
    assert session.document.text == changed(GO)


def test_a_conflict_is_resolved_by_the_other_side_or_another_text(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    theirs = changed(SetValue((*START, "label"), "Los"))
    file.write_text(theirs)
    with pytest.raises(SaveConflict):
        session.save()
    session.resolve(session.conflicts[0].name, "theirs")
    session.save()
    assert file.read_text() == theirs
    session.undo()
    assert session.document.text == changed(GO)  # nothing is lost
    file.write_text(theirs.replace("Los", "Laufen"))
    with pytest.raises(SaveConflict):
        session.save()
    (conflict,) = session.conflicts
    assert conflict.theirs is not None
    session.resolve(conflict.name, (conflict.theirs.replace("Laufen", "Start!"),))
    session.save()
    assert 'label = "Start!"' in file.read_text()


def test_a_file_that_is_no_toml_any_more_is_a_conflict_of_the_whole(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    file.write_text("title = \n")
    with pytest.raises(SaveConflict):
        session.save()
    assert [conflict.name for conflict in session.conflicts] == ["file"]
    with pytest.raises(EditError) as refused:
        session.resolve("file", "theirs")
    assert code(refused) == "edit_not_toml"
    session.resolve("file", "ours")
    session.save()
    assert file.read_text() == changed(GO)


def test_a_file_that_is_gone_is_written_only_if_asked(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    file.unlink()
    assert session.disk_state == "gone"
    with pytest.raises(SessionError) as refused:
        session.save()
    assert code(refused) == "edit_file_gone"
    assert not file.exists()
    session.save(recreate=True)
    assert file.read_text() == changed(GO)


def test_a_program_that_writes_again_and_again_is_not_overwritten(
    file: Path, opened: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = opened(file)
    session.apply([GO], "go")
    fsync, count = os.fsync, iter(range(1, 99))

    def write_too(fd: int) -> None:
        if os.readlink(f"/proc/self/fd/{fd}").startswith(str(file.parent / ".cell")):
            file.write_text(changed(SetValue(("title",), f"Cell {next(count)}")))
        fsync(fd)

    monkeypatch.setattr(os, "fsync", write_too)
    with pytest.raises(SessionError) as refused:
        session.save()
    assert code(refused) == "edit_file_changes"
    assert 'title = "Cell 3"' in file.read_text()
    monkeypatch.undo()
    session.save()
    assert tomllib.loads(file.read_text()) == tomllib.loads(changed(GO, SetValue(("title",), "Cell 3")))
    assert files_beside(file) == ["cell.toml"]


def test_backups_are_numbered_and_bounded(
    file: Path, opened: Open, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "MOST_BACKUPS", 5)
    session = opened(file)
    texts = [BASE]
    for number in range(8):
        session.apply([SetValue(("title",), f"Cell {number}")], "title")
        session.save()
        texts.append(session.document.text)
    backups = session.backups()
    assert [backup.name for backup in backups] == [f"{n:04d}.toml" for n in range(8, 3, -1)]
    assert [backup.read_text() for backup in backups] == texts[7:2:-1]
    monkeypatch.setattr(session_module, "MOST_BACKUP_BYTES", int(2.5 * len(BASE)))
    session.apply([SetValue(("title",), "Cell")], "title")
    session.save()
    assert [backup.name for backup in session.backups()] == ["0009.toml", "0008.toml"]


def test_unsaved_work_is_there_again_after_a_crash(file: Path, opened: Open) -> None:
    first = opened(file)
    first.apply([GO], "go")
    first.apply([SetValue((*STOP, "label"), "Halt")], "halt")
    unsaved = first.document.text
    first.close()  # as a crash: nothing is saved
    second = opened(file)
    assert second.document.text == BASE
    assert second.recovered is not None
    assert (second.recovered.text, second.recovered.saved_s) == (unsaved, 5.0)
    second.apply([SetValue(("title",), "Other")], "title")
    second.close()
    third = opened(file)  # both are there: the newest is offered, the other is a backup
    assert third.recovered is not None
    assert 'title = "Other"' in third.recovered.text
    assert any(unsaved == backup.read_text() for backup in third.backups())
    file.write_text(changed(SetValue(("screens",), ["800x480"])))
    third.take_recovered()
    assert third.recovered is None
    assert third.save().merged
    text = file.read_text()
    assert 'title = "Other"' in text
    assert 'screens = ["800x480"]' in text
    third.close()
    fourth = opened(file)
    assert fourth.recovered is None
    assert not fourth.unsaved


def test_dropped_work_is_a_backup(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    session.close()
    again = opened(file)
    again.drop_recovered()
    assert again.recovered is None
    assert [backup.read_text() for backup in again.backups()] == [changed(GO)]
    again.close()
    assert opened(file).recovered is None


def test_a_torn_journal_leaves_the_one_before_it(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    session.apply([SetValue(("title",), "Newest")], "title")
    session.close()
    newest = max(session.folder.glob("unsaved-*.json"), key=lambda slot: "Newest" in slot.read_text())
    newest.write_bytes(newest.read_bytes()[:-20])
    again = opened(file)
    assert again.recovered is not None
    assert again.recovered.text == changed(GO)


def test_undone_work_is_not_offered(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    session.undo()
    session.close()
    assert opened(file).recovered is None


def test_a_file_is_open_in_one_editor(file: Path, opened: Open) -> None:
    first = opened(file)
    with pytest.raises(SessionError) as refused:
        opened(file)
    assert code(refused) == "edit_open_already"
    first.close()
    opened(file)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda path: path.unlink(), "disk_file_not_found"),
        (lambda path: (path.unlink(), path.mkdir()), "is a directory"),
        (lambda path: path.write_bytes(b'a = "\xff"\n'), "edit_not_utf8"),
    ],
)
def test_a_file_that_can_not_be_read_is_named(
    file: Path, opened: Open, make: Callable[[Path], Any], expected: str
) -> None:
    make(file)
    with pytest.raises(SessionError) as refused:
        opened(file)
    assert expected in code(refused)


def test_a_full_disk_loses_nothing(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([SetValue(("title",), "x" * 5000)], "long")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
        with pytest.raises(SessionError):
            session.save()
        session.apply([SetValue(("title",), "y" * 5000)], "longer")
        assert session.journal_problem != ""
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, handler)
    assert file.read_text() == BASE
    assert files_beside(file) == ["cell.toml"]
    assert session.unsaved
    session.apply([SetValue(("title",), "z")], "short")
    assert session.journal_problem == ""
    session.save()
    assert tomllib.loads(file.read_text())["title"] == "z"


def test_a_read_only_folder_is_named(file: Path, opened: Open, monkeypatch: pytest.MonkeyPatch) -> None:
    session = opened(file)
    session.apply([GO], "go")
    really = os.open

    def refuse(path: Any, flags: int, *rest: Any, **more: Any) -> int:
        if flags & os.O_CREAT and Path(path).parent == file.parent:
            raise PermissionError(13, "Permission denied", str(path))
        return really(path, flags, *rest, **more)

    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(SessionError) as refused:
        session.save()
    assert code(refused) == "disk_file_not_permitted"
    monkeypatch.undo()
    assert file.read_text() == BASE
    session.save()
    assert file.read_text() == changed(GO)


def test_without_a_state_folder_a_file_is_saved_and_the_lack_is_said(
    file: Path, tmp_path: Path
) -> None:
    (tmp_path / "no").write_text("a file")
    session = EditSession(file, tmp_path / "no" / "state")
    session.apply([GO], "go")
    assert session.journal_problem != ""
    saved = session.save()
    session.close()
    assert saved.problem != ""
    assert file.read_text() == changed(GO)


def test_the_state_folder_is_the_users(tmp_path: Path) -> None:
    folder = state_folder(tmp_path / "a b.toml", {"XDG_STATE_HOME": str(tmp_path / "state")})
    assert folder.parent == tmp_path / "state/operator-panel/editor"
    assert folder.name.startswith("a_b.toml-")
    assert state_folder(tmp_path / "x.toml", {}) != state_folder(tmp_path / "y/x.toml", {})


# Several browsers.

SECOND: Final = ("page", 1)


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (GO, SetValue((*STOP, "label"), "Halt"), (GO, SetValue((*STOP, "label"), "Halt"))),
        (Delete(START), SetValue((*STOP, "label"), "Halt"),
         (SetValue((*STOP, "label"), "Halt"), Delete(START))),
        (Insert(START, {"id": "a"}), SetValue((*STOP, "label"), "Halt"),
         (SetValue((*STOP, "label"), "Halt"), Insert(START, {"id": "a"}))),
        (Move(("page", 0), ("page", 1)), SetValue((*STOP, "label"), "Halt"),
         (SetValue((*STOP, "label"), "Halt"), Move(("page", 0), ("page", 1)))),
        (Delete(START), Delete(STOP), (Delete(STOP), Delete(START))),
        (GO, Insert(STOP, {"id": "b"}), (GO, Insert(STOP, {"id": "b"}))),
        (Delete(START), Insert((*STOP[:-1], 2), {"id": "b"}),
         (Insert((*STOP[:-1], 2), {"id": "b"}), Delete(START))),
        (Insert(("page", 0), {"id": "new"}), Move(STOP, (*STOP[:-1], 0)),
         (Move(STOP, (*STOP[:-1], 0)), Insert(("page", 0), {"id": "new"}))),
        (SetValue(("title",), "X"), SetValue(("log", "days"), 3),
         (SetValue(("title",), "X"), SetValue(("log", "days"), 3))),
        (GO, Rename(STOP, "halt"), (GO, Rename(STOP, "halt"))),
        (Insert(("page", 0), {"id": "new"}), Duplicate(STOP, (*STOP[:-1], 2)),
         (Duplicate(STOP, (*STOP[:-1], 2)), Insert(("page", 0), {"id": "new"}))),
        (Insert(("page", 0), {"id": "new"}), ReplaceText(STOP, '[[page.group.widget]]\nid = "t"\n'),
         (ReplaceText(STOP, '[[page.group.widget]]\nid = "t"\n'), Insert(("page", 0), {"id": "new"}))),
        (Insert(START, {"id": "a"}), Paste(STOP, '[[page.group.widget]]\nid = "b"\n'),
         (Paste(STOP, '[[page.group.widget]]\nid = "b"\n'), Insert(START, {"id": "a"}))),
        (GO, SetValue((*START, "label"), "Los"), None),
        (GO, SetValue((*START, "note"), "Los"), None),
        (Delete(START), SetValue((*START, "label"), "Go"), None),
        (GO, Delete(START), None),
        (GO, Delete(("page", 0)), None),
        (Delete(START), Insert(STOP, {"id": "b"}), None),
        (GO, ReplaceText((), "a = 1"), None),
        (SetValue(("title",), "X"), SetValue(("screens",), []), None),
    ],
)  # fmt: skip
def test_an_edit_of_an_older_revision_follows_its_table_or_is_refused(
    file: Path, opened: Open, first: Edit, second: Edit, expected: tuple[Edit, ...] | None
) -> None:
    session = opened(file)
    session.apply([first], "the first", revision=0, author="Browser 1")
    before = session.document.text
    if expected is None:
        with pytest.raises(EditBehind) as refused:
            session.apply([second], "the second", revision=0, author="Browser 2")
        assert refused.value.status == 409
        about = dict(refused.value.text.params)  # type: ignore[union-attr]
        assert (about["author"], about["label"]) == ("Browser 1", "the first")
        assert session.document.text == before
    else:
        session.apply([second], "the second", revision=0, author="Browser 2")
        assert session.document.tables == tomllib.loads(changed(*expected))
        assert session.document.tables == tomllib.loads(session.document.text)


def test_a_change_without_an_author_is_named_too(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    with pytest.raises(EditBehind) as refused:
        session.apply([SetValue((*START, "label"), "Los")], "los", revision=0)
    assert code(refused) == "edit_changed_since"


def test_a_revision_that_is_forgotten_is_refused(file: Path, opened: Open) -> None:
    session = opened(file)
    session.apply([GO], "go")
    with pytest.raises(EditBehind) as refused:
        session.apply([GO], "go", revision=77)
    assert code(refused) == "edit_too_old"


# A process that is killed.

SAVER: Final = """
import sys
from pathlib import Path
from app.tools.editor.document import SetValue
from app.tools.editor.session import EditSession
session = EditSession(Path(sys.argv[1]), Path(sys.argv[2]))
for number in range(100000):
    print(number, flush=True)
    session.apply([SetValue(("title",), f"Cell {number} " + "x" * (number % 7) * 3000)], "title")
    print(number, flush=True)
    if number % 3 == 2:
        session.save()
"""


def test_a_killed_editor_leaves_a_whole_file_and_its_unsaved_work(file: Path, tmp_path: Path) -> None:
    text = (ROOT / "docs/examples/palletizer.toml").read_text()
    file.write_text(text)
    drawn = random.Random(1)
    recovered = 0
    for _ in range(several(4, 50)):
        saver = subprocess.Popen(
            [sys.executable, "-c", SAVER, str(file), str(tmp_path / "state")],
            cwd=ROOT, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            assert saver.stdout is not None
            for _ in range(drawn.randrange(3, 60)):  # after any step
                assert saver.stdout.readline()
        finally:
            saver.send_signal(signal.SIGKILL)
            saver.wait()
            saver.stdout.close()  # type: ignore[union-attr]
        saved = tomllib.loads(file.read_text())
        assert {**saved, "title": ""} == {**tomllib.loads(text), "title": ""}
        session = EditSession(file, tmp_path / "state")
        if session.recovered is not None:
            recovered += 1
            assert tomllib.loads(session.recovered.text).keys() == saved.keys()
            session.drop_recovered()
        for backup in session.backups():
            tomllib.loads(backup.read_text())
        session.close()
    assert recovered > 0
    journal = tmp_path / "state" / "unsaved-0.json"
    assert not journal.exists() or json.loads(journal.read_text().partition("\n")[2])
