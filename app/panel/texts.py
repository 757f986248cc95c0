"""The texts of a panel in several languages, wherever they are in its descriptions."""

from collections.abc import Iterator
from typing import Any

from pydantic import BaseModel

from app.i18n import PanelText


def panel_texts(of: Any, place: str = "") -> Iterator[tuple[str, PanelText]]:
    """(place in the panel file, text) of every text in several languages in a description."""
    if isinstance(of, PanelText):
        yield place, of
    elif isinstance(of, tuple):
        for i, one in enumerate(of):
            yield from panel_texts(one, f"{place}[{i}]")
    elif isinstance(of, BaseModel):
        for name, about in type(of).model_fields.items():
            key = about.alias or name
            yield from panel_texts(getattr(of, name), f"{place}.{key}" if place else key)
