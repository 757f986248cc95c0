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
`field_functions`.
"""

import re
from functools import lru_cache
from typing import Final, NamedTuple

from app.errors import InterfaceError

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


@lru_cache(4096)
def _parse(path: str) -> _Parsed:
    steps: list[PathStep] = []
    at = last = 0
    while at < len(path) or not steps:
        match = _STEP.match(path, at)
        named = match is not None and match["name"] is not None
        # The path begins with a name; each further name follows a dot.
        if match is None or (not named and not at) or (named and bool(match["dot"]) != (at > 0)):
            raise InterfaceError(f'"{path}" is not a field: {EXPECTED}')
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
