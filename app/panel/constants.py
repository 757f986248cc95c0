"""Values of a field in a panel file: names of constants, and values that the field can't have."""

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Any, Protocol, TypeVar

from app.panel.condition import Condition
from app.panel.numbers import to_float32
from app.panel.values import NegatedText
from app.ros.messages import INTEGER_RANGES, STRING_TYPES, Interfaces, Type, field_name, parent_path
from app.ros.messages.validation import fitting_constants, format_value, unknown_constant

Resolved = TypeVar("Resolved", bound=Condition)


class HasField(Protocol):
    """A condition or a display."""

    @property
    def type(self) -> str: ...
    @property
    def field(self) -> str: ...


def parent_type(source: HasField, interfaces: Interfaces) -> str:
    """The type of the message that contains the field: its constants are those of the field."""
    return _parent_type(source.type, source.field, interfaces)


def _parent_type(type_name: str, field: str, interfaces: Interfaces) -> str:
    where = parent_path(field)
    return str(interfaces.type_at(type_name, where).element) if where else type_name


def resolve_constant(value: Any, kind: Type, constants: Mapping[str, Any]) -> Any:
    """The value of a comparison. A text is a constant's name if the field is no text; an
    unknown name is returned as it is.
    """
    named = isinstance(value, str) and kind.name not in STRING_TYPES
    return constants.get(value, value) if named else value


def comparison_value(written: Any, kind: Type, constants: Mapping[str, Any]) -> Any:
    """The same in the field's type: 0.1 as float32 is another number than as float64."""
    value = resolve_constant(written, kind, constants)
    return to_float32(value) if kind.name == "float32" else value


def resolve_at(value: Any, type_name: str, field: str, interfaces: Interfaces) -> Any:
    """A value for a field of a type: that of a constant where it is its name."""
    kind = interfaces.type_at(type_name, field)
    return resolve_constant(
        _number_in(value, kind), kind, interfaces.constants(_parent_type(type_name, field, interfaces))
    )


def _number_in(value: Any, kind: Type) -> Any:
    """The number of `"-{id}"` where the field is none of text."""
    return value.item() if isinstance(value, NegatedText) and kind.name not in STRING_TYPES else value


def mismatch_at(value: Any, type_name: str, field: str, interfaces: Interfaces) -> str | None:
    """Why a field of a type can have neither this value nor that of a constant of this name; None if it
    can."""
    kind, holder = interfaces.type_at(type_name, field), _parent_type(type_name, field, interfaces)
    names = fitting_constants(kind, interfaces.constants(holder))
    value = _number_in(value, kind)
    if isinstance(value, str) and names:
        return None if value in names else unknown_constant(value, kind, holder, names)
    return value_mismatch(value, kind.name)


def resolve_names(value: Any, kind: Type, interfaces: Interfaces, names: Mapping[str, Any] = {}) -> Any:
    """A message's value with values in place of the names of constants, for a reader: `encode` accepts
    both. Texts with input ids are unchanged."""
    if isinstance(value, list | tuple) and kind.container != "one":
        return [resolve_names(element, kind.element, interfaces, names) for element in value]
    if isinstance(value, Mapping) and kind.is_nested and kind.name in interfaces.structures:
        structure = interfaces.structures[kind.name]
        kinds = {field.name: field.type for field in structure.fields}
        return {
            name: resolve_names(element, kinds[name], interfaces, structure.constants)
            if name in kinds
            else element
            for name, element in value.items()
        }
    return resolve_constant(value, kind, names)


def resolve_condition(condition: Resolved, interfaces: Interfaces) -> Resolved:
    """The condition with values in place of constants' names in its comparisons, and in place of what
    is shown those of the field."""
    condition = condition.of_field()
    kind = interfaces.type_at(condition.type, condition.field)
    constants = interfaces.constants(parent_type(condition, interfaces))
    values = {
        key: tuple(comparison_value(value, kind, constants) for value in compared)
        if key == "one_of"
        else comparison_value(compared, kind, constants)
        for key, compared in condition.comparisons.items()
    }
    return condition.with_constants(values, _constant_names(condition, kind, constants))


def _constant_names(condition: Condition, kind: Type, constants: Mapping[str, Any]) -> dict[Any, str]:
    """Value → name of the constants with the same prefix as those in the comparisons, without values
    that several constants have. The prefix is removed if it is the field's name."""
    compared = [value for key in condition.comparisons for value in _as_tuple(getattr(condition, key))]
    named = [value for value in compared if isinstance(value, str) and kind.name not in STRING_TYPES]
    if not named:
        return {}
    own = f"{field_name(condition.field)}_".upper()
    alike = own if all(name.startswith(own) for name in named) else _common_prefix(named)
    names_by_value: dict[Any, list[str]] = {}
    for name, value in constants.items():
        if name.startswith(alike):
            names_by_value.setdefault(value, []).append(name.removeprefix(own))
    return {value: names[0] for value, names in names_by_value.items() if len(names) == 1}


def _common_prefix(names: Sequence[str]) -> str:
    """The words that all names begin with, each with its "_"."""
    begins = zip(*(name.split("_")[:-1] for name in names), strict=False)
    return "".join(f"{words[0]}_" for words in takewhile(lambda words: len({*words}) == 1, begins))


def _as_tuple(value: Any) -> tuple[Any, ...]:
    return value if isinstance(value, tuple) else (value,)


def value_mismatch(value: Any, kind: str) -> str | None:
    """Why a field of this type can't have this value; None if it can."""
    if kind in ("float32", "float64"):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return None if number else f"must be a number ({kind}), not {format_value(value)}"
    if kind == "bool":
        return (
            None
            if isinstance(value, bool)
            else f"must be true or false (bool), not {format_value(value)}"
        )
    if kind in INTEGER_RANGES:
        low, high = INTEGER_RANGES[kind]
        if isinstance(value, bool) or not isinstance(value, int):
            return f"must be a whole number ({kind}), not {format_value(value)}"
        inside = low <= value <= high
        return None if inside else f"{value} is out of range: {kind} goes from {low} to {high}"
    return None if isinstance(value, str) else f"must be text ({kind}), not {format_value(value)}"
