"""Writes app/panel/widths/fonts.json: the widths of letters of the shipped fonts, and how pairs of them
are kerned, in thousandths of the font's size. Needs fonttools, which `make test` installs."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from fontTools.ttLib import TTFont

ROOT: Final = Path(__file__).parents[1]
FONTS: Final = ROOT / "static/fonts"
WIDTHS: Final = ROOT / "app/panel/widths/fonts.json"
EXTENSION: Final = 9  # the type of a lookup that points to another one
PAIRS: Final = 2


def widths_text() -> str:
    """The content of the file: by the font's name."""
    fonts = {path.stem: widths(TTFont(path)) for path in sorted(FONTS.glob("*.woff2"))}
    lines = (f'"{name}": {json.dumps(font, ensure_ascii=False)}' for name, font in fonts.items())
    return "{" + ",\n".join(lines) + "}\n"


def widths(font: Any) -> dict[str, Any]:
    """`advances`: width → its characters. `kerning`: a row for the characters that have it before them,
    with the characters that follow by the change of the width."""
    per_em = font["head"].unitsPerEm
    named = {chr(code): name for code, name in font.getBestCmap().items()}
    advances: dict[str, list[str]] = {}
    for sign, name in sorted(named.items()):
        width = str(round(1000 * font["hmtx"][name][0] / per_em))
        advances.setdefault(width, []).append(sign)
    rows: dict[str, list[str]] = {}
    lookups = list(kern_lookups(font))
    for sign, name in sorted(named.items()):
        row: dict[str, list[str]] = {}
        for other, after in sorted(named.items()):
            if change := sum(kerning(subtables, name, after) for subtables in lookups):
                row.setdefault(str(round(1000 * change / per_em)), []).append(other)
        if row:
            key = json.dumps({width: "".join(signs) for width, signs in row.items()})
            rows.setdefault(key, []).append(sign)
    return {
        "advances": {width: "".join(signs) for width, signs in advances.items()},
        "kerning": {"".join(signs): json.loads(key) for key, signs in rows.items()},
    }


def kern_lookups(font: Any) -> Iterator[list[Any]]:
    """The tables of pairs of each lookup that kerning uses."""
    if "GPOS" not in font:
        return
    table: Any = font["GPOS"].table
    kerns = [
        record.Feature for record in table.FeatureList.FeatureRecord if record.FeatureTag == "kern"
    ]
    for number in sorted({number for feature in kerns for number in feature.LookupListIndex}):
        tables = [
            sub.ExtSubTable if sub.LookupType == EXTENSION else sub
            for sub in table.LookupList.Lookup[number].SubTable
        ]
        yield [sub for sub in tables if sub.LookupType == PAIRS]


def kerning(subtables: list[Any], name: str, after: str) -> int:
    """The change of the width of a glyph before another: that of the first table which has it."""
    for sub in subtables:
        if name not in sub.Coverage.glyphs:
            continue
        if sub.Format == 1:
            pairs = sub.PairSet[sub.Coverage.glyphs.index(name)].PairValueRecord
            if (pair := next((pair for pair in pairs if pair.SecondGlyph == after), None)) is None:
                continue
            value = pair.Value1
        else:
            first = class_of(sub.ClassDef1, name)
            value = sub.Class1Record[first].Class2Record[class_of(sub.ClassDef2, after)].Value1
        return getattr(value, "XAdvance", 0) if value else 0
    return 0


def class_of(definitions: Any, name: str) -> int:
    classes: Mapping[str, int] = definitions.classDefs
    return classes.get(name, 0)


if __name__ == "__main__":
    WIDTHS.write_text(widths_text(), encoding="utf-8")
