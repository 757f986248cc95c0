"""What is seen in a reader's words."""

from typing import Any

from app.i18n import Text, localized, render


def english(value: Any) -> Any:
    """The same value with every text in it as an English reader reads it."""
    if isinstance(value, Text):
        return render(value)
    if isinstance(value, tuple):
        return tuple(english(one) for one in value)
    if isinstance(value, set | frozenset):
        return {english(one) for one in value}
    return [english(one) for one in value] if isinstance(value, list) else localized(value, "en")
