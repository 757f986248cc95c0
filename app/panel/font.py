"""A font of the panel: the files of its two weights, checked by their first bytes."""

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import AfterValidator

from app.panel.base import Description, File

FontFormat = Literal["woff2", "ttf", "otf"]
FORMATS: Final[dict[bytes, FontFormat]] = {
    b"wOF2": "woff2",
    b"\0\1\0\0": "ttf",
    b"true": "ttf",
    b"OTTO": "otf",
}
OTHERS: Final = {b"wOFF": "WOFF 1", b"ttcf": "a collection of fonts"}
MOST_MB: Final = 8


def font_format(file: Path) -> FontFormat | None:
    """The format of a font file, whatever its name says; None for anything else."""
    with file.open("rb") as opened:
        return FORMATS.get(opened.read(4))


def _check_font(file: Path) -> Path:
    if font_format(file) is None:
        with file.open("rb") as opened:
            other = OTHERS.get(opened.read(4), "not a font")
        raise ValueError(f"{file} is {other}: it must be a WOFF2, TrueType or OpenType file")
    if (size := file.stat().st_size) > MOST_MB * 1_000_000:
        raise ValueError(
            f"{file} has {size / 1e6:.1f} MB, and every browser loads it: a font has at most {MOST_MB}"
            " MB. Save it as WOFF2, or keep only the characters that the panel shows"
        )
    return file


FontFile = Annotated[File, AfterValidator(_check_font)]


class Font(Description):
    """The texts of pages are in `regular` and in `bold`."""

    regular: FontFile
    bold: FontFile

    @property
    def files(self) -> dict[str, Path]:
        """The files by the keys that name them."""
        return {"regular": self.regular, "bold": self.bold}
