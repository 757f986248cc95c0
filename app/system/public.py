"""What may leave this machine in a support bundle: values whose type is marked with `Public`, and no
others. A field that is not marked stays out, however it is written: a password has no form of its own.

A marked type is one that can hold no secret, such as an id or the name of a ROS type. Truth values and
the words of a Literal need no mark.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, is_dataclass
from functools import lru_cache
from typing import Annotated, Any, Final, Literal, get_args, get_origin, get_type_hints

LEFT_OUT: Final = "(left out)"
LONGEST: Final = 300  # characters of a value


@dataclass(frozen=True, slots=True)
class Public:
    """In an `Annotated`: values of this type are public. Where values are not checked, as those of
    another program, or where some of them may hold a secret, `form` is what a public one is like."""

    form: str = ""

    def allows(self, value: str | float) -> bool:
        text = str(value)
        return len(text) <= LONGEST and (not self.form or re.fullmatch(self.form, text) is not None)


PUBLIC: Final = Public()
PUBLIC_ENDPOINT: Final = Public(r"(?a:[a-z\-]{2,20}/[\w.:\[\]%\-]{1,200})")  # without settings
PUBLIC_FIELD: Final = Public(r"(?a:[\w.\[\]]+|[a-z]{3,6}\([\w.\[\], ]+\))")  # without text in it
PublicNumber = Annotated[int, PUBLIC]
PublicName = Annotated[str, Public(r"(?a:[A-Za-z_/][\w/]*)?")]  # of a node, topic or service
PublicType = Annotated[str, Public(r"(?a:[a-z]\w*(?:/(?:msg|srv|action))?/[A-Z]\w*)?")]
PublicCode = Annotated[str, Public(r"(?a:[a-z][a-z0-9_]{0,63})?")]  # or the id of a widget
PublicHash = Annotated[str, Public(r"[0-9a-f.\-]{0,80}")]


def public_part(value: Any, hint: Any = None) -> Any:
    """A model, dataclass or named tuple as a table of its fields, LEFT_OUT in place of what is not
    public; of a model those that were set."""
    if is_dataclass(value) or hasattr(value, "model_fields_set") or hasattr(value, "_fields"):
        owner: Any = type(value)
        known = getattr(value, "model_fields_set", None)
        return {
            name: public_part(getattr(value, name), hint)
            for name, hint in hints_of(owner)
            if known is None or name in known
        }
    if isinstance(value, list | tuple):
        return [public_part(inner, hint) for inner in value]
    if value is None or isinstance(value, bool):
        return value
    return value if _is_public(value, hint) else LEFT_OUT


@lru_cache
def hints_of(owner: Any) -> tuple[tuple[str, Any], ...]:
    """(field, its type with marks)."""
    if fields := getattr(owner, "model_fields", None):  # of Pydantic
        return tuple((name, Annotated[f.annotation, None, *f.metadata]) for name, f in fields.items())
    return tuple(get_type_hints(owner, include_extras=True).items())


def _is_public(value: Any, hint: Any) -> bool:
    """Whether each type that the value may be of allows it."""
    if not isinstance(value, str | int | float):
        return False
    marks = [mark for leaf, mark in leaves(hint) if _may_be(value, leaf)]
    return bool(marks) and all(mark is not None and mark.allows(value) for mark in marks)


def _may_be(value: Any, leaf: Any) -> bool:
    if get_origin(leaf) is Literal:
        return value in get_args(leaf)
    return leaf is Any or not isinstance(leaf, type) or isinstance(value, leaf)


def leaves(hint: Any, mark: Public | None = None) -> Iterator[tuple[Any, Public | None]]:
    """(type, its mark) of all types that a hint is made of. A Literal is marked by itself."""
    origin = get_origin(hint)
    if origin is Annotated:
        marks = (about for about in hint.__metadata__ if isinstance(about, Public))
        yield from leaves(get_args(hint)[0], next(marks, mark))
    elif origin is Literal:
        yield hint, PUBLIC
    elif origin is not None:
        for inner in get_args(hint):
            yield from leaves(inner, mark)
    elif hint not in (type(None), ...):
        yield hint, mark
