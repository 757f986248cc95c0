"""The steps of a scan: skip fields that are not selected, mark those that are.

A program is a flat list of steps, so that a scan can stop anywhere and continue later.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum, auto
from typing import Any

from app.interfaces.cdr.formats import LENGTH_BYTES, SIZES, is_number
from app.interfaces.cdr.layout import NO_SIZE, FieldsOf, PaddedSizes, concatenated, padded_sizes
from app.interfaces.cdr.selection import Lookup, Selection
from app.interfaces.definitions import STRING_TYPES, Type


class ScanStep(IntEnum):
    """The kinds of steps, with their operands."""

    PASS = auto()  # a Room
    TEXT = auto()
    WIDE_TEXT = auto()
    BOOL = auto()
    NUMBERS = auto()  # the size of one: a sequence of them
    ALIKE = auto()  # a Room: a sequence of such elements
    EACH = auto()  # a sequence: the step after its elements, and the least bytes of one
    TIMES = auto()  # an array: how many elements
    NEXT = auto()  # the end of an element: the first step of the next one
    NOTE = auto()  # a Mark of this offset
    CHOOSE = auto()  # a Choice, of elements of the list that begins here
    COMPARE = auto()  # a Lookup to compare with the value here
    CHOSEN = auto()  # the end of a scanned element of a Choice
    DONE = auto()  # the end of a chosen element
    BESIDE = auto()  # a Choice, of elements of a list that was skipped before
    ROW = auto()  # the end of an element of which selected fields are kept
    END = auto()


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """The place of a selected field (of `paths`), or of a list."""

    type: Type
    paths: tuple[str, ...] = ()


@dataclass(slots=True, eq=False)
class Choice:
    """Selected elements of a list: index → step, and lookup → value → step. `body` is the first step of
    the scan of an element, `after` the first one after the list.

    `count` is that of an array, None for a sequence. `sizes` are those of an element whose content is
    not scanned. For a list selected by another one, `mark` is where it begins and `key` the lookup in
    the other.
    """

    count: int | None
    min_size: int
    sizes: PaddedSizes | None
    body: int = 0
    after: int = 0
    indexes: dict[int, int] = field(default_factory=dict)
    by_lookup: dict[Lookup, dict[Any, int]] = field(default_factory=dict)
    ambiguous_paths: dict[tuple[Lookup, Any], tuple[str, ...]] = field(default_factory=dict)
    lookup: Lookup | None = None
    mark: Mark | None = None
    key: Lookup | None = None


Op = tuple[ScanStep, Any, Any]


class ReadPlans:
    """Compiles the programs of one set of definitions."""

    def __init__(self, fields: FieldsOf) -> None:
        self._fields = fields
        self._known_sizes: dict[Type, PaddedSizes | None] = {}

    def make_program(self, type_name: str, wanted: Selection, each: bool = False) -> tuple[Op, ...]:
        """The program of a message. `each`: every element of its lists is a step, except numbers."""
        made = _ProgramBuilder(self._fields, self._sizes if not each else self._sizes_of_numbers)
        made.add_structure(type_name, wanted)
        made.add(ScanStep.END)
        return tuple(made.steps)

    def _sizes_of_numbers(self, kind: Type) -> PaddedSizes | None:
        return self._sizes(kind) if is_number(kind) else None

    def _sizes(self, kind: Type) -> PaddedSizes | None:
        if kind not in self._known_sizes:
            self._known_sizes[kind] = padded_sizes(kind, self._fields)
        return self._known_sizes[kind]


class _ProgramBuilder:
    """Builds one program. Consecutive fields of fixed sizes are one step."""

    def __init__(self, fields: FieldsOf, room: Callable[[Type], PaddedSizes | None]) -> None:
        self.steps: list[Op] = []
        self._fields = fields
        self._sizes = room
        self._pending = NO_SIZE

    def add(self, do: ScanStep, first: Any = None, second: Any = None) -> None:
        self._flush()
        self.steps.append((do, first, second))

    @property
    def _next_step(self) -> int:
        """The number of the next step."""
        self._flush()
        return len(self.steps)

    def _flush(self) -> None:
        if self._pending != NO_SIZE:
            self.steps.append((ScanStep.PASS, self._pending, None))
            self._pending = NO_SIZE

    def add_structure(self, type_name: str, wanted: Selection | None, in_list: bool = False) -> None:
        """Adds the fields of a structure, then the elements that are selected by lists beside
        theirs."""
        inner = {} if wanted is None else wanted.fields
        keys = _keys_beside(inner, {field.name: field.type for field in self._fields(type_name)})
        places: dict[str, Mark] = {}
        for part in self._fields(type_name):
            child = inner.get(part.name)
            if child is not None and child.by_sibling:
                places[part.name] = Mark(part.type)
                self.add(ScanStep.NOTE, places[part.name])
            self._add_field(part.type, child, keys.get(part.name), in_list)
        for name, place in places.items():
            for key, values in inner[name].by_sibling.items():
                choice = self._make_choice(place.type)
                choice.mark, choice.key = place, keys[key]
                self._add_choice(ScanStep.BESIDE, choice, place.type, {keys[key]: values}, Selection())

    def _add_field(
        self, kind: Type, wanted: Selection | None, key: Lookup | None = None, in_list: bool = False
    ) -> None:
        if wanted is not None and wanted.paths:
            self.add(ScanStep.NOTE, Mark(kind, tuple(wanted.paths)))
        if wanted is not None and wanted.lookup is not None:
            wanted.lookup.type = kind
            wanted.lookup.prepare()
            self.add(ScanStep.COMPARE, wanted.lookup)
        if wanted is not None and wanted.each is not None:
            self._add_elements(kind, wanted.each)
        elif key is not None or (wanted is not None and (wanted.by_index or wanted.by_field)):
            self._select_elements(kind, wanted or Selection(), key)
        elif wanted is not None and wanted.fields:
            self.add_structure(kind.name, wanted, in_list)
        else:
            self._skip(kind, in_list)

    def _skip(self, kind: Type, in_list: bool) -> None:
        """Skips a field. A malformed bool is detected, except in lists."""
        if kind == Type("bool") and not in_list:
            self.add(ScanStep.BOOL)
        elif kind.container == "one" and kind.is_nested and not in_list:
            self.add_structure(kind.name, None)
        elif room := self._sizes(kind):
            self._pending = concatenated(self._pending, room)
        elif kind.container == "sequence" and is_number(kind):
            self.add(ScanStep.NUMBERS, SIZES[kind.name])
        elif kind.container == "sequence" and (room := self._sizes(kind.element)):
            self.add(ScanStep.ALIKE, room)
        elif kind.container != "one":
            self._skip_elements(kind)
        elif kind.is_nested:
            self.add_structure(kind.name, None, in_list)
        else:
            self.add(ScanStep.TEXT if kind.name == "string" else ScanStep.WIDE_TEXT)

    def _skip_elements(self, kind: Type) -> None:
        self._add_elements(kind, None)

    def _add_elements(self, kind: Type, wanted: Selection | None) -> None:
        """Adds a list whose elements are all scanned; those `wanted` are rows."""
        at = self._next_step
        self.add(ScanStep.EACH if kind.container == "sequence" else ScanStep.TIMES, kind.size)
        body = self._next_step
        self._add_field(kind.element, wanted, in_list=True)
        if wanted is not None:
            self.add(ScanStep.ROW)
        self.add(ScanStep.NEXT, body)
        if kind.container == "sequence":
            self.steps[at] = (ScanStep.EACH, self._next_step, min_size(kind.element))

    def _select_elements(self, kind: Type, wanted: Selection, key: Lookup | None) -> None:
        """Adds a list with selected elements, or one that is a key itself."""
        looked = Selection(lookup=key)
        selections: dict[Lookup, Mapping[Any, Selection]] = {}
        for path, values in wanted.by_field.items():
            lookup = Lookup(Type(""), set(values))
            _descend(looked, path).lookup = lookup
            selections[lookup] = values
        choice = self._make_choice(kind, looked)
        choice.lookup = key
        self._add_choice(ScanStep.CHOOSE, choice, kind, selections, wanted, looked)

    def _make_choice(self, kind: Type, looked: Selection | None = None) -> Choice:
        alone = looked is None or not (looked.lookup or looked.fields)
        room = self._sizes(kind.element) if alone else None
        count = kind.size if kind.container == "array" else None
        return Choice(count, min_size(kind.element), room)

    def _add_choice(
        self,
        do: ScanStep,
        choice: Choice,
        kind: Type,
        selections: Mapping[Lookup, Mapping[Any, Selection]],
        wanted: Selection,
        looked: Selection | None = None,
    ) -> None:
        """Adds the steps that scan each element, and those of each selected one."""
        self.add(do, choice)
        choice.body = self._next_step
        if choice.sizes is None:
            self._add_field(kind.element, looked, in_list=True)
            self.add(ScanStep.CHOSEN)
        choice.indexes = {
            index: self._add_element(kind, selection) for index, selection in wanted.by_index.items()
        }
        for lookup, values in selections.items():
            choice.by_lookup[lookup] = {
                value: self._add_element(kind, selection) for value, selection in values.items()
            }
            for value, selection in values.items():
                choice.ambiguous_paths[lookup, value] = tuple(selection.all_paths())
        choice.after = self._next_step

    def _add_element(self, kind: Type, wanted: Selection) -> int:
        at = self._next_step
        self._add_field(kind.element, wanted)
        self.add(ScanStep.DONE)
        return at


def _keys_beside(inner: Mapping[str, Selection], types: Mapping[str, Type]) -> dict[str, Lookup]:
    """The lists by which elements of lists beside them are selected."""
    keys: dict[str, Lookup] = {}
    for inner_value in inner.values():
        for name, values in inner_value.by_sibling.items():
            keys.setdefault(name, Lookup(types[name].element)).values.update(values)
    return keys


def _descend(node: Selection, path: str) -> Selection:
    for name in path.split("."):
        node = node.fields.setdefault(name, Selection())
    return node


def min_size(element: Type) -> int:
    """The smallest encoded size of an element, in bytes."""
    return (
        LENGTH_BYTES + 1
        if element.name == "string"
        else LENGTH_BYTES
        if element.name in STRING_TYPES
        else 1
    )
