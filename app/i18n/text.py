"""A sentence as a value: its code and parameters. State holds these; an edge renders them.

An edge is where something leaves for a reader: a page, an event, an answer, a terminal, a log of ROS.
"""

import json
from collections.abc import Iterable, Mapping
from typing import Any, Final, NoReturn, Union

from app.i18n.catalogue import ENGLISH, sentences
from app.printable import printable

# Stands in a sentence: a name or a number, which are in no language; another sentence; or several,
# which are listed.
Param = Union[str, int, float, "Text", tuple["TextLike", ...]]

# Codes of what stands between texts that follow one another, with `parts` as the only parameter.
BETWEEN: Final = frozenset({"between_sentences", "between_lines", "between_names"})


class Text:
    """A sentence by its `code` in the catalogue; `params` are (name, value) in the order of names.

    Immutable and hashable; equal where code and parameters are. It says nothing of a language.
    """

    __slots__ = ("_hash", "code", "params")

    code: str
    params: tuple[tuple[str, Param], ...]
    _hash: int

    def __init__(self, code: str, params: tuple[tuple[str, Param], ...] = ()) -> None:
        set_once = object.__setattr__
        set_once(self, "code", code)
        set_once(self, "params", params)
        set_once(self, "_hash", hash((code, params)))

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"{name}: a Text does not change")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Text):
            return NotImplemented
        return self is other or (
            self._hash == other._hash and (self.code, self.params) == (other.code, other.params)
        )

    def __hash__(self) -> int:
        return self._hash

    def __repr__(self) -> str:
        about = "".join(f", {name}={value!r}" for name, value in self.params)
        return f"Text({self.code!r}{about})"

    def __str__(self) -> str:
        """In English, for the server's own log."""
        return render(self)

    def as_json(self) -> dict[str, Any]:
        """As JSON has it: `{"code": …, "params": {…}}`."""
        return {"code": self.code, "params": {name: _as_json(value) for name, value in self.params}}


# What a person reads: a sentence, or a text that is in no language, as labels, names and what a robot
# says are; "" where there is nothing to read.
TextLike = Text | str


def say(code: str, **about: Param) -> Text:
    """The sentence with this code, about these parameters."""
    return Text(code, tuple(sorted(about.items())))


def joined(parts: Iterable[TextLike], between: str = "between_sentences") -> TextLike:
    """Several texts, one after the other, without those that are ""; one alone is itself. `between` is
    the code of what stands between them."""
    given = tuple(part for part in parts if part != "")
    if len(given) > 1:
        return Text(between, (("parts", given),))
    return given[0] if given else ""


def render(text: TextLike, language: str = ENGLISH) -> str:
    """As a reader of this language reads it."""
    return text if isinstance(text, str) else printable(_filled(text, sentences(language)))


def _filled(text: Text, catalogue: Mapping[str, str]) -> str:
    """A KeyError is a mistake of the programmer's: a test finds each code that the catalogue lacks."""
    sentence = catalogue[text.code]
    if text.code in BETWEEN:
        parts = text.params[0][1]
        assert isinstance(parts, tuple)  # as `joined` makes it
        return sentence.join(_written(part, catalogue) for part in parts)
    return sentence.format_map({name: _written(value, catalogue) for name, value in text.params})


def _written(value: Param, catalogue: Mapping[str, str]) -> Any:
    if isinstance(value, Text):
        return _filled(value, catalogue)
    if isinstance(value, tuple):
        return catalogue["between_names"].join(str(_written(one, catalogue)) for one in value)
    return value


def localized(value: Any, language: str) -> Any:
    """The same JSON value with every Text in it rendered."""
    if isinstance(value, Text):
        return render(value, language)
    if isinstance(value, Mapping):
        return {key: localized(one, language) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [localized(one, language) for one in value]
    return value


def _as_json(value: Param) -> Any:
    if isinstance(value, Text):
        return value.as_json()
    return [_as_json(one) for one in value] if isinstance(value, tuple) else value


def text_in(given: str) -> Text:
    """From the JSON of `as_json`; ValueError for what is none."""
    return _text_in(json.loads(given))


def _text_in(given: Any) -> Text:
    if not isinstance(given, dict) or given.keys() != {"code", "params"}:
        raise ValueError("it is no sentence with a code and params")
    return say(given["code"], **{name: _param_in(one) for name, one in given["params"].items()})


def _param_in(given: Any) -> Any:
    if isinstance(given, dict):
        return _text_in(given)
    return tuple(_param_in(one) for one in given) if isinstance(given, list) else given
