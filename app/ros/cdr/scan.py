"""Scans a message for selected fields, without decoding the rest."""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum, auto
from typing import Any, Final

from app.ros.cdr.reader import LENGTH_BYTES, NATIVE, SIZES, ByteOrder, Read, is_number
from app.ros.cdr.selection import Lookup, Selection
from app.ros.messages.definitions import STRING_TYPES, Field, Type

# The sizes of fixed-size fields in CDR, to skip them by arithmetic.
#
# A field is padded to its alignment, so its size depends on its offset modulo eight. `PaddedSizes` has
# the bytes, with padding, for each of these.

PaddedSizes = tuple[int, ...]  # eight numbers
FieldsOf = Callable[[str], Iterable[Field]]  # those of a structure

PHASES: Final = 8  # the largest alignment
NO_SIZE: Final[PaddedSizes] = (0,) * PHASES


def padded_sizes(kind: Type, fields: FieldsOf) -> PaddedSizes | None:
    """The padded sizes of a field; None if it has no fixed size."""
    if kind.container == "sequence":
        return None
    if is_number(kind):
        size, count = SIZES[kind.name], kind.size if kind.container == "array" else 1
        return tuple(-phase % size + size * count for phase in range(PHASES))
    sizes = (
        combined_sizes((part.type for part in fields(kind.name)), fields) if kind.is_nested else None
    )
    if sizes is None or kind.container == "one":
        return sizes
    return tuple(end_offset(sizes, phase, kind.size) - phase for phase in range(PHASES))


def combined_sizes(kinds: Iterable[Type], fields: FieldsOf) -> PaddedSizes | None:
    """The padded sizes of consecutive fields; None if one has no fixed size."""
    whole = NO_SIZE
    for kind in kinds:
        room = padded_sizes(kind, fields)
        if room is None:
            return None
        whole = concatenated(whole, room)
    return whole


def concatenated(sizes: PaddedSizes, next_sizes: PaddedSizes) -> PaddedSizes:
    return tuple(
        size + next_sizes[(phase + size) % PHASES]
        for phase, size in zip(range(PHASES), sizes, strict=True)
    )


def end_offset(room: PaddedSizes, at: int, count: int) -> int:
    """The end offset of `count` consecutive elements that begin at `at`. The padding repeats after
    eight elements at most."""
    starts: dict[int, int] = {}  # phase → how many elements were before the one that began with it
    ends: list[int] = []
    for number in range(count):
        if (before := starts.get(at % PHASES)) is not None:
            lap = number - before
            laps, rest = divmod(count - number, lap)
            at += laps * (at - ends[before])
            return end_offset(room, at, rest)
        starts[at % PHASES] = number
        ends.append(at)
        at += room[at % PHASES]
    return at


# The steps of a scan: skip fields that are not selected, mark those that are.
#
# A program is a flat list of steps, so that a scan can stop anywhere and continue later.


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


# Scans a message for selected fields, without building the rest.
#
# A long message is scanned in slices of some hundred elements. The whole message is scanned, so that
# one that is too short or too long is detected.

ReaderFor = Callable[[Type], Read]
Hits = dict[Any, list[tuple[int, int]]]  # a key's value → (index, offset) of the elements that have it
Position = tuple[int, int]  # (offset, step) to continue at

SLICE_ELEMENTS: Final = 100  # elements
MAX_HITS: Final = 2  # of one key: two are ambiguous

# The most frequent steps.
TEXT: Final = ScanStep.TEXT
PASS: Final = ScanStep.PASS
NEXT: Final = ScanStep.NEXT
NUMBERS: Final = ScanStep.NUMBERS
EACH: Final = ScanStep.EACH
CHOSEN: Final = ScanStep.CHOSEN
END: Final = ScanStep.END


@dataclass(slots=True)
class _ListScan:
    """A list whose elements are scanned; the element `index` begins at the offset `start`. Then the
    `chosen` ones are read (offset, step), and the scan continues at `resume`."""

    choice: Choice
    indexes: Mapping[int, int]
    count: int
    start: int
    resume: int | None
    index: int = 0
    chosen: list[Position] = field(default_factory=list)

    def mark_if_chosen(self) -> None:
        if (step := self.indexes.get(self.index)) is not None:
            self.chosen.append((self.start, step))


