"""The keys `language` and `languages` of a panel file: languages that have a catalogue."""

from typing import Annotated

from pydantic import AfterValidator, Field, WithJsonSchema

from app.i18n.catalogue import files
from app.interfaces.validation import format_value
from app.panel.faults.wording import one_of


def _check_language(tag: str) -> str:
    if tag not in files():
        raise ValueError(one_of([*files()], tag))
    return tag


def _check_languages(tags: tuple[str, ...]) -> tuple[str, ...]:
    if not tags:
        raise ValueError("is empty: name one language at least, or leave the key out")
    for i, tag in enumerate(tags):
        if tag in tags[:i]:
            raise ValueError(f"names {format_value(tag)} twice")
    return tags


Language = Annotated[
    str, AfterValidator(_check_language), WithJsonSchema({"type": "string", "enum": [*files()]})
]
Languages = Annotated[tuple[Language, ...], Field(strict=False), AfterValidator(_check_languages)]
