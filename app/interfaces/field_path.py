"""Paths to a field: "pose.position.x", "position[2]", "position[name=joint_2]",
"status[name='drive: motor'].level".

    path    = field *("." field)
    field   = name *("[" (number / key "=" value) "]")
    key     = name *("." name)
    value   = text without spaces, quotes, "=" and brackets
            / "'" text "'" / '"' text '"'      (a quote inside is written twice)

In "list[key=value]" the key is a field of the list's elements or, where they have none of this name, a
list beside it whose element at the same place has the value.
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
    "it must be like pose.x, position[2], position[name=joint_2] or status[name='a b'].level"
)


class Key(NamedTuple):
    """Chooses the element of a list by what one of its fields says, or a list beside it."""

    path: str
    value: str


Step = str | int | Key


class _Parsed(NamedTuple):
    steps: tuple[Step, ...]
    parent: str  # the path of the message that the last name is in, "" for the whole


@lru_cache(4096)
def _parse(path: str) -> _Parsed:
    steps: list[Step] = []
    at = last = 0
    while at < len(path) or not steps:
        match = _STEP.match(path, at)
        named = match is not None and match["name"] is not None
        # It begins with a name, and each further one has a dot before it.
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


def path_steps(path: str) -> tuple[Step, ...]:
    """What a path goes through: names, indexes and keys; InterfaceError where it is not written so."""
    return _parse(path).steps


def parent_path(path: str) -> str:
    """The path of the message that has the field, or the list with the element; "" for the whole."""
    return _parse(path).parent


def field_name(path: str) -> str:
    """The last name in a path: that of the field, or of the list with the element."""
    return next(step for step in reversed(path_steps(path)) if isinstance(step, str))
