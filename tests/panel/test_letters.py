"""The widths of letters that `check` has are those of the font files."""

import pytest

from app.panel.widths.fonts import DATA, letters, text_width
from deploy.font_widths import widths_text


@pytest.mark.long("detail")
def test_widths_are_those_of_the_font_files() -> None:
    """`make fonts` renews them."""
    assert DATA.read_text(encoding="utf-8") == widths_text()


@pytest.mark.parametrize("bold", [False, True])
def test_letters_of_both_fonts_are_known(*, bold: bool) -> None:
    assert "ß" in letters("ibm-plex-sans", bold=bold).widths
    assert letters("noto-sans-jp", bold=bold).widths["転"] == 1000


def test_a_text_is_as_wide_as_its_letters_with_their_kerning() -> None:
    assert text_width("88", 20) == 24
    assert text_width("運転", 17) == 34
    assert text_width("AV", 20) < text_width("A", 20) + text_width("V", 20)
