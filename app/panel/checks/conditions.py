"""Checks of conditions: the field's type, and comparisons that no value meets."""

import math
import re
from collections.abc import Iterator
from typing import Any, Final

from app.panel.checks.types import value_faults
from app.panel.condition import VALUE, Condition
from app.panel.constants import comparison_value, parent_type, resolve_constant
from app.panel.model import Panel
from app.panel.numbers import NUMBERS
from app.panel.shared_keys import number_key_faults
from app.panel.values import same_value
from app.ros.messages import INTEGER_RANGES, Interfaces, Type, field_call
from app.ros.messages.validation import format_value, scalar_check, unknown_constant
from app.system.errors import Fault, FieldError
from app.system.texts.text import each_language

BEST_EFFORT: Final = (
    "is missing: of a best-effort topic any message may be lost, the one that forbids too; "
    "give the age in seconds after which it locks"
)
AGE_STANDS: Final = (
    "is missing: age() is how old the time was when its message arrived, and stays while no other "
    "arrives; give the age in seconds after which it locks"
)
EXCLUSIVE: Final = ("equals", "one_of")  # exclude all other comparisons
NEEDS: Final = "needs a bool, or conditions: equals, not_equals, min and max, or one_of"


def condition_id_faults(panel: Panel) -> Iterator[Fault]:
    """Interlocks and conditions are named in the same places."""
    ids = [condition.id for condition in panel.named_conditions]
    for number, condition in enumerate(panel.own_conditions, len(panel.interlocks)):
        if condition.id in ids[:number]:
            message = f'"{condition.id}" is already the id of an interlock or a condition'
            yield Fault(f"condition[{number - len(panel.interlocks)}].id", message)


def condition_faults_of(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """Faults of each interlock and condition."""
    for i, interlock in enumerate(panel.interlocks):
        yield from condition_faults(f"interlock[{i}]", interlock, interfaces)
    for c, condition in enumerate(panel.own_conditions):
        yield from condition_faults(f"condition[{c}]", condition, interfaces)


def condition_faults(place: str, condition: Condition, interfaces: Interfaces) -> Iterator[Fault]:
    """Faults of one condition, which is the table at `place`."""
    if condition.qos.reliability == "best_effort" and condition.max_age_s is None:
        yield Fault(f"{place}.max_age_s", BEST_EFFORT)
    yield from _sentence_faults(place, condition)
    who = condition.noun
    faults = list(value_faults(place, condition.type, condition.field, who, interfaces))
    yield from faults
    if faults:
        return
    call = field_call(condition.field)
    if call is not None and call.name == "age" and condition.max_age_s is None:
        yield Fault(f"{place}.max_age_s", AGE_STANDS)
    kind = interfaces.type_at(condition.type, condition.field)
    if not condition.comparisons and kind.name != "bool":
        reason = f'"{condition.field}" is {kind}: {who} {NEEDS}'
        yield Fault(f"{place}.field", reason)
    else:
        yield from _comparison_faults(place, condition, kind, interfaces)


def _sentence_faults(place: str, condition: Condition) -> Iterator[Fault]:
    """Faults of the panel file's own sentence for a value that does not meet the condition."""
    sentence = condition.own_sentence
    texts = each_language(sentence).values() if sentence is not None else ()
    for text in texts:
        if re.search("[{}]", text.replace(VALUE, "", 1)):
            message = f'"{text}" may have {VALUE} once and no other braces, like "Air is at {VALUE}."'
            if "{value:" in text:
                message += '; its format is a key of the condition, such as format = ".1f"'
            yield Fault(f"{place}.locked", message)
            return


def _comparison_faults(
    place: str, condition: Condition, kind: Type, interfaces: Interfaces
) -> Iterator[Fault]:
    faults = list(number_key_faults(place, condition, condition.field, kind.name))
    if condition.is_scaled:
        faults += _scaled_faults(place, condition)
    yield from faults
    if faults:
        return
    alone = next((key for key in EXCLUSIVE if key in condition.comparisons), None)
    if alone and (others := [key for key in condition.comparisons if key != alone]):
        reason = f"has no meaning beside {alone}, which says all: leave it out"
        yield from (Fault(f"{place}.{key}", reason, cause=f"alone {place}") for key in others)
        return
    raw = condition.of_field()
    faults = list(_value_faults(place, raw, kind, interfaces))
    yield from faults
    if kind.name in NUMBERS and not faults:
        yield from _unsatisfiable_faults(place, condition, raw, kind, interfaces)


def _scaled_faults(place: str, condition: Condition) -> Iterator[Fault]:
    """Faults of comparisons that a scale can't be applied to."""
    for key, compared in condition.comparisons.items():
        for value in compared if key == "one_of" else (compared,):
            if isinstance(value, bool | str):
                message = f"must be a number, as it is shown, not {format_value(value)}"
                yield Fault(f"{place}.{key}", message, cause=f"scale {place}")


def _value_faults(
    place: str, condition: Condition, kind: Type, interfaces: Interfaces
) -> Iterator[Fault]:
    """Faults of values that the field can't have."""
    type_name = parent_type(condition, interfaces)
    constants = interfaces.constants(type_name)
    for key, compared in condition.comparisons.items():
        if key in ("min", "max") and kind.name not in NUMBERS:
            yield _number_only_fault(place, key, condition, kind)
            continue
        seen: list[Any] = []
        for i, written in enumerate(compared if key == "one_of" else (compared,)):
            at = f"{place}.{key}[{i}]" if key == "one_of" else f"{place}.{key}"
            value = resolve_constant(written, kind, constants)
            cause = f"condition {place}"
            if isinstance(value, str) and kind.name in NUMBERS:
                yield Fault(at, unknown_constant(value, kind, type_name, constants), cause=cause)
            elif condition.is_scaled and key in ("min", "max"):
                continue  # may lie between two values of the field
            elif fault := _value_mismatch(value, kind):
                is_of = f"is {value:g} in the message, which " if condition.is_scaled else ""
                yield Fault(at, f"{is_of}{fault}", cause=cause)
            elif any(same_value(value, other) for other in seen):
                yield Fault(at, f"{format_value(written)} is there already")
            seen.append(value)


def _number_only_fault(place: str, key: str, condition: Condition, kind: Type) -> Fault:
    return Fault(
        f"{place}.{key}", f'is for numbers; "{condition.field}" is {kind}', cause=f"number {place}"
    )


def _value_mismatch(value: Any, kind: Type) -> str | None:
    """Why the field can't have this value; None if it can."""
    try:
        scalar_check(kind)(value)
    except FieldError as error:
        return error.message
    return None


def _unsatisfiable_faults(
    place: str, written: Condition, condition: Condition, kind: Type, interfaces: Interfaces
) -> Iterator[Fault]:
    constants = interfaces.constants(parent_type(condition, interfaces))
    lowest, highest = INTEGER_RANGES.get(kind.name, (-math.inf, math.inf))
    low, high, excluded = (
        default if compared is None else comparison_value(compared, kind, constants)
        for compared, default in (
            (condition.min, lowest),
            (condition.max, highest),
            (condition.not_equals, math.nan),
        )
    )
    if low > high:
        low_text, high_text = format_value(written.min), format_value(written.max)
        yield Fault(f"{place}.max", f"{high_text} is less than min ({low_text}): no value permits")
    elif low == high == excluded:
        reason = f"{format_value(written.not_equals)} is all that the limits leave: no value permits"
        yield Fault(f"{place}.not_equals", reason)
