"""Lines of a text in a place of a given width, as a browser breaks them: at spaces, hyphens and soft
hyphens, and in Japanese between characters.

A browser that knows Japanese phrases breaks between them only, and may need a line more.
"""

from collections.abc import Iterator
from typing import Final, NamedTuple

from app.panel.widths.letters import (
    SHIPPED,
    SOFT_HYPHEN,
    ZERO_WIDTH_SPACE,
    Fonts,
    is_full_width,
    text_width,
)

# No line begins, or ends, with these characters.
NOT_FIRST: Final = frozenset(
    "、。，．・：；？！ー」』）］｝〕】》〉ぁぃぅぇぉっゃゅょゎァィゥェォッャュョヮヵヶ々％"
)
NOT_LAST: Final = frozenset("「『（［｛〔【《〈")


class Piece(NamedTuple):
    """A part of a text in which no line ends; `end` is what follows it on the same line, `hyphen` what
    it gets at the end of a line."""

    text: str
    end: str = ""
    hyphen: str = ""


def pieces(text: str) -> Iterator[Piece]:
    """The parts of a text between which a line may end."""
    part = ""
    for at, sign in enumerate(text):
        following = text[at + 1 : at + 2]
        if sign == " ":
            if part:
                yield Piece(part, " ")
            part = ""
        elif sign in (SOFT_HYPHEN, ZERO_WIDTH_SPACE):
            yield Piece(part, hyphen="-" if sign == SOFT_HYPHEN else "")
            part = ""
        else:
            part += sign
            if following and _may_end(sign, following, part):
                yield Piece(part)
                part = ""
    if part:
        yield Piece(part)


def _may_end(sign: str, following: str, part: str) -> bool:
    if following in NOT_FIRST or sign in NOT_LAST:
        return False
    if sign == "-":
        return len(part) > 1 and following.isalpha()
    return (is_full_width(sign) or is_full_width(following)) and following != " "


def widest_piece(text: str, size: float, fonts: Fonts = SHIPPED, *, bold: bool) -> tuple[str, float]:
    """The part of a text that needs the widest line, and its width."""
    widths = {
        piece.text: text_width(piece.text + piece.hyphen, size, fonts, bold=bold)
        for piece in pieces(text)
    }
    widest = max(widths, key=lambda part: widths[part], default="")
    return widest, widths.get(widest, 0.0)


def line_count(
    text: str,
    width: float,
    size: float,
    fonts: Fonts = SHIPPED,
    *,
    bold: bool,
    indent: float = 0.0,
) -> int:
    """How many lines a text has; the first one is shorter by `indent`. A part that is wider than a line
    has as many lines as it fills."""
    lines, room = 1, width - indent
    for piece in pieces(text):
        needed = text_width(piece.text, size, fonts, bold=bold)
        if needed + text_width(piece.hyphen, size, fonts, bold=bold) > room + NEAR and room < width:
            lines, room = lines + 1, width
        while needed > width + NEAR:
            lines, needed = lines + 1, needed - width
        room -= needed + text_width(piece.end, size, fonts, bold=bold)
    return lines


NEAR: Final = 0.5  # browsers place letters by fractions of a pixel
