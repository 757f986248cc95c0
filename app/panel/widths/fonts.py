"""The widths of letters in the shipped fonts and in those of a panel."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from struct import Struct, error, unpack_from
from typing import Final, NamedTuple

from app.panel.keys import font_format
from app.panel.model import Panel
from app.system.errors import Note

# The width of a text in CSS pixels, in the shipped fonts and those of a panel.
#
# `fonts.json` has the widths of the letters in thousandths of the font's size: `make fonts` writes it.
# A letter of neither font counts as wide as an average one of the system's.

DATA: Final = Path(__file__).with_name("fonts.json")
LATIN, JAPANESE = "ibm-plex-sans", "noto-sans-jp"
WEIGHTS: Final = {False: "400", True: "700"}  # by whether it is bold
FULL_WIDTH: Final = 0x2E80  # from here on letters are as wide as they are high
FULL, OTHER = 1000, 620
SOFT_HYPHEN, ZERO_WIDTH_SPACE = "\u00ad", "\u200b"


class Letters(NamedTuple):
    """The letters of a font: character → width, and (character, next one) → change of the width."""

    widths: dict[str, int]
    kerning: dict[tuple[str, str], int]


@cache
def letters(name: str, *, bold: bool) -> Letters:
    """The letters of a shipped font."""
    font = json.loads(DATA.read_text(encoding="utf-8"))[f"{name}-{WEIGHTS[bold]}"]
    widths = {sign: int(width) for width, signs in font["advances"].items() for sign in signs}
    kerning = {
        (sign, after): int(change)
        for signs, row in font["kerning"].items()
        for change, follow in row.items()
        for sign in signs
        for after in follow
    }
    return Letters(widths, kerning)


@dataclass(frozen=True, eq=False)
class Fonts:
    """The fonts of a page: the panel's own, regular and bold, then the shipped ones."""

    regular: tuple[Letters, ...] = ()
    bold: tuple[Letters, ...] = ()

    def faces(self, *, bold: bool) -> Sequence[Letters]:
        """A letter is of the first one that has it."""
        own = self.bold if bold else self.regular
        return (*own, letters(LATIN, bold=bold), letters(JAPANESE, bold=bold))


SHIPPED: Final = Fonts()


@lru_cache(maxsize=4096)
def text_width(text: str, size: float, fonts: Fonts = SHIPPED, *, bold: bool = False) -> float:
    """The width of a line of text whose font is `size` pixels high."""
    faces = fonts.faces(bold=bold)
    total, last, last_face = 0, "", None
    for sign in text:
        face = next((face for face in faces if sign in face.widths), None)
        if face is None:
            total += FULL if ord(sign) >= FULL_WIDTH else OTHER
        else:
            total += face.widths[sign]
            if face is last_face:
                total += face.kerning.get((last, sign), 0)
        last, last_face = sign, face
    return total * size / 1000


def is_full_width(sign: str) -> bool:
    """Whether a line may end beside it without a space."""
    return ord(sign) >= FULL_WIDTH


# The widths of the letters of a TrueType or OpenType file: tables `head`, `hhea`, `hmtx` and `cmap`.
#
# https://learn.microsoft.com/en-us/typography/opentype/spec/otff. WOFF2 is compressed by Brotli, which
# Python has not, and a variable font has other widths when it is bold: their widths are not read.

TABLE = Struct(">4s4xII")
UNICODE = ((3, 10), (0, 6), (0, 4), (3, 1), (0, 3), (0, 2), (0, 1), (0, 0))  # the fullest first
MOST = 100_000  # characters of a table


def read_letters(file: Path) -> Letters | None:
    """The letters of a font, without its kerning; None if they can't be read."""
    if font_format(file) not in ("ttf", "otf"):
        return None
    data = file.read_bytes()
    try:
        tables = _tables(data)
        if "fvar" in tables:
            return None
        advances = _advances(data, tables)
        glyphs = _glyphs(data, tables["cmap"])
        return Letters({sign: advances[min(glyph, len(advances) - 1)] for sign, glyph in glyphs}, {})
    except (error, KeyError, IndexError, ZeroDivisionError):
        return None


def _tables(data: bytes) -> dict[str, int]:
    """Where each table begins, by its name."""
    (count,) = unpack_from(">H", data, 4)
    rows = (TABLE.unpack_from(data, 12 + 16 * number) for number in range(count))
    return {name.decode("latin-1"): offset for name, offset, _ in rows}


def _advances(data: bytes, tables: dict[str, int]) -> list[int]:
    """The widths of the glyphs in thousandths of the font's size; the last one is of all after it."""
    (per_em,) = unpack_from(">H", data, tables["head"] + 18)
    (count,) = unpack_from(">H", data, tables["hhea"] + 34)
    values = unpack_from(f">{2 * count}H", data, tables["hmtx"])
    return [round(1000 * width / per_em) for width in values[::2]]


def _glyphs(data: bytes, cmap: int) -> Iterator[tuple[str, int]]:
    """(character, its glyph) of the fullest table of Unicode."""
    (count,) = unpack_from(">H", data, cmap + 2)
    rows = [unpack_from(">HHI", data, cmap + 4 + 8 * number) for number in range(count)]
    offsets = {(platform, encoding): cmap + offset for platform, encoding, offset in rows}
    for kind in UNICODE:
        if (at := offsets.get(kind)) is not None:
            (layout,) = unpack_from(">H", data, at)
            if layout in (4, 12):
                yield from _segments(data, at) if layout == 4 else _groups(data, at)
                return
    raise KeyError("cmap")


def _segments(data: bytes, at: int) -> Iterator[tuple[str, int]]:
    """Format 4: the characters up to U+FFFF."""
    (double,) = unpack_from(">H", data, at + 6)
    count, ends = double // 2, at + 14
    starts, offsets = ends + double + 2, ends + 3 * double + 2
    for number in range(count):
        place = 2 * number
        (end,) = unpack_from(">H", data, ends + place)
        (start,) = unpack_from(">H", data, starts + place)
        (delta,) = unpack_from(">H", data, starts + double + place)
        (offset,) = unpack_from(">H", data, offsets + place)
        for code in range(start, min(end, 0xFFFE) + 1):
            glyph = code
            if offset:
                (glyph,) = unpack_from(">H", data, offsets + place + offset + 2 * (code - start))
            if (glyph or not offset) and (glyph := (glyph + delta) & 0xFFFF):
                yield chr(code), glyph


def _groups(data: bytes, at: int) -> Iterator[tuple[str, int]]:
    """Format 12: all characters."""
    (count,) = unpack_from(">I", data, at + 12)
    left = MOST
    for number in range(min(count, MOST)):
        start, end, glyph = unpack_from(">III", data, at + 16 + 12 * number)
        if not start <= end <= 0x10FFFF or (left := left - (end - start + 1)) < 0:
            raise KeyError("cmap")
        yield from ((chr(code), glyph + code - start) for code in range(start, end + 1))


# The letters of a panel's own fonts, and the files that do not tell their widths.


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
