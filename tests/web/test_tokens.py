"""The colours of static/css/tokens.css: each text has the contrast of WCAG 2.2 AAA in every theme, one
in an alarm's colour that of AA, and the contrast of a key or a field with what is around it that of
1.4.11."""

import re
from collections.abc import Mapping
from typing import Final, get_args

import pytest

from app.panel.layout import Theme
from app.system.settings import shipped_path

SHEET: Final = (shipped_path("static") / "css/tokens.css").read_text()
TEXT, COLOURED, GRAPHIC = 7.0, 4.5, 3.0
TEXTS: Final = (
    *(("ink", on) for on in ("ground", "frame", "surface", "raised", "well", "field", "key-down")),
    *(("quiet", on) for on in ("frame", "surface", "raised", "well", "field")),
    *((f"{key}-ink", key) for key in ("key", "white", "grey", "black", "blue", "locked")),
    *(("alarm", on) for on in ("frame", "surface", "raised", "field")),
    ("surface", "ink"),  # a key that is held, the robot that is shown
    ("banner", "simulated"),
    ("banner", "simulated-stripe"),
)
GRAPHICS: Final = (
    *(("key-edge", on) for on in ("surface", "frame", "raised")),
    *(("locked-edge", on) for on in ("surface", "frame")),
    *(("attention", on) for on in ("ground", "surface", "frame", "raised", "field")),  # the focus
    ("fill", "well"),
    ("alarm", "surface"),
)


def block(selector: str) -> dict[str, str]:
    """The custom properties of one rule."""
    inside = SHEET.partition(f"{selector} {{")[2].partition("}")[0]
    return dict(re.findall(r"--([a-z-]+): (#[0-9a-f]+);", inside))


def colours(theme: str) -> Mapping[str, str]:
    return block(":root") | ({} if theme == "light" else block(f'[data-theme="{theme}"]'))


def luminance(colour: str) -> float:
    """Relative luminance (WCAG 2.2)."""
    digits = colour[1:] if len(colour) == 7 else "".join(2 * digit for digit in colour[1:])
    parts = [int(digits[at : at + 2], 16) / 255 for at in (0, 2, 4)]
    red, green, blue = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts
    )
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(colour: str, other: str) -> float:
    light, dark = sorted((luminance(colour), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_contrast_is_that_of_the_standard() -> None:
    assert contrast("#000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#fff") == pytest.approx(4.48, abs=0.01)


@pytest.mark.parametrize("theme", get_args(Theme))
def test_texts_have_their_contrast(theme: str) -> None:
    known = {**colours(theme), "banner": "#fff"}
    contrasts = {pair: round(contrast(known[pair[0]], known[pair[1]]), 2) for pair in TEXTS}
    poor = {
        (text, on): ratio
        for (text, on), ratio in contrasts.items()
        if ratio < (COLOURED if text == "alarm" else TEXT)
    }
    assert poor == {}


@pytest.mark.parametrize("theme", get_args(Theme))
def test_edges_and_the_focus_can_be_seen(theme: str) -> None:
    known = colours(theme)
    contrasts = {pair: round(contrast(known[pair[0]], known[pair[1]]), 2) for pair in GRAPHICS}
    assert {pair: ratio for pair, ratio in contrasts.items() if ratio < GRAPHIC} == {}


def test_a_locked_key_has_the_colour_of_the_contract() -> None:
    assert colours("light")["locked"] == "#a9a9a9"
