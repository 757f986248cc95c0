"""Files that commands write: whole or not at all, and none that exists unless --force is given."""

from collections.abc import Callable
from pathlib import Path

import pytest

from app.tools.cli.command import main
from app.tools.cli.output import OutputError, draft_of


def write(file: Path, force: bool = False, before_the_end: Callable[[], object] = int) -> None:
    with draft_of(file, force) as draft:
        draft.write_text("new")
        before_the_end()


def test_a_new_file_is_written_and_nothing_else(tmp_path: Path) -> None:
    write(tmp_path / "a.toml")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.toml": "new"}


def test_a_link_in_place_of_the_draft_is_not_written_through(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("not mine")
    (tmp_path / ".a.toml.new").symlink_to(other)
    write(tmp_path / "a.toml")
    assert (tmp_path / "a.toml").read_text() == "new"
    assert other.read_text() == "not mine"


def test_a_file_that_exists_is_replaced_by_force_only(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text("mine")
    with pytest.raises(OutputError, match=r"a\.toml exists: give another name with -o, or --force"):
        write(file)
    assert file.read_text() == "mine"
    write(file, force=True)
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


def test_a_file_that_appears_while_another_is_made_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    with pytest.raises(OutputError, match="exists"):
        write(file, before_the_end=lambda: file.write_text("mine"))
    assert file.read_text() == "mine"


def test_failed_write_keeps_the_old_file(tmp_path: Path) -> None:
    file = tmp_path / "a.toml"
    file.write_text("mine")
    with pytest.raises(ValueError, match="no panel"):
        write(file, True, lambda: float("no panel"))
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.toml": "mine"}


def test_a_link_still_leads_to_its_file(tmp_path: Path) -> None:
    file, link = tmp_path / "a.toml", tmp_path / "b.toml"
    file.write_text("mine")
    link.symlink_to(file)
    write(link, force=True)
    assert (link.is_symlink(), file.read_text()) == (True, "new")


@pytest.mark.parametrize("place", ["none/a.toml", "file/a.toml", "folder", f"{'x' * 252}.toml"])
def test_a_place_that_can_not_be_written_is_a_sentence(
    tmp_path: Path, place: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    assert main(["bridge-config", "--force", "-o", str(tmp_path / place)]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"{tmp_path / place} can't be written: ")
    assert said.count("\n") == 1
