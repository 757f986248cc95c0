"""What can be wrong in an interlock whose shape is right: its field, and conditions that never hold."""

import math
import re
from collections.abc import Iterator
from typing import Any, Final

from app.errors import Fault, FieldError
from app.interfaces import INTEGERS, Interfaces, Type
from app.interfaces.validation import scalar_check, shown
from app.panel.checks.types import field_faults
from app.panel.constants import NUMBERS, compared, holder, meant, no_constant
from app.panel.interlock import Interlock
from app.panel.values import same

BEST_EFFORT: Final = (
    "is missing: of a best-effort topic any message may be lost, the one that forbids too; "
    "give the age in seconds after which it locks"
)
ALONE: Final = ("equals", "one_of")  # beside them nothing else has a meaning
UNCONDITIONED: Final = (
    "an interlock needs a bool, or conditions: equals, not_equals, min and max, or one_of"
)


def interlock_faults(place: str, of: Interlock, interfaces: Interfaces) -> Iterator[Fault]:
    if of.qos.reliability == "best_effort" and of.max_age_s is None:
        yield Fault(f"{place}.max_age_s", BEST_EFFORT)
    faults = list(field_faults(place, of.type, of.field, interfaces))
    yield from faults
    if faults:
        return
    kind = interfaces.type_at(of.type, of.field)
    if re.search(r"[/\]]", str(kind)):
        yield Fault(f"{place}.field", f'"{of.field}" is {kind}: an interlock judges one value of it')
    elif not of.conditions and kind.name != "bool":
        yield Fault(f"{place}.field", f'"{of.field}" is {kind}: {UNCONDITIONED}')
    else:
        yield from _conditions(place, of, kind, interfaces)


def _conditions(place: str, of: Interlock, kind: Type, interfaces: Interfaces) -> Iterator[Fault]:
    numeric = kind.name in NUMBERS
    if of.unit and not numeric:
        yield _for_numbers(place, "unit", of, kind)
    alone = next((key for key in ALONE if key in of.conditions), None)
    if alone and (others := [key for key in of.conditions if key != alone]):
        what = f"has no meaning beside {alone}, which says all: leave it out"
        yield from (Fault(f"{place}.{key}", what, cause=f"alone {place}") for key in others)
        return
    faults = list(_values(place, of, kind, interfaces))
    yield from faults
    if numeric and not faults:
        yield from _never(place, of, kind, interfaces)


def _values(place: str, of: Interlock, kind: Type, interfaces: Interfaces) -> Iterator[Fault]:
    """Each value has to be one that the field can have."""
    type_name = holder(of, interfaces)
    constants = interfaces.constants(type_name)
    for key, given in of.conditions.items():
        if key in ("min", "max") and kind.name not in NUMBERS:
            yield _for_numbers(place, key, of, kind)
            continue
        several = given if key == "one_of" else (given,)
        found: list[Any] = []
        for i, one in enumerate(several):
            at = f"{place}.{key}[{i}]" if key == "one_of" else f"{place}.{key}"
            value = meant(one, kind, constants)
            cause = f"condition {place}"
            if isinstance(value, str) and kind.name in NUMBERS:
                yield Fault(at, no_constant(value, str(kind), type_name, constants), cause=cause)
            elif fault := _misfit(value, kind):
                yield Fault(at, fault, cause=cause)
            elif any(same(value, other) for other in found):
                yield Fault(at, f"{shown(one)} is there already")
            found.append(value)


def _for_numbers(place: str, key: str, of: Interlock, kind: Type) -> Fault:
    return Fault(f"{place}.{key}", f'is for numbers; "{of.field}" is {kind}', cause=f"number {place}")


def _misfit(value: Any, kind: Type) -> str | None:
    """Why the field never has this value."""
    try:
        scalar_check(kind)(value)
    except FieldError as error:
        return error.message
    return None


def _never(place: str, of: Interlock, kind: Type, interfaces: Interfaces) -> Iterator[Fault]:
    constants = interfaces.constants(holder(of, interfaces))
    lowest, highest = INTEGERS.get(kind.name, (-math.inf, math.inf))
    low, high, excluded = (
        none if one is None else compared(one, kind, constants)
        for one, none in ((of.min, lowest), (of.max, highest), (of.not_equals, math.nan))
    )
    if low > high:
        yield Fault(
            f"{place}.max", f"{shown(of.max)} is less than min ({shown(of.min)}): no value permits"
        )
    elif low == high == excluded:
        what = f"{shown(of.not_equals)} is all that the limits leave: no value permits"
        yield Fault(f"{place}.not_equals", what)
