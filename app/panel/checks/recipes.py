"""Checks of sets of recipes: their fields, how they are loaded and read back."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from app.panel.base import Description
from app.panel.checks.types import field_faults, way_faults
from app.panel.file.wording import known_hint, list_names, no_such
from app.panel.numbers import NUMBERS
from app.panel.recipe import ParameterKind, RecipeReadback, RecipeSet
from app.panel.widgets.families import CheckContext, Command, Input
from app.panel.widgets.parameter import is_valid_value
from app.panel.widgets.recipe_load import RecipeLoad
from app.ros.messages import Type
from app.system.errors import Fault

# The keys of each way to load, by the key that chooses it.
WAYS: Final[Mapping[str, tuple[str, ...]]] = {
    "topic": ("type", "message", "qos"),
    "service": ("type", "request", "success", "answer", "timeout_s"),
    "node": ("parameters", "parameter_types", "timeout_s"),
}
NEEDED: Final = {"topic": ("type", "message"), "service": ("type", "request"), "node": ("parameters",)}
READ: Final[Mapping[str, tuple[str, ...]]] = {
    "topic": ("type", "fields", "qos", "max_age_s"),
    "node": ("parameters", "parameter_types"),
}
READ_NEEDED: Final = {"topic": ("type", "fields"), "node": ("parameters",)}


def recipe_faults(
    tables: Sequence[RecipeSet], loads: Sequence[RecipeLoad], checking: CheckContext
) -> Iterator[Fault]:
    """Faults of the sets of recipes; the templates of a set have its own fields only."""
    for r, (table, load) in enumerate(zip(tables, loads, strict=True)):
        own = replace(checking, inputs={field.id: field for field in load.fields})
        yield from _set_faults(table, f"recipe[{r}]", load, own)


def _set_faults(
    table: RecipeSet, place: str, load: RecipeLoad, checking: CheckContext
) -> Iterator[Fault]:
    """Faults of the table at `place`; `checking.inputs` are its own fields."""
    yield from _field_faults(table, place, checking)
    yield from load.faults(place, checking)
    ways = list(_way_faults(place, table, WAYS, NEEDED, "it is loaded by"))
    if not ways and table.node is None:
        ways += way_faults(place, table.type, of_service=table.service is not None)
    yield from ways
    is_whole = len(load.fields) == len(table.fields) == len({*table.fields})
    if ways or not is_whole or {*table.fields} & {*checking.faulty}:
        return
    for part in load.parts:
        faults = list(part.faults(place, replace(checking, all_inputs=())))
        yield from faults or _unsent_faults(table, place, part)
    if table.node is not None:
        yield from _name_faults(place, "parameters", table.parameters, table.fields)
        yield from _kind_faults(place, table.parameters, table.parameter_types, load)
    if table.readback is not None:
        yield from _readback_faults(table, f"{place}.readback", table.readback, load, checking)


def _unsent_faults(table: RecipeSet, place: str, part: Command) -> Iterator[Fault]:
    sent, key = repr(part.templates()), "message" if table.topic is not None else "request"
    for i, name in enumerate(table.fields):
        if f"{{{name}}}" not in sent:
            message = f'"{name}" is not sent: {key} has no "{{{name}}}"'
            yield Fault(f"{place}.fields[{i}]", message)


def _field_faults(table: RecipeSet, place: str, checking: CheckContext) -> Iterator[Fault]:
    for i, name in enumerate(table.fields):
        if name in table.fields[:i]:
            yield Fault(f"{place}.fields[{i}]", f'names "{name}" twice')
        elif name not in checking.all_inputs:
            message = no_such("input", name, sorted(checking.all_inputs), " on any page")
            yield Fault(f"{place}.fields[{i}]", message, cause=f"input {name}")


def _readback_faults(
    table: RecipeSet, place: str, readback: RecipeReadback, load: RecipeLoad, checking: CheckContext
) -> Iterator[Fault]:
    ways = list(_way_faults(place, readback, READ, READ_NEEDED, "it is read back from"))
    yield from ways
    if ways:
        return
    if readback.node is not None:
        yield from _name_faults(place, "parameters", readback.parameters, table.fields)
        yield from _kind_faults(place, readback.parameters, readback.parameter_types, load)
        return
    yield from _name_faults(place, "fields", readback.fields, table.fields)
    for name, path in readback.fields.items():
        at = f"{place}.fields.{name}"
        faults = list(field_faults(at, readback.type or "", path, checking.interfaces))
        for fault in faults:
            moved = at if fault.place == f"{at}.field" else f"{place}.type"
            yield Fault(moved, fault.message, cause=fault.cause)
        entry = next((field for field in load.fields if field.id == name), None)
        if entry is not None and not faults:
            kind = checking.interfaces.type_at(readback.type or "", path)
            yield from _value_kind_faults(at, path, kind, entry)


def _value_kind_faults(place: str, path: str, kind: Type, entry: Input) -> Iterator[Fault]:
    """A fault of a field that can never have a value of its input: no load would be confirmed."""
    examples = entry.examples()
    if any(isinstance(value, list | tuple) for value in examples):
        return
    wanted = {_value_kind(value) for value in examples}
    reported = "number" if kind.name in NUMBERS else "bool" if kind.name == "bool" else "text"
    is_one = kind.container == "one" and not kind.is_nested
    if wanted and not (is_one and reported in wanted):
        message = f'"{path}" is {kind}: "{entry.id}" is a {" or a ".join(sorted(wanted))}'
        yield Fault(place, message)


def _value_kind(value: Any) -> str:
    if isinstance(value, bool):
        return "bool"
    return "number" if isinstance(value, int | float) else "text"


def _way_faults(
    place: str,
    table: Description,
    ways: Mapping[str, tuple[str, ...]],
    needed: Mapping[str, tuple[str, ...]],
    said: str,
) -> Iterator[Fault]:
    """Faults of the keys that choose one of several ways."""
    chosen = [key for key in ways if getattr(table, key) is not None]
    if not chosen:
        yield Fault(place, f"{said} one of {', '.join([*ways][:-1])} and {[*ways][-1]}: name it")
        return
    way, *others = chosen
    for key in others:
        yield Fault(f"{place}.{key}", f"has no meaning beside {way}: {said} one of them")
    if others:
        return
    own = ways[way]
    foreign = {key: name for name, keys in ways.items() for key in keys if key not in own}
    for key, name in foreign.items():
        if key in table.model_fields_set:
            yield Fault(f"{place}.{key}", f"is for {name}; this table has {way}")
    for key in needed[way]:
        if not getattr(table, key):
            yield Fault(f"{place}.{key}", f"is missing: {way} needs it")


def _name_faults(
    place: str, key: str, names: Mapping[str, str], fields: tuple[str, ...]
) -> Iterator[Fault]:
    for name in names:
        if name not in fields:
            message = f"is not one of the recipe's fields; {known_hint(name, fields)}"
            yield Fault(f"{place}.{key}.{name}", message)
    missing = [name for name in fields if name not in names]
    if missing:
        yield Fault(f"{place}.{key}", f"lacks {list_names(missing)}: each field needs its name here")


def _kind_faults(
    place: str, names: Mapping[str, str], kinds: Mapping[str, ParameterKind], load: RecipeLoad
) -> Iterator[Fault]:
    for field in load.fields:
        kind = kinds.get(field.id)
        values = [field.sent_value(example) for example in field.examples()]
        if kind is not None and not all(is_valid_value(kind, value) for value in values):
            message = f'input "{field.id}" gives {field.value_description}; the parameter is {kind}'
            yield Fault(f"{place}.parameter_types.{field.id}", message)
        elif kind is None and any(isinstance(value, list | dict) for value in values):
            message = "an option is a list or a table, which no parameter takes"
            yield Fault(f"{place}.parameters.{field.id}", message)
    for name in kinds:
        if name not in names and not any(field.id == name for field in load.fields):
            message = "is not one of the recipe's fields"
            yield Fault(f"{place}.parameter_types.{name}", message)
