"""Scans a message for selected fields, without building the rest.

A long message is scanned in slices of some hundred elements. The whole message is scanned, so that one
that is too short or too long is detected.
"""

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from app.interfaces.cdr.formats import LENGTH_BYTES
from app.interfaces.cdr.layout import PHASES, end_offset
from app.interfaces.cdr.reader import NATIVE, ByteOrder, Read
from app.interfaces.cdr.selection import Lookup
from app.interfaces.cdr.steps import Choice, Mark, Op, ScanStep
from app.interfaces.definitions import Type

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
