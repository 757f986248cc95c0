"""`python -m app.check`: what it prints, and its exit status."""

import re
from pathlib import Path

import pytest

from app.panel import load_panel
from app.system.errors import Note
from app.system.settings import PACKAGE
from app.tools.cli.check import main
from tests.support.beside_panel import put_beside
from tests.support.parts import REFERENCE, TESTS
from tests.support.processes import command

pytestmark = pytest.mark.promise("panel file")

SHIPPED = PACKAGE / "panel.toml"
REFERENCE_TEXT = REFERENCE.read_text()
NO_TITLE = re.sub(r"^title = .*\n", "", REFERENCE_TEXT, count=1, flags=re.MULTILINE)


@pytest.fixture
def faulty(tmp_path: Path) -> Path:
    path = tmp_path / "cell.toml"
    path.write_text(NO_TITLE.replace('"/last_heard"', '"last heard"'))
    return path


def test_a_good_panel_is_summed_up(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(SHIPPED)]) == 0
    said = capsys.readouterr()
    first, *fits = said.out.splitlines()
    panel = load_panel(SHIPPED)
    counted = f"{len(panel.pages)} page(s), {len(list(panel.widgets()))} widget(s)"
    assert first == f'{SHIPPED}: good: "Robot cell 1", {counted}'
    screens = "1280x800, 1024x600, 800x480, 800x1280"
    assert [line.partition("fits ")[2] for line in fits] == ["", "", screens, screens, screens]
    assert "keeps 1h" in fits[0]
    assert "keeps 24h" in fits[1]
    assert said.err == ""


@pytest.mark.parametrize("rule", ["max_age_s = 2.0", "require_publisher = true"])
def test_a_permission_that_is_kept_fresh_needs_no_note(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rule: str
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(REFERENCE_TEXT.replace('field = "data"\n', f'field = "data"\n{rule}\n', 1))
    assert main([str(path)]) == 0
    assert "interlock[0]" not in capsys.readouterr().out


def test_every_fault_is_printed_with_its_place(
    faulty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(faulty)]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    first, *lines = said.err.splitlines()
    assert first == f"{faulty} can't be used:"
    assert [line.split(": ")[0] for line in lines] == [
        "  title",
        '  page[0].group[0].widget[1].topic "last_heard", line 43',
    ]


def test_a_file_that_is_not_there_can_not_be_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(tmp_path / "none.toml")]) == 2
    assert "No such file or directory" in capsys.readouterr().err


def test_invalid_toml_is_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cell.toml"
    path.write_text("title =")
    assert main([str(path)]) == 2
    assert "has no value: write one after =" in capsys.readouterr().err


def test_without_a_name_the_panel_of_the_environment_is_checked(
    faulty: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("KIOSK_PANEL", str(faulty))
    assert main([]) == 1
    assert str(faulty) in capsys.readouterr().err


def test_a_wrong_environment_is_reported_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("KIOSK_MODE", "maybe")
    assert main([]) == 2
    assert capsys.readouterr().err == 'KIOSK_MODE is "maybe": it must be "demo" or "live"\n'


def test_worst_of_several_panels_is_the_exit_status(
    faulty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    none = tmp_path / "none.toml"
    assert main([str(faulty), str(SHIPPED)]) == 1
    said = capsys.readouterr()
    assert said.err.startswith(f"{faulty} can't be used:")
    assert said.out.startswith(f"{SHIPPED}: good:")
    assert main([str(SHIPPED), str(none), str(faulty)]) == 2
    said = capsys.readouterr()
    assert [line for line in said.err.splitlines() if line[:1] != " "] == [
        f"{none} can't be used:",
        f"{faulty} can't be used:",
    ]
    assert main([str(SHIPPED), str(SHIPPED)]) == 0


def test_check_prints_its_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert said.startswith("usage: python -m app.check [-h] [-v] [PANEL ...]")
    assert "KIOSK_PANEL" in said
    assert "Exit status" in said


def test_a_note_is_no_fault_and_has_its_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    noted = [
        Note("interlock[0]", "is worth a look"),
        Note("page[1].group[0].widget[1].span", "is large"),
    ]
    monkeypatch.setattr("app.panel.checks.notes.find_notes", lambda *_: noted)
    assert main([str(SHIPPED)]) == 0
    said = capsys.readouterr()
    assert said.err == ""
    text = SHIPPED.read_text()

    def line(*parts: str) -> int:
        """The line of the last of these parts, each of which is below the one before."""
        at = 0
        for part in parts:
            at = text.index(part, at)
        return text[:at].count("\n") + 1

    first = line("[[interlock]]")
    second = line('id = "last_heard"', "span = 2")
    assert said.out.splitlines()[1:] == [
        f'  note: interlock[0] "operation", line {first}: is worth a look',
        f'  note: page[1].group[0].widget[1].span "last_heard", line {second}: is large',
    ]
    load_panel(SHIPPED)


def test_the_whole_message_of_each_press_is_printed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text((TESTS / "everything.toml").read_text())
    jog = tmp_path / "msgs/cell_msgs/msg/Jog.msg"
    jog.parent.mkdir(parents=True)
    jog.write_text("float64 speed\nuint32 valid_ms\nuint16 number\n")
    put_beside(tmp_path)
    assert main(["-v", str(path)]) == 0
    first, _, said = capsys.readouterr().out.partition("\n")
    assert "good" in first
    without_lines = re.sub(r", line \d+:", ":", said)
    assert without_lines == (TESTS / "everything.txt").read_text()


@pytest.mark.parametrize(("text", "status"), [(SHIPPED.read_text(), 0), (NO_TITLE, 1), ("title =", 2)])
def test_the_exit_status_says_good_faulty_or_unreadable(tmp_path: Path, text: str, status: int) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(text)
    ended = command.run("app.check", str(path))
    assert ended.returncode == status
    assert "Traceback" not in ended.stderr


def test_an_interlock_that_locks_nothing_is_noted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cell.toml"
    spare = '\n[[interlock]]\nid = "spare"\ntopic = "/spare"\nmax_age_s = 1.0\n'
    path.write_text(REFERENCE_TEXT + spare)
    assert main([str(path)]) == 0
    line = len(path.read_text().splitlines()) - 3
    notes = [line for line in capsys.readouterr().out.splitlines() if "locks nothing" in line]
    assert notes == [
        f'  note: interlock[1] "spare", line {line}: locks nothing: no control has interlock = "spare"'
    ]


def test_the_shipped_panel_is_named_where_no_file_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("KIOSK_PANEL", raising=False)
    assert main([]) == 0
    assert capsys.readouterr().err == "no panel file is named, so the shipped one is checked\n"
