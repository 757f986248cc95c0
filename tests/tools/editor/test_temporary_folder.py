"""The editor's temporary folder: removed at the end, or by the next editor."""

import os
import tempfile
from pathlib import Path

import pytest

from app.tools.editor.temporary_folder import PREFIX, TemporaryFolder


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The system's folder for temporary files."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_a_folder_is_there_from_create_to_remove(place: Path) -> None:
    folder = TemporaryFolder()
    assert [*place.iterdir()] == []
    folder.create()
    (folder.path / "panel-1").mkdir()
    assert folder.path.stat().st_mode & 0o777 == 0o700
    folder.remove()
    assert [*place.iterdir()] == []


def test_the_next_one_removes_what_a_killed_process_has_left(place: Path) -> None:
    killed, young, link = (place / f"{PREFIX}{name}" for name in ("killed", "young", "link"))
    foreign = place / "foreign"
    (killed / "panel-1").mkdir(parents=True)
    young.mkdir()
    link.symlink_to(place)
    running = TemporaryFolder()
    running.create()
    foreign.mkdir()
    for old in (killed, running.path, foreign):
        os.utime(old, (0, 0))
    last = TemporaryFolder()
    last.create()
    assert {*place.iterdir()} == {young, link, running.path, foreign, last.path}
    running.remove()
    last.remove()
