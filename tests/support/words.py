"""Rendering of texts within any value."""

from typing import Any

from app.i18n import Text, localized, render


def english(value: Any) -> Any:
    """The same value with every `Text` in it rendered in English."""
    if isinstance(value, Text):
        return render(value)
    if isinstance(value, tuple):
        return tuple(english(one) for one in value)
    if isinstance(value, set | frozenset):
        return {english(one) for one in value}
    return [english(one) for one in value] if isinstance(value, list) else localized(value, "en")
