"""Paths to a field: "pose.position.x", "position[2]", "position[name=joint_2]",
"status[name='drive: motor'].level".

    path    = field *("." field)
    field   = name *("[" (number / key "=" value) "]")
    key     = name *("." name)
    value   = text without spaces, quotes, "=" and brackets
            / "'" text "'" / '"' text '"'      (a quote inside is written twice)

In "list[key=value]" the key is a field of the list's elements. If they have no field of this name, it
is a list beside it whose element at the same index has the value.

A field may also be a function of fields: "yaw(pose.orientation)", "diff(position[0], position[1])". See
`FUNCTIONS`.
"""

import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, Final, Literal, NamedTuple

from app.ros.messages.definitions import FLOAT_TYPES, INTEGER_RANGES, Structure, Type
from app.system.errors import InterfaceError

_STEP: Final = re.compile(
    r"""(?P<dot>\.?)(?P<name>[A-Za-z][A-Za-z0-9_]*)
    |\[(?P<index>[0-9]{1,9})\]
    |\[(?P<key>[a-z][a-z0-9_.]*)=(?P<value>[^\[\]'"=\s]+|'(?:[^']|'')*'|"(?:[^"]|"")*")\]""",
    re.VERBOSE,
)
EXPECTED: Final = (
    "it must be like pose.x, position[2], position[name=joint_2], status[name='a b'].level or"
    " min(ranges)"
)
_CALL: Final = re.compile(r"\s*(?P<name>[A-Za-z_]\w*)\s*\((?P<paths>.*)\)\s*", re.DOTALL)
# Commas between fields: not those in the text of a key.
_COMMA: Final = re.compile(r",(?=(?:[^'\"]|'[^']*'|\"[^\"]*\")*$)")


class Key(NamedTuple):
    """Selects an element of a list by the value of one of its fields, or of a list beside it. The value
    is a text, as in a path, until its type is known."""

    path: str
    value: str | int


PathStep = str | int | Key


class FieldCall(NamedTuple):
    """A function of fields, as in "min(ranges)"; `text` is all of it."""

    text: str
    name: str
    paths: tuple[str, ...]


class _Parsed(NamedTuple):
    steps: tuple[PathStep, ...]
    parent: str  # the path of the message that contains the last name, "" for the whole message


def _meant(path: str) -> str:
    """What is right instead of arithmetic and wildcards; "" for anything else."""
    if match := re.search(r"\s[*/+-]\s|\d\s*[*/]", path):
        key = "scale" if match[0].strip()[-1] in "*/" else "offset"
        return f"the keys scale and offset compute with a value, such as {key} = 1000"
    if "*" in path:
        return "a field is a single value: name each, or show a list by a table"
    return ""


@lru_cache(4096)
def _parse(path: str) -> _Parsed:
    steps: list[PathStep] = []
    at = last = 0
    while at < len(path) or not steps:
        match = _STEP.match(path, at)
        named = match is not None and match["name"] is not None
        # The path begins with a name; each further name follows a dot.
        if match is None or (not named and not at) or (named and bool(match["dot"]) != (at > 0)):
            raise InterfaceError(f'"{path}" is not a field: {_meant(path) or EXPECTED}')
        if named:
            steps.append(match["name"])
            last = at
        elif match["index"] is not None:
            steps.append(int(match["index"]))
        else:
            steps.append(Key(match["key"], _unquote(match["value"])))
        at = match.end()
    return _Parsed(tuple(steps), path[:last])


def _unquote(text: str) -> str:
    quote = text[0]
    return text[1:-1].replace(quote * 2, quote) if quote in "'\"" else text


@lru_cache(4096)
def field_call(path: str) -> FieldCall | None:
    """The function of fields that a path is; None for the path of one field. InterfaceError if one of
    its fields is malformed."""
    match = _CALL.fullmatch(path)
    if match is None:
        return None
    paths = tuple(part.strip() for part in _COMMA.split(match["paths"]))
    for inner in paths:
        if _CALL.fullmatch(inner):
            raise InterfaceError(f'"{path}": a function is of fields, not of another function')
        path_steps(inner)
    return FieldCall(path, match["name"], paths)


def field_paths(path: str) -> tuple[str, ...]:
    """The path itself, or those of the fields that a function is of."""
    call = field_call(path)
    return (path,) if call is None else call.paths


