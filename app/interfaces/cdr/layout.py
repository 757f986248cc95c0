"""The sizes of fixed-size fields in CDR, to skip them by arithmetic.

A field is padded to its alignment, so its size depends on its offset modulo eight. `PaddedSizes` has
the bytes, with padding, for each of these.
"""

from collections.abc import Callable, Iterable
from typing import Final

from app.interfaces.cdr.formats import SIZES, is_number
from app.interfaces.definitions import Field, Type

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
