"""Pictures that come with the program: every panel may show them, wherever its file is."""

from pathlib import Path
from typing import Final

from app.panel import load_panel
from app.system.pictures import SHIPPED
from app.system.settings import PACKAGE
from app.web.assets import picture

CELL: Final = "palletizing-cell.svg"


def test_a_copy_of_the_shipped_panel_has_its_picture(tmp_path: Path) -> None:
    copied = tmp_path / "cell.toml"
    copied.write_text((PACKAGE / "panel.toml").read_text())
    panel = load_panel(copied)
    assert panel.picture_files == {}
    assert panel.shown_pictures == {CELL: SHIPPED / CELL}
    sent = picture(panel.shown_pictures[CELL])
    assert sent.media_type == "image/svg+xml"
    assert b"<svg" in sent.content


def test_a_picture_of_the_panel_comes_before_the_shipped_one(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    (tmp_path / "pictures" / CELL).write_text("<svg/>")
    copied = tmp_path / "cell.toml"
    copied.write_text('pictures = "pictures"\n' + (PACKAGE / "panel.toml").read_text())
    assert load_panel(copied).shown_pictures == {CELL: tmp_path / "pictures" / CELL}