def path_steps(path: str) -> tuple[PathStep, ...]:
    """The steps of a path: names, indexes and keys; InterfaceError for a malformed path."""
    return _parse(path).steps


def has_key(path: str) -> bool:
    """Whether the path selects an element by a key, whatever its index is in a message."""
    return any(_has_key(inner) for inner in field_paths(path))


def _has_key(path: str) -> bool:
    ordered = (step for step in path_steps(path) if not isinstance(step, str))
    return isinstance(next(ordered, None), Key)


def parent_path(path: str) -> str:
    """The path of the message that contains the field, or the list; "" for the whole message. Of a
    function that of its first field."""
    return _parse(field_paths(path)[0]).parent


def field_name(path: str) -> str:
    """The last name in a path: that of the field, or of the list. Of a function its first field's."""
    steps = path_steps(field_paths(path)[0])
    return next(step for step in reversed(steps) if isinstance(step, str))


# The functions of fields: "yaw(pose.orientation)", "min(ranges)". A small fixed set, computed while a
# message is decoded. Total: where there is no value, the result is an `Absence`, never an error.

Structures = Mapping[str, Structure]
# Why a function has no value: the list has no elements; the quaternion is no rotation; the time is
# zero; it is ahead of the robot's clock; it is of another time, as that of a recording.
Absence = Literal["empty", "no_rotation", "no_time", "other_clock", "other_time"]

TIME: Final = "builtin_interfaces/msg/Time"
ROTATION: Final = 0.1  # by which the squared length of a quaternion may differ from 1
AHEAD_S: Final = 0.1  # a stamp that is further ahead is of another clock
EARLIEST_S: Final = 1_000_000_000.0  # 2001; an earlier time is that of a simulation
SLICE_NUMBERS: Final = 20_000  # compared at once
DEPTH: Final = 3  # how deep a fitting field is looked for
MOST_FITTING: Final = 3  # that are named


class NoValue(NamedTuple):
    """What a function has instead of a value."""

    absence: Absence


class FieldFunction(NamedTuple):
    """One function: what it makes of how many fields, which types they may have, that of the result,
    and the result itself, from the values and the server's clock (seconds since the epoch)."""

    result_text: str
    needs: str
    fits: Callable[[Type, Structures], bool]
    result: Callable[[Sequence[Type]], Type]
    arguments: int = 1


def _is_number(kind: Type, _: Structures) -> bool:
    return kind.container == "one" and (kind.name in INTEGER_RANGES or kind.name in FLOAT_TYPES)


def _is_number_list(kind: Type, structures: Structures) -> bool:
    return kind.container != "one" and _is_number(kind.element, structures)


def _is_list(kind: Type, _: Structures) -> bool:
    return kind.container != "one"


def _is_time(kind: Type, _: Structures) -> bool:
    return str(kind) == TIME


def _has_numbers(kind: Type, structures: Structures, *names: str) -> bool:
    if kind.container != "one" or kind.name not in structures:
        return False
    fields = structures[kind.name].fields
    return [field.name for field in fields] == [*names] and all(
        _is_number(field.type, structures) for field in fields
    )


def _is_quaternion(kind: Type, structures: Structures) -> bool:
    return _has_numbers(kind, structures, "x", "y", "z", "w")


def _is_vector(kind: Type, structures: Structures) -> bool:
    return _has_numbers(kind, structures, "x", "y", "z") or _has_numbers(kind, structures, "x", "y")


def _float(_: Sequence[Type]) -> Type:
    return Type("float64")


def _difference_type(kinds: Sequence[Type]) -> Type:
    whole = all(kind.name in INTEGER_RANGES and kind.name != "uint64" for kind in kinds)
    return Type("int64" if whole else "float64")


NOT_HERE: Final = ("avg", "mean", "sum", "abs", "round")  # functions of other programs, near to none
FUNCTIONS: Final[Mapping[str, FieldFunction]] = {
    "yaw": FieldFunction(
        "the heading in radians, from -π to π", "a quaternion", _is_quaternion, _float
    ),
    "norm": FieldFunction("the length of a vector", "a vector of x, y and z", _is_vector, _float),
    "min": FieldFunction(
        "the least number", "a list of numbers", _is_number_list, lambda kinds: kinds[0].element
    ),
    "max": FieldFunction(
        "the greatest number", "a list of numbers", _is_number_list, lambda kinds: kinds[0].element
    ),
    "length": FieldFunction(
        "how many elements there are", "a list", _is_list, lambda _: Type("uint32")
    ),
    "age": FieldFunction(
        "how many seconds old a time was when its message arrived", f"a {TIME}", _is_time, _float
    ),
    "diff": FieldFunction(
        "the first number without the second", "two numbers", _is_number, _difference_type, 2
    ),
}


