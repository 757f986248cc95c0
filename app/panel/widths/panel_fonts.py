"""The letters of a panel's own fonts, and the files that do not tell their widths."""

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from app.errors import Note
from app.panel.font import font_format
from app.panel.model import Panel
from app.panel.widths.font_file import read_letters
from app.panel.widths.letters import SHIPPED, Fonts, Letters


def fonts_of(panel: Panel) -> Fonts:
    """The fonts of the panel's pages. One whose widths are not known counts as wide as the shipped."""
    files = tuple((font.regular, font.bold) for font in panel.fonts)
    return _fonts(files, tuple(map(_written, panel.font_files))) if files else SHIPPED


@lru_cache(maxsize=4)
def _fonts(files: tuple[tuple[Path, Path], ...], written: tuple[int, ...]) -> Fonts:
    """`written`: when the files were written, since another font may get the name."""
    regular, bold = (
        tuple(filter(None, (_letters(file, _written(file)) for file in of_weight)))
        for of_weight in zip(*files, strict=True)
    )
    return Fonts(regular, bold)


@lru_cache(maxsize=8)
def _letters(file: Path, written: int) -> Letters | None:
    return read_letters(file)


def _written(file: Path) -> int:
    return file.stat().st_mtime_ns


def font_notes(panel: Panel) -> Iterator[Note]:
    """Fonts whose widths are not known."""
    for number, font in enumerate(panel.fonts):
        for key, file in font.files.items():
            if _letters(file, _written(file)) is None:
                yield Note(f"font[{number}].{key}", _reason(file))


def _reason(file: Path) -> str:
    measured = "which texts are cut is measured in the shipped font instead"
    if font_format(file) == "woff2":
        return f"the widths of letters are not read from WOFF2: {measured}. TrueType and OpenType are"
    return f"the widths of its letters can't be read (a variable font has none): {measured}"
