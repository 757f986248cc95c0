"""Plausible messages of any type: each is made for a moment, from its type alone.

Fields that belong together are those of `known_types.py`; each other field moves by its name and type.
"""

from collections.abc import Callable, Collection, Mapping
from typing import Any, Final

from app.interfaces import INTEGER_RANGES, PLACEHOLDER, Interfaces, Structure, Type
from app.interfaces.definitions import FLOAT_TYPES, Field
from app.simulator.values.guesses import PHRASES, guessed
from app.simulator.values.known_types import KNOWN, Fields, Moment
from app.simulator.values.signals import Signal, cycle, phase_of, swing

Message = Callable[[Moment], Fields]
Part = Callable[[Moment], Any]

DEEPEST: Final = 5  # structures in structures
LENGTH: Final = 6  # numbers of a sequence without a bound
FEW: Final = 3  # structures of a sequence


def plausible(type_name: str, interfaces: Interfaces, wanted: Collection[str] = ()) -> Message:
    """Messages of a type; `wanted` are the names that a panel looks for in lists of the message."""
    return _message(interfaces.structures[type_name], interfaces.structures, tuple(wanted), 0)


def _message(
    structure: Structure, structures: Mapping[str, Structure], wanted: tuple[str, ...], depth: int
) -> Message:
    known = KNOWN.get(structure.name)
    if known is not None:
        return lambda moment: known(moment, wanted)
    parts: dict[str, Part] = {}
    for field in structure.fields if depth < DEEPEST else ():
        part = _part(field, structure, structures, wanted, depth)
        if part is not None:
            parts[field.name] = part
    return lambda moment: {name: part(moment) for name, part in parts.items()}


def _part(
    field: Field,
    structure: Structure,
    structures: Mapping[str, Structure],
    wanted: tuple[str, ...],
    depth: int,
) -> Part | None:
    """One field; None where its default is as good."""
    kind = field.type
    if field.name == PLACEHOLDER or field.name in ("layout", "uuid"):
        return None
    if kind.is_nested:
        inner = _message(structures[kind.name], structures, wanted, depth + 1)
        if kind.container == "one":
            return inner
        size = kind.size if kind.container == "array" else min(FEW, kind.size or FEW)
        if depth + 1 >= DEEPEST:
            return None if kind.container == "sequence" else lambda _: [{}] * size
        return lambda moment: [inner(moment) for _ in range(size)]
    if kind.container != "one":
        return _several(field.name, kind)
    constants = field_constants(field.name, structure)
    signal: Signal
    if constants and kind.name in INTEGER_RANGES:
        signal = cycle(constants, phase=phase_of(field.name))
    else:
        signal = guessed(kind.name, kind.bound, field.name)
    return lambda moment: signal(moment.t)


def _several(name: str, kind: Type) -> Part | None:
    """A list of base types. A fixed one, such as a covariance, stays at zero."""
    if kind.container == "array":
        return None
    size = min(LENGTH, kind.size or LENGTH)
    if kind.name in FLOAT_TYPES:
        signals = [swing(-1, 1, phase=phase_of(f"{name}{i}")) for i in range(size)]
        return lambda moment: [signal(moment.t) for signal in signals]
    if kind.name in INTEGER_RANGES:
        return lambda moment: [(i + int(moment.t)) % 100 for i in range(size)]
    if kind.name == "bool":
        return lambda moment: [(i + int(moment.t / 5)) % FEW == 0 for i in range(size)]
    words = [text[: kind.bound or None] for text in PHRASES[: min(FEW, size)]]
    return lambda _: list(words)


def field_constants(name: str, structure: Structure) -> list[Any]:
    """The values of the constants that begin with a field's name, each once."""
    prefix = f"{name}_".upper()
    values = (value for constant, value in structure.constants.items() if constant.startswith(prefix))
    return list(dict.fromkeys(values))