def function(call: FieldCall) -> FieldFunction:
    """The function of a call; InterfaceError for an unknown one, or another number of fields."""
    known = FUNCTIONS.get(call.name)
    if known is None:
        near = [] if call.name in NOT_HERE else get_close_matches(call.name, FUNCTIONS, n=1)
        hint = f'did you mean "{near[0]}"?' if near else f"there is {', '.join(FUNCTIONS)}"
        raise InterfaceError(f'"{call.name}" (in "{call.text}") is no function of fields; {hint}')
    if len(call.paths) != known.arguments:
        right = "diff(a, b)" if known.arguments > 1 else f"{call.name}(a)"
        raise InterfaceError(f'"{call.text}": {call.name} is of {known.needs}, like {right}')
    return known


def result_type(call: FieldCall, kinds: Sequence[Type], whole: Type, structures: Structures) -> Type:
    """The type of a call's result; InterfaceError if a field has a type that the function is not for.
    `whole` is the type in which its fields are."""
    known = function(call)
    for path, kind in zip(call.paths, kinds, strict=True):
        if not known.fits(kind, structures):
            fitting = list(_fitting(known, whole, structures, "", DEPTH))
            names = ", ".join(fitting[:MOST_FITTING])
            has = f"; {whole} has {names}" if names else f", which {whole} does not have"
            raise InterfaceError(f'"{path}" is {kind}: {call.name}() is of {known.needs}{has}')
    return known.result(kinds)


def _fitting(
    known: FieldFunction, whole: Type, structures: Structures, before: str, depth: int
) -> Iterator[str]:
    """The paths of fields that the function is for."""
    if not depth or whole.container != "one" or whole.name not in structures:
        return
    for field in structures[whole.name].fields:
        if known.fits(field.type, structures):
            yield f"{before}{field.name}"
        yield from _fitting(known, field.type, structures, f"{before}{field.name}.", depth - 1)


def computed(name: str, values: Sequence[Any], received: float) -> Iterator[Any]:
    """The result as the last item, with None after each slice before it. `received` is when the message
    arrived, in seconds, by the clock that its stamps are of; NaN if that is not known."""
    if any(value is None for value in values):
        yield None
    elif name in ("min", "max"):
        yield from _extreme(min if name == "min" else max, values[0])
    elif name == "diff":
        yield _difference(values[0], values[1])
    elif name == "age":
        yield _age(values[0], received)
    elif name == "yaw":
        yield _yaw(values[0])
    elif name == "norm":
        yield _norm(values[0])
    else:
        yield values[0]


def _extreme(choose: Callable[[Any], Any], numbers: Any) -> Iterator[Any]:
    """NaN if one of them is NaN: it may be the least."""
    if not len(numbers):
        yield NoValue("empty")
        return
    chosen: list[Any] = []
    for begin in range(0, len(numbers), SLICE_NUMBERS):
        if chosen:
            yield None
        part = numbers[begin : begin + SLICE_NUMBERS].tolist()
        total = sum(part)  # NaN also of both infinities
        if total != total and any(number != number for number in part):
            yield math.nan
            return
        chosen.append(choose(part))
    yield choose(chosen)


def _difference(first: float, second: float) -> float:
    return first - second


def _yaw(q: Any) -> float | NoValue:
    square = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w
    if math.isnan(square):
        return math.nan
    if abs(square - 1) > ROTATION:
        return NoValue("no_rotation")
    return math.atan2(2 * (q.w * q.z + q.x * q.y), q.w**2 + q.x**2 - q.y**2 - q.z**2)


def _norm(vector: Any) -> float:
    parts = [getattr(vector, name) for name in ("x", "y", "z") if hasattr(vector, name)]
    return math.nan if any(part != part for part in parts) else math.hypot(*parts)


def _age(stamp: Any, received: float) -> float | NoValue:
    seconds: float = stamp.sec + stamp.nanosec / 1e9
    if not seconds:
        return NoValue("no_time")
    if math.isnan(received) or (seconds < EARLIEST_S <= received):
        return NoValue("other_time")
    age = received - seconds
    return NoValue("other_clock") if age < -AHEAD_S else max(age, 0.0)
