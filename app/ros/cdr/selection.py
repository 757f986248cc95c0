"""The selected fields of a message: paths resolved against a type, as a tree."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain
from typing import Any

from app.ros.cdr.reader import LENGTH_BYTES
from app.ros.messages.definitions import FLOAT_TYPES, STRING_TYPES, Structure, Type
from app.ros.messages.field_path import (
    FieldCall,
    Key,
    PathStep,
    field_call,
    function,
    path_steps,
    result_type,
)
from app.ros.messages.parsing import BOOLS
from app.ros.messages.validation import scalar_check
from app.system.errors import FieldError, InterfaceError

Structures = Mapping[str, Structure]


@dataclass(eq=False, slots=True)
class Lookup:
    """A field of each element of a list, to be compared with the values of keys."""

    type: Type
    values: set[Any] = field(default_factory=set)
    texts: dict[bytes, str] = field(default_factory=dict)  # as encoded in a message
    sizes: set[int] = field(default_factory=set)  # of encoded texts, with their length fields

    def prepare(self) -> None:
        """Encodes the texts: they are compared without decoding."""
        if self.type.name == "string":
            self.texts = {f"{value}\0".encode(): value for value in self.values}
            self.sizes = {LENGTH_BYTES + len(text) for text in self.texts}


@dataclass(eq=False, slots=True)
class Selection:
    """A node of the tree. `paths` are those that end here.

    Elements of a list are selected by index (`by_index`), by a field of theirs (`by_field`: path of
    that field → value → element) or by the list of this name beside it (`by_sibling`).
    """

    paths: list[str] = field(default_factory=list)
    fields: "dict[str, Selection]" = field(default_factory=dict)
    by_index: "dict[int, Selection]" = field(default_factory=dict)
    by_field: "dict[str, dict[Any, Selection]]" = field(default_factory=dict)
    by_sibling: "dict[str, dict[Any, Selection]]" = field(default_factory=dict)
    lookup: Lookup | None = None  # if it is a key itself
    each: "Selection | None" = None  # of every element of a list

    def all_paths(self) -> Iterable[str]:
        """The paths that end here or below."""
        yield from self.paths
        chosen = (*self.by_field.values(), *self.by_sibling.values())
        inner = chain(
            self.fields.values(), self.by_index.values(), *(by_value.values() for by_value in chosen)
        )
        for selection in inner:
            yield from selection.all_paths()


class Resolver:
    """Resolves paths of one set of definitions."""

    def __init__(self, structures: Structures) -> None:
        self._structures = structures

    def select(self, type_name: str, paths: Iterable[str]) -> Selection:
        """The tree of these paths; InterfaceError if the type has no such field."""
        root = Selection()
        for path in paths:
            call = field_call(path)
            if call is None:
                self._add_path(root, Type(type_name), path)
            else:
                self._add_call(root, Type(type_name), call)
        return root

    def select_rows(self, type_name: str, path: str, fields: Iterable[str | None]) -> Selection:
        """The tree of the fields of each element of the list at a path; None is the element itself."""
        root, element = Selection(), self.type_at(type_name, path).element
        node, each = root, Selection()
        for step in path_steps(path):
            node = node.fields.setdefault(str(step), Selection())
        node.each = each
        for name in fields:
            if name is None:
                each.paths.append("")
            else:
                self._add_path(each, element, name)
        return root

    def type_at(self, type_name: str, path: str) -> Type:
        """The type of the field at a path, or of the result of a function of fields."""
        call = field_call(path)
        if call is not None:
            return self._add_call(Selection(), Type(type_name), call)
        return self._add_path(Selection(), Type(type_name), path)

    def typed_steps(self, type_name: str, path: str) -> tuple[PathStep, ...]:
        """The steps of a path, whose keys have the values that a message has: 5, not "5"."""
        return tuple(step for step, _, _ in self._steps(Type(type_name), path))

    def _add_call(self, root: Selection, whole: Type, call: FieldCall) -> Type:
        """Adds the fields of a function; of a list whose length is wanted, the list by the function."""
        function(call)
        counted = call.text if call.name == "length" else None
        kinds = [self._add_path(root, whole, path, counted) for path in call.paths]
        return result_type(call, kinds, whole, self._structures)

    def _add_path(self, root: Selection, whole: Type, path: str, name: str | None = None) -> Type:
        """`name` is what the value is known by, if not by its path."""
        node, at = root, whole
        for step, beside, after in self._steps(whole, path):
            match step:
                case Key():
                    chosen = node.by_sibling if beside else node.by_field
                    node = chosen.setdefault(step.path, {}).setdefault(step.value, Selection())
                case str():
                    node = node.fields.setdefault(step, Selection())
                case _:
                    node = node.by_index.setdefault(step, Selection())
            at = after
        node.paths.append(name or path)
        return at

    def _steps(self, whole: Type, path: str) -> Iterator[tuple[PathStep, bool, Type]]:
        """(step, whether it is a key of a list beside the list, type behind it)."""
        at, around = whole, whole
        for step in path_steps(path):
            beside = False
            match step:
                case Key():
                    step, beside = self._typed_key(at, around, step, path)
                    at = at.element
                case str():
                    around, at = at, self._field_type(at, step, path)
                case _:
                    at = _element_type(at, step, path)
            yield step, beside, at

    def _typed_key(self, at: Type, around: Type, key: Key, path: str) -> tuple[Key, bool]:
        """The key with its value's type, and whether it is of a list beside the list."""
        if at.container == "one":
            raise InterfaceError(f'there is no [{key.path}=…] (in "{path}"): {at} is not a list')
        kind = self._key_type(at.element, key.path)
        if kind is not None:
            return Key(key.path, self._key_value(key, kind, at.name, path)), False
        kind = next((o.type for o in self._fields(around) if o.name == key.path), None)
        if kind is None or kind.container == "one":
            raise InterfaceError(
                f'there is no "{key.path}" (in "{path}"): {self._known_fields_text(at, around)}'
            )
        return Key(key.path, self._key_value(key, kind.element, around.name, path)), True

    def _key_type(self, element: Type, path: str) -> Type | None:
        """The type of a field of an element; None if it does not exist."""
        at = element
        for name in path.split("."):
            field_type = next((field.type for field in self._fields(at) if field.name == name), None)
            if field_type is None:
                return None
            at = field_type
        return at

    def _key_value(self, key: Key, kind: Type, holder: str, path: str) -> Any:
        """The key's value with the field's type; for an integer field also by a constant's name."""
        place = f'"{key.path}" (in "{path}") is {kind}'
        if kind.is_nested or kind.container != "one" or kind.name in FLOAT_TYPES:
            raise InterfaceError(f"{place}: a key is a text, a whole number or a bool")
        text = str(key.value)
        if kind.name in STRING_TYPES:
            return text
        constants = self._structures[holder].constants
        value = BOOLS.get(text) if kind.name == "bool" else constants.get(text)
        if value is None and kind.name != "bool":
            value = int(text) if text.lstrip("-").isdecimal() else text
        try:
            return scalar_check(kind)(value)
        except FieldError as error:
            has = f"; constants of {holder}: {', '.join(constants)}" if constants else ""
            raise InterfaceError(f'{place}, and "{text}" is none: {error.message}{has}') from None

    def _fields(self, kind: Type) -> Iterable[Any]:
        return self._structures[kind.name].fields if kind.is_nested and kind.container == "one" else ()

    def _known_fields_text(self, at: Type, around: Type) -> str:
        own = [field.name for field in self._fields(at.element)]
        lists = [field.name for field in self._fields(around) if field.type.container != "one"]
        elements = f"its elements have {', '.join(own)}; " if own else ""
        return f"{elements}the lists beside it are {', '.join(lists)}"

    def _field_type(self, at: Type, name: str, path: str) -> Type:
        inner = list(self._fields(at))
        for known in inner:
            if known.name == name:
                field_type: Type = known.type
                return field_type
        has = f"has {', '.join(known.name for known in inner)}" if inner else "has no fields of its own"
        raise InterfaceError(f'there is no "{name}" (in "{path}"): {at} {has}')


def _element_type(at: Type, index: int, path: str) -> Type:
    if at.container == "one":
        raise InterfaceError(f'there is no [{index}] (in "{path}"): {at} is not a list')
    if at.size and index >= at.size:
        raise InterfaceError(f'there is no [{index}] (in "{path}"): {at} ends with [{at.size - 1}]')
    return at.element
