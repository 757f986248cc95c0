"""What a reader does with the bytes of a message, step by step: passes over what is not wanted, notes
where what is wanted begins.

A program is flat, so that `reading` can stop anywhere and go on later.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum, auto
from typing import Any

from app.interfaces.cdr.formats import LENGTH, SIZES, is_number
from app.interfaces.cdr.layout import NONE, Fields, Room, joined, room_of
from app.interfaces.cdr.selection import Lookup, Selection
from app.interfaces.definitions import TEXTS, Type


class Step(IntEnum):
    """The steps, each with what it is about."""

    PASS = auto()  # a Room
    TEXT = auto()
    WIDE_TEXT = auto()
    BOOL = auto()
    NUMBERS = auto()  # the size of one: a sequence of them
    ALIKE = auto()  # a Room: a sequence of such elements
    EACH = auto()  # a sequence: the step after its elements, and the least bytes of one
    TIMES = auto()  # an array: how many elements
    NEXT = auto()  # an element is over: the first step of the next one
    NOTE = auto()  # a Mark: what begins here
    CHOOSE = auto()  # a Choice, of elements of the list that begins here
    COMPARE = auto()  # a Lookup, with the key that is here
    CHOSEN = auto()  # an element of a Choice was looked at
    DONE = auto()  # a chosen element was read
    BESIDE = auto()  # a Choice, of elements of a list that was passed over before
    END = auto()


@dataclass(frozen=True, slots=True, eq=False)
class Mark:
    """A place: of a field that is wanted (for `paths`), or of a list."""

    type: Type
    paths: tuple[str, ...] = ()


@dataclass(slots=True, eq=False)
class Choice:
    """Elements of a list that are wanted: the first step of each one's own, by index or by what a key
    of theirs says; `body` and `after` are the steps that look at one, and those after the list.

    `count` is that of an array, None of a sequence; `room` of an element where nothing in it is looked
    at. Of a list beside another one `place` is where it began, and `key` what was found in the other.
    """

    count: int | None
    least: int
    room: Room | None
    body: int = 0
    after: int = 0
    indexes: dict[int, int] = field(default_factory=dict)
    found: dict[Lookup, dict[Any, int]] = field(default_factory=dict)
    several: dict[tuple[Lookup, Any], tuple[str, ...]] = field(default_factory=dict)
    looks_up: Lookup | None = None
    place: Mark | None = None
    key: Lookup | None = None


Op = tuple[Step, Any, Any]


class ReadPlans:
    """Makes the programs of one set of definitions."""

    def __init__(self, fields: Fields) -> None:
        self._fields = fields
        self._rooms: dict[Type, Room | None] = {}

    def program(self, type_name: str, wanted: Selection, each: bool = False) -> tuple[Op, ...]:
        """Of a whole message; `each`: each element of its lists is gone to, but for numbers."""
        made = _Making(self._fields, self._room if not each else self._room_of_numbers)
        made.structure(type_name, wanted)
        made.add(Step.END)
        return tuple(made.steps)

    def _room_of_numbers(self, kind: Type) -> Room | None:
        return self._room(kind) if is_number(kind) else None

    def _room(self, kind: Type) -> Room | None:
        if kind not in self._rooms:
            self._rooms[kind] = room_of(kind, self._fields)
        return self._rooms[kind]


class _Making:
    """One program; a run of fields of fixed sizes is one step."""

    def __init__(self, fields: Fields, room: Callable[[Type], Room | None]) -> None:
        self.steps: list[Op] = []
        self._fields = fields
        self._room = room
        self._run = NONE

    def add(self, do: Step, one: Any = None, other: Any = None) -> None:
        self._flush()
        self.steps.append((do, one, other))

    @property
    def _here(self) -> int:
        """The next step."""
        self._flush()
        return len(self.steps)

    def _flush(self) -> None:
        if self._run != NONE:
            self.steps.append((Step.PASS, self._run, None))
            self._run = NONE

    def structure(self, type_name: str, wanted: Selection | None, in_list: bool = False) -> None:
        """Its fields, and what is chosen by lists beside others when all have been passed."""
        inner = {} if wanted is None else wanted.fields
        keys = _keys_beside(inner, {one.name: one.type for one in self._fields(type_name)})
        places: dict[str, Mark] = {}
        for one in self._fields(type_name):
            child = inner.get(one.name)
            if child is not None and child.beside:
                places[one.name] = Mark(one.type)
                self.add(Step.NOTE, places[one.name])
            self._field(one.type, child, keys.get(one.name), in_list)
        for name, place in places.items():
            for key, values in inner[name].beside.items():
                choice = self._choice(place.type)
                choice.place, choice.key = place, keys[key]
                self._chosen(Step.BESIDE, choice, place.type, {keys[key]: values}, Selection())

    def _field(
        self, kind: Type, wanted: Selection | None, key: Lookup | None = None, in_list: bool = False
    ) -> None:
        if wanted is not None and wanted.paths:
            self.add(Step.NOTE, Mark(kind, tuple(wanted.paths)))
        if wanted is not None and wanted.lookup is not None:
            wanted.lookup.type = kind
            wanted.lookup.prepare()
            self.add(Step.COMPARE, wanted.lookup)
        if key is not None or (wanted is not None and (wanted.indexes or wanted.keys)):
            self._list(kind, wanted or Selection(), key)
        elif wanted is not None and wanted.fields:
            self.structure(kind.name, wanted, in_list)
        else:
            self._passed(kind, in_list)

    def _passed(self, kind: Type, in_list: bool) -> None:
        """What nothing is wanted of. A bool that is no bool is seen, but for those in lists."""
        if kind == Type("bool") and not in_list:
            self.add(Step.BOOL)
        elif kind.many == "one" and kind.nested and not in_list:
            self.structure(kind.name, None)
        elif room := self._room(kind):
            self._run = joined(self._run, room)
        elif kind.many == "sequence" and is_number(kind):
            self.add(Step.NUMBERS, SIZES[kind.name])
        elif kind.many == "sequence" and (room := self._room(kind.element)):
            self.add(Step.ALIKE, room)
        elif kind.many != "one":
            self._each(kind)
        elif kind.nested:
            self.structure(kind.name, None, in_list)
        else:
            self.add(Step.TEXT if kind.name == "string" else Step.WIDE_TEXT)

    def _each(self, kind: Type) -> None:
        at = self._here
        self.add(Step.EACH if kind.many == "sequence" else Step.TIMES, kind.size)
        body = self._here
        self._passed(kind.element, in_list=True)
        self.add(Step.NEXT, body)
        if kind.many == "sequence":
            self.steps[at] = (Step.EACH, self._here, least_of(kind.element))

    def _list(self, kind: Type, wanted: Selection, key: Lookup | None) -> None:
        """A list of which elements are wanted, by their indexes or keys, or which is a key itself."""
        looked = Selection(lookup=key)
        found: dict[Lookup, Mapping[Any, Selection]] = {}
        for path, values in wanted.keys.items():
            lookup = Lookup(Type(""), set(values))
            _inside(looked, path).lookup = lookup
            found[lookup] = values
        choice = self._choice(kind, looked)
        choice.looks_up = key
        self._chosen(Step.CHOOSE, choice, kind, found, wanted, looked)

    def _choice(self, kind: Type, looked: Selection | None = None) -> Choice:
        alone = looked is None or not (looked.lookup or looked.fields)
        room = self._room(kind.element) if alone else None
        count = kind.size if kind.many == "array" else None
        return Choice(count, least_of(kind.element), room)

    def _chosen(
        self,
        do: Step,
        choice: Choice,
        kind: Type,
        found: Mapping[Lookup, Mapping[Any, Selection]],
        wanted: Selection,
        looked: Selection | None = None,
    ) -> None:
        """The steps that look at each element, and those of each one that is chosen."""
        self.add(do, choice)
        choice.body = self._here
        if choice.room is None:
            self._field(kind.element, looked, in_list=True)
            self.add(Step.CHOSEN)
        choice.indexes = {index: self._own(kind, one) for index, one in wanted.indexes.items()}
        for lookup, values in found.items():
            choice.found[lookup] = {value: self._own(kind, one) for value, one in values.items()}
            for value, one in values.items():
                choice.several[lookup, value] = tuple(one.all_paths())
        choice.after = self._here

    def _own(self, kind: Type, wanted: Selection) -> int:
        at = self._here
        self._field(kind.element, wanted)
        self.add(Step.DONE)
        return at


def _keys_beside(inner: Mapping[str, Selection], types: Mapping[str, Type]) -> dict[str, Lookup]:
    """The lists by which elements of others beside them are chosen."""
    keys: dict[str, Lookup] = {}
    for one in inner.values():
        for name, values in one.beside.items():
            keys.setdefault(name, Lookup(types[name].element)).values.update(values)
    return keys


def _inside(node: Selection, path: str) -> Selection:
    for name in path.split("."):
        node = node.fields.setdefault(name, Selection())
    return node


def least_of(element: Type) -> int:
    """The bytes that an element has at the least."""
    return LENGTH + 1 if element.name == "string" else LENGTH if element.name in TEXTS else 1