class Scan:
    """A scan of one message. `at` is the current offset, finally that of the message's end. `marks` are
    the offsets of the selected fields, `ambiguous` the paths whose key several elements have."""

    __slots__ = (
        "_body", "_counts", "_hits", "_loops", "_ops", "_reader", "_step", "_words", "ambiguous", "at",
        "marks", "rows",
    )  # fmt: skip

    def __init__(
        self, ops: Sequence[Op], body: "memoryview[int]", order: ByteOrder, reader: ReaderFor
    ) -> None:
        self._ops = ops
        self._body = body
        self._words = _as_words(body, order)
        self._reader = reader
        self._loops: list[Any] = []  # remaining elements, or `_ListScan`
        self._hits: dict[Lookup, Hits] = {}
        self._counts: dict[Lookup, int] = {}
        self._step = 0
        self.at = 0
        self.marks: dict[Mark, int] = {}
        self.rows: list[dict[Mark, int]] = []  # the marks of each element since they were taken
        self.ambiguous: set[str] = set()

    def advance(self) -> bool:
        """Scans a slice; returns whether the message is complete. ValueError or IndexError if the bytes
        are no such message."""
        ops, body, words, loops = self._ops, self._body, self._words, self._loops
        at, step = self.at, self._step
        left = SLICE_ELEMENTS
        while left:
            do, operand, other = ops[step]
            step += 1
            if do is TEXT:
                at = (at + 3) & -LENGTH_BYTES
                size = words[at >> 2]
                at += LENGTH_BYTES + size
                if not size or body[at - 1]:
                    raise ValueError(f"a text that ends at {at} is cut off or has no end")
            elif do is PASS:
                at += operand[at % PHASES]
            elif do is NUMBERS:
                at = (at + 3) & -LENGTH_BYTES
                if count := words[at >> 2]:
                    at = (at + LENGTH_BYTES + operand - 1) & -operand
                    at += count * operand
                else:
                    at += LENGTH_BYTES
            elif do is EACH:
                count, at = self._read_count(at, other)
                if count:
                    loops.append(count)
                else:
                    step = operand
            elif do is NEXT:
                if loops[-1] > 1:
                    loops[-1] -= 1
                    step = operand
                else:
                    loops.pop()
                left -= 1
            elif do is CHOSEN:
                at, step = self._next_element(at)
                left -= 1
            elif do is END:
                self.at = at
                return True
            else:
                at, step = HANDLERS[do](self, at, step, operand)
        self.at, self._step = at, step
        return False

    def _read_count(self, at: int, least: int) -> tuple[int, int]:
        """(number of elements, offset of the first); ValueError if there are not enough bytes."""
        at = (at + 3) & -LENGTH_BYTES
        count = self._words[at >> 2]
        at += LENGTH_BYTES
        if count * least > len(self._body) - at:
            raise ValueError(f"{count} elements at {at} are more than there are")
        return count, at

    def _skip_wstring(self, at: int, step: int, _: None) -> Position:
        count, at = self._read_count(at, LENGTH_BYTES)
        return at + count * LENGTH_BYTES, step

    def _skip_bool(self, at: int, step: int, _: None) -> Position:
        if self._body[at] > 1:
            raise ValueError(f"a bool is {self._body[at]}, not 0 or 1")
        return at + 1, step

    def _skip_fixed_size(self, at: int, step: int, room: Any) -> Position:
        count, at = self._read_count(at, 1)
        return end_offset(room, at, count), step

    def _begin_array(self, at: int, step: int, count: int) -> Position:
        self._loops.append(count)
        return at, step

    def _mark(self, at: int, step: int, mark: Mark) -> Position:
        self.marks[mark] = at
        return at, step

    def _end_row(self, at: int, step: int, _: None) -> Position:
        self.rows.append(self.marks)
        self.marks = {}
        self._hits.clear()
        self._counts.clear()
        return at, step

    # Elements of lists.

    def _compare(self, at: int, step: int, key: Lookup) -> Position:
        value = self._key_value(at, key)
        if value in key.values:
            looking = self._loops[-1]
            hits = self._hits.setdefault(key, {}).setdefault(value, [])
            if len(hits) < MAX_HITS:
                hits.append((looking.index, looking.start))
        return at, step

    def _key_value(self, at: int, key: Lookup) -> Any:
        if key.type.name != "string":
            return self._reader(key.type)(self._body, at)[0]
        at = (at + 3) & -LENGTH_BYTES
        end = at + LENGTH_BYTES + self._words[at >> 2]
        if end - at not in key.sizes:
            return None
        return key.texts.get(bytes(self._body[at + LENGTH_BYTES : end]))

    def _choose(self, at: int, _: int, choice: Choice) -> Position:
        return self._begin_list(at, choice, choice.indexes)

    def _begin_list(
        self, at: int, choice: Choice, indexes: Mapping[int, int], resume: int | None = None
    ) -> Position:
        count = choice.count
        if count is None:
            count, at = self._read_count(at, choice.min_size)
        if choice.lookup is not None:
            self._counts[choice.lookup] = count
        looking = _ListScan(choice, indexes, count, at, resume)
        self._loops.append(looking)
        if (room := choice.sizes) is not None:
            looking.chosen = [(end_offset(room, at, i), s) for i, s in indexes.items() if i < count]
            return self._end_list(end_offset(room, at, count))
        if not count:
            return self._end_list(at)
        looking.mark_if_chosen()
        return at, choice.body

    def _next_element(self, at: int) -> Position:
        looking: _ListScan = self._loops[-1]
        looking.index += 1
        if looking.index == looking.count:
            return self._end_list(at)
        looking.start = at
        looking.mark_if_chosen()
        return at, looking.choice.body

    def _end_list(self, at: int) -> Position:
        """All elements were scanned: chooses those with the keys."""
        looking: _ListScan = self._loops[-1]
        if looking.resume is None:
            looking.resume = at
        if looking.choice.mark is None:
            for key in looking.choice.by_lookup:
                chosen = self._elements_by_key(key, looking.choice)
                looking.chosen += [(place, step) for _, place, step in chosen]
        return self._next_chosen(at, 0, None)

    def _next_chosen(self, _at: int, _step: int, _: None) -> Position:
        """The next chosen element, or the end of the list."""
        looking: _ListScan = self._loops[-1]
        if looking.chosen:
            return looking.chosen.pop()
        self._loops.pop()
        assert looking.resume is not None
        return looking.resume, looking.choice.after

    def _choose_by_sibling(self, at: int, _: int, choice: Choice) -> Position:
        """Chooses elements of a list by the values of a list beside it, which must have the same
        length."""
        assert choice.key is not None
        assert choice.mark is not None
        indexes = {index: step for index, _, step in self._elements_by_key(choice.key, choice)}
        place = self.marks[choice.mark]
        count = self._read_count(place, choice.min_size)[0] if choice.count is None else choice.count
        if not indexes or count != self._counts[choice.key]:
            return at, choice.after
        return self._begin_list(place, choice, indexes, at)

    def _elements_by_key(self, key: Lookup, choice: Choice) -> list[tuple[int, int, int]]:
        """(index, offset, step) of each element that is the only one with its key."""
        chosen = []
        hits = self._hits.get(key, {})
        for value, step in choice.by_lookup[key].items():
            having = hits.get(value, [])
            if len(having) == 1:
                chosen.append((*having[0], step))
            elif having:
                self.ambiguous.update(choice.ambiguous_paths[key, value])
        return chosen


HANDLERS: Final[Mapping[ScanStep, Callable[[Scan, int, int, Any], Position]]] = {
    ScanStep.WIDE_TEXT: Scan._skip_wstring,
    ScanStep.BOOL: Scan._skip_bool,
    ScanStep.ALIKE: Scan._skip_fixed_size,
    ScanStep.TIMES: Scan._begin_array,
    ScanStep.NOTE: Scan._mark,
    ScanStep.ROW: Scan._end_row,
    ScanStep.COMPARE: Scan._compare,
    ScanStep.CHOOSE: Scan._choose,
    ScanStep.BESIDE: Scan._choose_by_sibling,
    ScanStep.DONE: Scan._next_chosen,
}


def _as_words(body: "memoryview[int]", order: ByteOrder) -> Sequence[int]:
    """The message as 32-bit words: any of them may be a length."""
    whole = body[: len(body) & -LENGTH_BYTES]
    if order == NATIVE:
        return whole.cast("I")
    turned = array("I", whole.tobytes())
    turned.byteswap()
    return turned
