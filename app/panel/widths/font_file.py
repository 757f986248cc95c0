"""The widths of the letters of a TrueType or OpenType file: tables `head`, `hhea`, `hmtx` and `cmap`.

https://learn.microsoft.com/en-us/typography/opentype/spec/otff. WOFF2 is compressed by Brotli, which
Python has not, and a variable font has other widths when it is bold: their widths are not read.
"""

from collections.abc import Iterator
from pathlib import Path
from struct import Struct, error, unpack_from

from app.panel.font import font_format
from app.panel.widths.letters import Letters

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
