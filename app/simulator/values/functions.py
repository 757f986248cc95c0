"""Puts fields into a message so that a function of them has a value: the inverse of
`interfaces.field_functions`, as far as one is plausible. Pure."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final

from app.interfaces.cdr.selection import Resolver
from app.interfaces.definitions import zero_value
from app.interfaces.field_path import FieldCall
from app.simulator.values.known_types import NS_PER_S, Moment, time
from app.simulator.values.paths import Fields, Structures, get, put

FEW: Final = 6  # numbers of a list that has none
MOST: Final = 100  # elements of a list of which the length is shown


def put_result(
    fields: Fields, type_name: str, call: FieldCall, value: Any, structures: Structures, moment: Moment
) -> None:
    """Sets the fields of a function, so that its result is a number."""
    resolver = Resolver(structures)
    kind = resolver.type_at(type_name, call.paths[0])
    held = [get(fields, resolver.typed_steps(type_name, path)) for path in call.paths]
    match call.name:
        case "yaw":
            made: Any = {"x": 0.0, "y": 0.0, "z": math.sin(value / 2), "w": math.cos(value / 2)}
        case "norm":
            made = {"x": value}
        case "min" | "max":
            made = _extreme(call.name, held[0], value, kind.size)
        case "length":
            made = [zero_value(kind.element)] * (kind.size or max(0, min(round(value), MOST)))
        case "age":
            made = time(Moment(moment.t, moment.wall_ns - round(value * NS_PER_S)))
        case _:
            made = (held[1] or 0) + value
    put(fields, type_name, call.paths[0], made, structures)


_CHOOSE: Final[Mapping[str, Callable[[Any, Any], Any]]] = {"min": max, "max": min}


def _extreme(name: str, held: Any, value: Any, size: int) -> list[Any]:
    """The list with this least or greatest number."""
    rest = list(held or ()) or [value] * (size or FEW)
    return [value, *(_CHOOSE[name](number, value) for number in rest[1:])]
