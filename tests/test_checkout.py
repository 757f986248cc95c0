"""Tests leave the checkout, and a reader's own files in it, as they are."""

import subprocess
from pathlib import Path

import pytest

from tests.support import checkout


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A checkout with a file of the project, and one that its reader has written."""
    folder = tmp_path / "checkout"
    (folder / "app").mkdir(parents=True)
    (folder / "app/main.py").write_text("pass\n")
    (folder / ".gitignore").write_text("/build/\n__pycache__/\n")
    subprocess.run(["git", "init", "-q", folder], check=True)
    subprocess.run(["git", "-C", folder, "add", "."], check=True)
    (folder / "cell1.toml").write_text('title = "Mine"\n')
    monkeypatch.setattr(checkout, "ROOT", folder)
    return folder


def test_a_copy_has_the_files_of_the_project_alone_and_writes_through_none(
    repository: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    checkout.copy_project(copy)
    assert {path.name for path in copy.iterdir()} == {"app", ".gitignore"}
    (copy / "app/main.py").write_text("changed")
    (copy / "cell1.toml").write_text("")
    assert (repository / "app/main.py").read_text() == "pass\n"
    assert (repository / "cell1.toml").read_text() == 'title = "Mine"\n'


def test_a_write_into_the_checkout_is_noticed(repository: Path) -> None:
    before = checkout.state()
    (repository / "app/__pycache__").mkdir()
    (repository / "app/__pycache__/main.pyc").write_text("")
    assert checkout.state() == before, "a cache is not meant"
    for name in ("cell1.toml", "app/main.py", "new.txt", "build/page.html"):
        path = repository / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("written by a test")
        after = checkout.state()
        assert after != before, name
        before = after
