"""Responses of services, and feedback and results of actions, of any type: pure."""

import re
from collections.abc import Callable, Mapping
from typing import Any, Final

from app.interfaces import INTEGER_RANGES, PLACEHOLDER, Interfaces, Structure
from app.interfaces.definitions import FLOAT_TYPES, STRING_TYPES, Field
from app.simulator.values.guesses import NEGATIVE, span_of
from app.simulator.values.known_types import KNOWN, Moment
from app.simulator.values.messages import DEEPEST, plausible
from app.simulator.values.paths import Fields, merged, put

DONE: Final = "done"
CHOICES: Final = ("demo 1", "demo 2", "demo 3")
# Whole numbers for a status: zero is success.
STATUS: Final = re.compile(r"error|code|status|result|reason|flag|id$", re.IGNORECASE)
LEFT: Final = re.compile(r"remain|left|to_go|todo", re.IGNORECASE)
PART: Final = re.compile(r"progress|fraction|complet|done|ratio", re.IGNORECASE)
STEPS: Final = 10


def good_response(
    type_name: str, interfaces: Interfaces, fixed: Mapping[str, Any], paths: Mapping[str, Any]
) -> Callable[[Moment], Fields]:
    """Responses of a request that succeeds, with the fields of `[demo]` and values at paths."""
    structure = interfaces.structures[type_name]
    base = plausible(type_name, interfaces)

    def response(moment: Moment) -> Fields:
        fields = merged(base(moment), _good(structure, interfaces, 0))
        for path, value in paths.items():
            put(fields, type_name, path, value, interfaces.structures)
        return merged(fields, fixed)

    return response


def _good(structure: Structure, interfaces: Interfaces, depth: int) -> Fields:
    """The fields of a success."""
    fields: Fields = {}
    for field in structure.fields:
        kind = field.type
        if field.name == PLACEHOLDER or kind.container != "one":
            continue
        if kind.is_nested:
            own = kind.name not in KNOWN and kind.name.startswith(f"{structure.name.split('/')[0]}/")
            if own and depth < DEEPEST:
                fields[field.name] = _good(interfaces.structures[kind.name], interfaces, depth + 1)
        elif kind.name == "bool":
            fields[field.name] = not NEGATIVE.search(field.name)
        elif kind.name in STRING_TYPES:
            fields[field.name] = DONE[: kind.bound or None]
        elif kind.name in INTEGER_RANGES and STATUS.search(field.name):
            fields[field.name] = 0
    return fields


def feedback_at(
    type_name: str, interfaces: Interfaces, progress: Mapping[str, tuple[float, float]]
) -> Callable[[Moment, float], Fields]:
    """Feedback when a part (0 to 1) of the goal is done; `progress` is path → its values at the start
    and at the end."""
    structure = interfaces.structures[type_name]
    base = plausible(type_name, interfaces)

    def feedback(moment: Moment, part: float) -> Fields:
        fields = base(moment)
        for field in structure.fields:
            if (value := _partly(field, part)) is not None:
                fields[field.name] = value
        for path, (first, last) in progress.items():
            kind = interfaces.type_at(type_name, path).name
            value = _number(first + part * (last - first), kind)
            put(fields, type_name, path, value, interfaces.structures)
        return fields

    return feedback


def _partly(field: Field, part: float) -> Any:
    """A field of feedback; None if its plausible value is used."""
    kind, name = field.type, field.name
    if kind.name == "builtin_interfaces/msg/Duration" and kind.container == "one":
        return {"sec": round(STEPS * (1 - part if LEFT.search(name) else part))}
    if kind.is_nested or (kind.name not in INTEGER_RANGES and kind.name not in FLOAT_TYPES):
        return None
    if kind.container == "sequence":
        length = min(round(part * STEPS), kind.size or STEPS)
        return [_number(index, kind.name) for index in range(length + 1)][: kind.size or None]
    if kind.container == "array":
        return None
    done = 1 - part if LEFT.search(name) else part
    if "percent" in name:
        return _number(100 * done, kind.name)
    if PART.search(name):
        return _number(done if kind.name in FLOAT_TYPES else 100 * done, kind.name)
    span = span_of("", name)
    return _number(done * (STEPS if span.shape == "count" else span.high or STEPS), kind.name)


def _number(value: float, kind: str) -> int | float:
    if kind in FLOAT_TYPES:
        return float(value)
    low, high = INTEGER_RANGES[kind]
    return min(max(round(value), low), high)
