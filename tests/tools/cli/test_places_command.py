"""`operator-panel places`: what operators saved, as a part of a panel file."""

from pathlib import Path

import pytest

from app.cell.places.saved import places_text
from app.cell.session.place_file import NAME
from app.panel import load_panel
from app.panel.places import Place
from app.tools.cli.places import main
from tests.web.test_places import PANEL

SAVED = Place(id="bay", label="Bay", x=1.0, y=2.0, frame="map", map_version="0123456789abcdef", yaw=0.5)


@pytest.fixture
def settings(tmp_path: Path) -> list[str]:
    (tmp_path / NAME).write_text(places_text([SAVED]))
    (tmp_path / "panel.toml").write_text(PANEL)
    return [str(tmp_path / "panel.toml"), "--data", str(tmp_path)]


def test_export_prints_what_a_panel_file_takes(
    settings: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", *settings]) == 0
    text = capsys.readouterr().out
    assert text.startswith("[[place]]\n")
    both = tmp_path / "both.toml"
    both.write_text(f"{PANEL}\n{text}")
    assert load_panel(both).places[-1] == SAVED
    assert main(["list", *settings]) == 0
    assert "bay  Bay  x 1.00 m, y 2.00 m" in capsys.readouterr().out


def test_an_export_replaces_no_file_and_a_broken_one_is_named(
    settings: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "places-out.toml")
    assert main(["export", "-o", out, *settings]) == 0
    assert main(["export", "-o", out, *settings]) == 1
    (tmp_path / NAME).write_text("[[place]")
    assert main(["export", *settings]) == 2
    assert NAME in capsys.readouterr().err
