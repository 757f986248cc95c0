"""The width of a text in CSS pixels, in the shipped fonts and those of a panel.

`fonts.json` has the widths of the letters in thousandths of the font's size: `make fonts` writes it. A
letter of neither font counts as wide as an average one of the system's.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Final, NamedTuple

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
