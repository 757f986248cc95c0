"""The longest values that a panel file knows of: the ends of scales and limits, and units."""

import math
from collections.abc import Iterator
from typing import Final

from app.i18n import PanelText, TextLike, number
from app.i18n.values import changed, together
from app.panel.values import number_text

SOME_VALUE: Final = "00"  # of a value in a sentence whose own length is not known


def formatted(value: float, style: str | None) -> TextLike:
    """A number as it is shown, in a format of the panel file."""
    if style is None:
        return number(number_text(float(value)))
    return number(format(int(value) if style.endswith("d") else value, style))


def ends(low: float, high: float, style: str | None) -> Iterator[TextLike]:
    """The lowest and the highest number, as they are shown, with the digits of the format."""
    yield from (formatted(value, style) for value in (low, high) if math.isfinite(value))


def after_gap(unit: str | PanelText) -> TextLike:
    """A unit behind a number; "" without one."""
    return together([" ", unit]) if unit else ""


def with_some_value(text: str | PanelText) -> str | PanelText:
    """A text of the panel file whose {value} is not known."""
    return changed(text, lambda translation: translation.replace("{value}", SOME_VALUE))
