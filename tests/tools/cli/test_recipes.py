"""`operator-panel recipes`: the recipes in a data folder, listed, exported and imported."""

from pathlib import Path

import pytest

from app.cell.recipes.book import FOLDER, RecipeFolder
from app.cell.recipes.command_line import LineChanges, account
from app.cell.recipes.recipe import new_recipe
from app.records.data_dir import DataDir
from app.tools.cli.recipes import main
from tests.cell.recipes.panels import CARTON, PANEL

HEAD = "name,length,speed,gripper,fast,note"


@pytest.fixture
def options(tmp_path: Path) -> list[str]:
    """The panel file and the data folder, which has one recipe and a broken file."""
    (tmp_path / "cell.toml").write_text(PANEL)
    data = tmp_path / "data"
    folder = RecipeFolder(data / FOLDER / "boxes")
    folder.write(new_recipe("carton", "created", 1_700_000_000.0, "Ann", "Carton", CARTON))
    (folder.path / "broken.toml").write_text("?")
    return [str(tmp_path / "cell.toml"), "--data", str(data)]


def test_recipes_are_listed_with_what_can_not_be_read(
    options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["list", *options]) == 1
    said = capsys.readouterr().out
    assert "carton  Carton  version 1, 2023-11-14T22:13:20+00:00" in said
    assert "broken  can't be read" in said


def test_what_is_exported_is_imported(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "boxes.csv"
    assert main(["export", "boxes", *options, "-o", str(file)]) == 0
    assert main(["export", "boxes", *options, "-o", str(file)]) == 1  # it exists
    text = file.read_text(encoding="utf-8-sig")
    assert main(["export", "boxes", *options]) == 0
    assert "Carton,400,80,vacuum,false," in capsys.readouterr().out
    bad = text.splitlines()[1].replace("Carton,400", "Tray,1")
    file.write_text(text.replace("Carton,400", "Carton,450") + bad)
    assert main(["import", "boxes", str(file), *options, "--yes"]) == 1
    said = capsys.readouterr()
    assert "0 new, 1 changed, 0 the same, 1 refused" in said.out
    assert f"{file}:3: Length is 1" in said.err
    assert "Carton: Length 400 mm → 450 mm" in said.out
    assert main(["list", *options]) == 1
    assert "version 2" in capsys.readouterr().out


def test_a_set_that_is_not_there(options: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "trays", *options]) == 2
    assert 'no set of recipes "trays"; there is boxes' in capsys.readouterr().err


def test_an_import_beside_a_server_is_listed_for_the_log(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "boxes.csv"
    file.write_text(f"{HEAD}\nCarton,450,80,vacuum,false,-\nTray,600,80,fork,true,x\n")
    server = DataDir(tmp_path / "data")
    server.claim()
    try:
        assert main(["import", "boxes", str(file), *options, "--yes"]) == 0
        assert main(["import", "boxes", str(file), *options, "--yes"]) == 0
    finally:
        server.release()
    assert "1 new, 1 changed, 0 the same" in capsys.readouterr().out
    changes = LineChanges(tmp_path / "data" / FOLDER).read()
    assert [(c.number, c.by, c.recipe, c.version) for c in changes] == [
        (1, account(), "carton", 2),
        (2, account(), "tray", 1),
    ]
    assert (changes[0].old, changes[0].new) == ({"length": 400}, {"length": 450})


def test_nothing_is_taken_before_it_was_seen(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "boxes.csv"
    file.write_text(f"{HEAD}\nCarton,450,80,vacuum,false,-\n")
    assert main(["import", "boxes", str(file), *options]) == 1
    said = capsys.readouterr()
    assert "Carton: Length 400 mm → 450 mm" in said.out
    assert "nothing is taken: give --yes" in said.err
    file.write_text(f'{HEAD}\nCarton,400,"80,125",vacuum,false,-\n')
    assert main(["import", "boxes", str(file), *options, "--yes"]) == 1
    assert "80,125 is" in capsys.readouterr().err
    assert main(["import", "boxes", str(file), *options, "--yes", "--decimal", ","]) == 0
    assert "Speed 80 % → 80.125 %" in capsys.readouterr().out
