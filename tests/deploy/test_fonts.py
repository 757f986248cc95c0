"""The Japanese font keeps the characters that the catalogue and the shipped panels have."""

import pytest
from fontTools.ttLib import TTFont

from deploy.font_characters import ROOT, characters


@pytest.mark.parametrize("weight", [400, 700])
def test_the_japanese_font_has_each_character(weight: int) -> None:
    with TTFont(ROOT / f"static/fonts/noto-sans-jp-{weight}.woff2") as font:
        missing = sorted(sign for sign in characters() if ord(sign) not in font.getBestCmap())
    assert missing == [], "`make fonts` adds them"
