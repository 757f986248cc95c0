"""Checks of interlocks: the field's type, and conditions that can't be met."""

import math
import re
from collections.abc import Iterator
from typing import Any, Final

from app.errors import Fault, FieldError
from app.interfaces import INTEGER_RANGES, Interfaces, Type
from app.interfaces.validation import format_value, scalar_check, unknown_constant
from app.panel.checks.types import field_faults
from app.panel.constants import (
    NUMBERS,
    comparison_value,
    parent_type,
    resolve_constant,
)
from app.panel.interlock import Interlock
from app.panel.values import same_value

BEST_EFFORT: Final = (
    "is missing: of a best-effort topic any message may be lost, the one that forbids too; "
    "give the age in seconds after which it locks"
)
EXCLUSIVE_CONDITIONS: Final = ("equals", "one_of")  # exclude all other conditions
UNCONDITIONED: Final = (
    "an interlock needs a bool, or conditions: equals, not_equals, min and max, or one_of"
)


def interlock_faults(place: str, interlock: Interlock, interfaces: Interfaces) -> Iterator[Fault]:
    if interlock.qos.reliability == "best_effort" and interlock.max_age_s is None:
        yield Fault(f"{place}.max_age_s", BEST_EFFORT)
    faults = list(field_faults(place, interlock.type, interlock.field, interfaces))
    yield from faults
    if faults:
        return
    kind = interfaces.type_at(interlock.type, interlock.field)
    if re.search(r"[/\]]", str(kind)):
        yield Fault(
            f"{place}.field", f'"{interlock.field}" is {kind}: an interlock judges one value of it'
        )
    elif not interlock.conditions and kind.name != "bool":
        yield Fault(f"{place}.field", f'"{interlock.field}" is {kind}: {UNCONDITIONED}')
    else:
        yield from _condition_faults(place, interlock, kind, interfaces)


def _condition_faults(
    place: str, interlock: Interlock, kind: Type, interfaces: Interfaces
) -> Iterator[Fault]:
    numeric = kind.name in NUMBERS
    if interlock.unit and not numeric:
        yield _number_only_fault(place, "unit", interlock, kind)
    alone = next((key for key in EXCLUSIVE_CONDITIONS if key in interlock.conditions), None)
    if alone and (others := [key for key in interlock.conditions if key != alone]):
        what = f"has no meaning beside {alone}, which says all: leave it out"
        yield from (Fault(f"{place}.{key}", what, cause=f"alone {place}") for key in others)
        return
    faults = list(_value_faults(place, interlock, kind, interfaces))
    yield from faults
    if numeric and not faults:
        yield from _unsatisfiable_faults(place, interlock, kind, interfaces)


def _value_faults(
    place: str, interlock: Interlock, kind: Type, interfaces: Interfaces
) -> Iterator[Fault]:
    """Faults of values that the field can't have."""
    type_name = parent_type(interlock, interfaces)
    constants = interfaces.constants(type_name)
    for key, given in interlock.conditions.items():
        if key in ("min", "max") and kind.name not in NUMBERS:
            yield _number_only_fault(place, key, interlock, kind)
            continue
        several = given if key == "one_of" else (given,)
        found: list[Any] = []
        for i, one in enumerate(several):
            at = f"{place}.{key}[{i}]" if key == "one_of" else f"{place}.{key}"
            value = resolve_constant(one, kind, constants)
            cause = f"condition {place}"
            if isinstance(value, str) and kind.name in NUMBERS:
                yield Fault(at, unknown_constant(value, kind, type_name, constants), cause=cause)
            elif fault := _value_mismatch(value, kind):
                yield Fault(at, fault, cause=cause)
            elif any(same_value(value, other) for other in found):
                yield Fault(at, f"{format_value(one)} is there already")
            found.append(value)


def _number_only_fault(place: str, key: str, interlock: Interlock, kind: Type) -> Fault:
    return Fault(
        f"{place}.{key}", f'is for numbers; "{interlock.field}" is {kind}', cause=f"number {place}"
    )


def _value_mismatch(value: Any, kind: Type) -> str | None:
    """Why the field can't have this value; None if it can."""
    try:
        scalar_check(kind)(value)
    except FieldError as error:
        return error.message
    return None


def _unsatisfiable_faults(
    place: str, interlock: Interlock, kind: Type, interfaces: Interfaces
) -> Iterator[Fault]:
    constants = interfaces.constants(parent_type(interlock, interfaces))
    lowest, highest = INTEGER_RANGES.get(kind.name, (-math.inf, math.inf))
    low, high, excluded = (
        none if one is None else comparison_value(one, kind, constants)
        for one, none in (
            (interlock.min, lowest),
            (interlock.max, highest),
            (interlock.not_equals, math.nan),
        )
    )
    if low > high:
        low_text, high_text = format_value(interlock.min), format_value(interlock.max)
        yield Fault(f"{place}.max", f"{high_text} is less than min ({low_text}): no value permits")
    elif low == high == excluded:
        what = f"{format_value(interlock.not_equals)} is all that the limits leave: no value permits"
        yield Fault(f"{place}.not_equals", what)
