"""The texts of a panel in several languages, wherever they are in its descriptions."""

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final

from pydantic import BaseModel

from app.system.texts import PanelText

_PLAIN: Final = frozenset((str, int, float, bool, type(None)))  # most values: nothing is in them
_QUOTED: Final = re.compile(r"[/\[]")


def key_in_place(key: str) -> str:
    """A key as places of the panel file have it: a topic or a path is quoted, as TOML writes it."""
    return f'"{key}"' if _QUOTED.search(key) else key


def panel_texts(value: Any, place: str = "") -> Iterator[tuple[str, PanelText]]:
    """(place in the panel file, text) of every text in several languages in a description."""
    if type(value) in _PLAIN:
        return
    if isinstance(value, PanelText):
        yield place, value
    elif isinstance(value, tuple):
        for i, element in enumerate(value):
            yield from panel_texts(element, f"{place}[{i}]")
    elif isinstance(value, BaseModel):
        for name, key in _keys(type(value)):
            element = getattr(value, name)
            if type(element) not in _PLAIN:
                yield from panel_texts(element, f"{place}.{key}" if place else key)
    elif isinstance(value, Mapping):
        for key, element in value.items():
            yield from panel_texts(element, f"{place}.{key_in_place(str(key))}")


@cache
def _keys(model: type[BaseModel]) -> tuple[tuple[str, str], ...]:
    """(attribute, key) of a description."""
    return tuple((name, about.alias or name) for name, about in model.model_fields.items())
