"""What a press shows: a message that fits a widget's template gives the values of its inputs, and with
them the value of the field that confirms it. Pure."""

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from app.interfaces.definitions import attribute_name
from app.panel.template import NOW, fill, placeholders
from app.panel.values import same_value
from app.simulator.needs import Published

CLOSE: Final = 1e-6  # a float32 comes back as the nearest one
PLACEHOLDER: Final = re.compile(r"\{\{|\}\}|\{(\w+)\}")


class Effect(NamedTuple):
    """A field that has a value by a press."""

    topic: str
    field: str
    value: Any


def effects(message: Any, publications: Iterable[Published]) -> list[Effect]:
    """The effects of a decoded message, by the widgets that may have sent it."""
    made = []
    for publication in publications:
        inputs: dict[str, Any] = {}
        if (
            publication.confirm is None
            or publication.template is None
            or not _fits(publication.template, message, inputs)
        ):
            continue
        needed = {name for _, name in placeholders(publication.confirm.equals)}
        if needed <= inputs.keys():
            value = fill(publication.confirm.equals, inputs)
            made.append(Effect(publication.confirm.topic, publication.confirm.field, value))
    return made


def learned(template: Any, message: Any) -> dict[str, Any] | None:
    """The values of the inputs of a template from a decoded message; None if it was not made from
    it."""
    inputs: dict[str, Any] = {}
    return inputs if _fits(template, message, inputs) else None


def _fits(template: Any, value: Any, inputs: dict[str, Any]) -> bool:
    """Whether a value may have been made from a template; adds the values of its inputs."""
    if isinstance(template, Mapping):
        return all(
            _fits(part, getattr(value, attribute_name(name), None), inputs)
            for name, part in template.items()
        )
    if isinstance(template, list | tuple):
        items = list(value) if value is not None else []
        return len(items) == len(template) and all(
            _fits(part, item, inputs) for part, item in zip(template, items, strict=True)
        )
    if isinstance(template, str):
        return _text_fits(template, value, inputs)
    return _equal(template, value)


def _text_fits(template: str, value: Any, inputs: dict[str, Any]) -> bool:
    names = [name for _, name in placeholders(template)]
    if template == f"{{{NOW}}}":
        return True
    if names and template == f"{{{names[0]}}}":
        return _learned(names[0], value, inputs)
    if names and template == f"-{{{names[0]}}}" and not isinstance(value, str):
        return _learned(names[0], -value, inputs)
    if not names:
        return bool(fill(template, {}) == value)
    match = re.fullmatch(_pattern(template), value, re.DOTALL) if isinstance(value, str) else None
    return match is not None and all(
        _learned(name, text, inputs) for name, text in zip(names, match.groups(), strict=True)
    )


def _pattern(template: str) -> str:
    """A regular expression of the texts that a template makes."""
    parts, at = [], 0
    for match in PLACEHOLDER.finditer(template):
        parts.append(re.escape(template[at : match.start()]))
        parts.append("(.*?)" if match[1] else re.escape(match[0][0]))
        at = match.end()
    return "".join([*parts, re.escape(template[at:])])


def _learned(name: str, value: Any, inputs: dict[str, Any]) -> bool:
    """Adds an input's value, unless it has another one elsewhere in the message."""
    return _equal(inputs.setdefault(name, value), value)


def _equal(value: Any, other: Any) -> bool:
    numbers = isinstance(value, int | float) and isinstance(other, float)
    if numbers and not isinstance(value, bool):
        return math.isclose(value, other, rel_tol=CLOSE)
    return same_value(value, other)
