"""Places for texts, the lines into which a text breaks there, and whether it is cut."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final, NamedTuple

from app.panel.widgets.tiles import Screen
from app.panel.widths.fonts import (
    SHIPPED,
    SOFT_HYPHEN,
    ZERO_WIDTH_SPACE,
    Fonts,
    is_full_width,
    text_width,
)
from app.system.texts import TextLike, render

# Lines of a text in a place of a given width, as a browser breaks them: at spaces, hyphens and soft
# hyphens, and in Japanese between characters.
#
# A browser that knows Japanese phrases breaks between them only, and may need a line more.

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


@lru_cache(maxsize=4096)
def widest_piece(text: str, size: float, fonts: Fonts = SHIPPED, *, bold: bool) -> tuple[str, float]:
    """The part of a text that needs the widest line, and its width."""
    widths = {
        piece.text: text_width(piece.text + piece.hyphen, size, fonts, bold=bold)
        for piece in pieces(text)
    }
    widest = max(widths, key=lambda part: widths[part], default="")
    return widest, widths.get(widest, 0.0)


@lru_cache(maxsize=4096)
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


# Places for texts, and whether a text is cut in one.


@dataclass(frozen=True, slots=True)
class Sizes:
    """The sizes of texts, as static/css/tokens.css has them."""

    small: float
    text: float
    label: float
    value: float


SIZES: Final = {"normal": Sizes(15, 17, 20, 26), "large": Sizes(17, 20, 24, 30)}


@dataclass(frozen=True, slots=True)
class Cell:
    """Where a widget stands: its width and height in px, and the page around it."""

    width: float
    height: float
    screen: Screen
    sizes: Sizes
    fit: bool
    fonts: Fonts = SHIPPED


class Cut(NamedTuple):
    """A text that is cut: which part of it, what it needs, and what it has."""

    text: str
    needs: str
    has: str


@dataclass(frozen=True, slots=True)
class Box:
    """The place of a text: `lines` of `width` px, of which the first is shorter by `indent`. With
    `wraps` a text has several lines, and none is broken inside a word. `after` stands behind the text
    on the same line, `beside` takes some of the width, `least_beside` at least. `locked`: it has these
    lines while its button is locked, else more."""

    part: str  # the key of the text in the panel file, or what it is
    text: TextLike
    width: float
    size: float
    bold: bool = False
    lines: int = 1
    wraps: bool = False
    indent: float = 0.0
    after: TextLike = ""
    after_size: float = 0.0
    after_bold: bool = False
    beside: TextLike = ""
    beside_size: float = 0.0
    beside_bold: bool = False
    least_beside: float = 0.0
    name: str = "place"
    locked: bool = False

    def cut(self, language: str, fonts: Fonts = SHIPPED) -> Cut | None:
        """What is cut of the text in a language; None for nothing."""
        if self.beside:
            width = self.width - self.width_beside(language, fonts)
            return replace(self, width=width, beside="").cut(language, fonts)
        text = render(self.text, language)
        after = render(self.after, language)
        tail = text_width(after, self.after_size or self.size, fonts, bold=self.after_bold)
        if not self.wraps:
            needs = self.indent + text_width(text, self.size, fonts, bold=self.bold) + tail
            return _too_wide(text + after, needs, self) if needs > self.width + NEAR else None
        word, needs = widest_piece(text, self.size, fonts, bold=self.bold)
        if needs > self.width + NEAR:
            return _too_wide(word, needs, self)
        whole = f"{text} {after.replace(' ', NO_BREAK)}" if after else text
        lines = line_count(whole, self.width, self.size, fonts, bold=self.bold, indent=self.indent)
        if lines <= self.lines:
            return None
        return Cut(text, f"{lines} lines", f"{self.lines} of {self.width:.0f} px")

    def width_beside(self, language: str, fonts: Fonts = SHIPPED) -> float:
        size = self.beside_size or self.size
        width = text_width(render(self.beside, language), size, fonts, bold=self.beside_bold)
        return max(width, self.least_beside)


NO_BREAK: Final = "\u00a0"


def _too_wide(text: str, needs: float, box: Box) -> Cut:
    return Cut(text, f"{needs:.0f} px", f"{max(box.width, 0):.0f}")
