"""Fonts of a panel: which files are good, and the widths of their letters."""

import io
from pathlib import Path
from typing import Any

import pytest
from fontTools.ttLib import TTFont

from app.panel import load_panel
from app.panel.model import Panel
from app.panel.widths.cut_texts import cut_notes
from app.panel.widths.fonts import LATIN, Fonts, letters, read_letters, text_width
from app.system.errors import PanelError
from tests.support.beside_panel import FONTS, put_fonts

PANEL = """title = "Cell"
screens = ["1024x600"]
[[font]]
regular = "letters.ttf"
bold = "bold.ttf"
[[page]]
id = "main"
title = "Cell"
[[page.widget]]
id = "go"
kind = "call"
span = 2
label = "Wwwwwww"
service = "/go"
type = "std_srvs/srv/Trigger"
"""


def wide_font(weight: int, factor: float = 1.5) -> bytes:
    """A shipped font as TrueType, with wider letters."""
    font = TTFont(FONTS / f"ibm-plex-sans-{weight}.woff2")
    metrics: Any = font["hmtx"].metrics
    for name, (advance, side) in metrics.items():
        metrics[name] = (round(advance * factor), side)
    if "GPOS" in font:
        del font["GPOS"]
    font.flavor = None
    written = io.BytesIO()
    font.save(written)
    return written.getvalue()


def cell(folder: Path, regular: bytes, bold: bytes) -> Panel:
    (folder / "letters.ttf").write_bytes(regular)
    (folder / "bold.ttf").write_bytes(bold)
    panel = folder / "panel.toml"
    panel.write_text(PANEL)
    return load_panel(panel)


@pytest.mark.parametrize("weight", [400, 700])
def test_letters_of_a_file_have_its_widths(tmp_path: Path, weight: int) -> None:
    file = tmp_path / "letters.ttf"
    file.write_bytes(wide_font(weight, 1))
    read, shipped = read_letters(file), letters(LATIN, bold=weight == 700)
    assert read is not None
    assert read.widths == shipped.widths


def test_what_is_cut_is_measured_in_the_panels_fonts(tmp_path: Path) -> None:
    (note,) = cut_notes(cell(tmp_path, wide_font(400), wide_font(700)))
    assert note.place == "page[0].widget[0].label"
    shipped = cell(tmp_path, wide_font(400, 1), wide_font(700, 1))
    object.__setattr__(shipped, "fonts", ())
    assert list(cut_notes(shipped)) == []


def test_a_letter_that_a_font_lacks_is_of_the_next(tmp_path: Path) -> None:
    file = tmp_path / "letters.ttf"
    file.write_bytes(wide_font(400, 2))
    read = read_letters(file)
    assert read is not None
    own = Fonts((read,), (read,))
    assert text_width("88", 20, own) == 2 * text_width("88", 20)
    assert text_width("運転", 17, own) == text_width("運転", 17)


def test_it_is_said_where_widths_are_not_known(tmp_path: Path) -> None:
    put_fonts(tmp_path, "a.woff2", "b.woff2")
    packed = [(tmp_path / name).read_bytes() for name in ("a.woff2", "b.woff2")]
    notes = list(cut_notes(cell(tmp_path, packed[0], packed[1])))
    assert [note.place for note in notes] == ["font[0].regular", "font[0].bold"]
    assert "WOFF2" in notes[0].message
    torn = wide_font(700)[:400]
    half = cell(tmp_path, wide_font(400, 1), torn)
    assert next(note.place for note in cut_notes(half)) == "font[0].bold"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"wOFF1234", "WOFF 1"),
        (b"ttcf1234", "a collection"),
        (b"", "not a font"),
        (b"<svg/>", "not a font"),
        (b"OTTO" + bytes(8_000_001), "at most 8 MB"),
    ],
)
def test_other_files_are_faults(tmp_path: Path, content: bytes, words: str) -> None:
    with pytest.raises(PanelError) as raised:
        cell(tmp_path, content, wide_font(700, 1))
    (fault,) = raised.value.faults
    assert fault.place == "font[0].regular"
    assert words in fault.message
