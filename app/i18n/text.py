"""A sentence as a value: its code and parameters. State holds these; an edge renders them.

An edge is where something leaves for a reader: a page, an event, an answer, a terminal, a log of ROS.
Texts of the panel file in several languages, numbers and times are such values too (`app.i18n.values`):
their codes are in no catalogue, and each language writes them in its own way.
"""

import json
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any, Final, NoReturn, Union

from app.i18n.catalogue import ENGLISH, renamed_codes, sentences, when_changed
from app.i18n.locales import date_time_in, day_in, number_in, short_day_in, symbols, time_in
from app.printable import readable

# Stands in a sentence: a name or a number, which are in no language; another sentence; or several,
# which are listed.
Param = Union[str, int, float, "Text", tuple["TextLike", ...]]

# Codes of how two texts that follow one another are written, such as "{first}, {last}"; a Text of them
# has `parts` as its only parameter. A pattern, because Japanese has nothing between sentences, and
# gettext takes an empty sentence for a missing one.
BETWEEN: Final = frozenset({"between_sentences", "between_lines", "between_names"})
# Codes of what is no sentence; none of a catalogue begins so.
PANEL, PARTS, TIME, DATE_TIME = "=panel", "=parts", "=time", "=date_time"
DAY, SHORT_DAY = "=day", "=short_day"
NUMBER, NUMBERS = "=number", "=numbers"
ENDED = "=ended"
ENDS: Final = (".", "!", "?", "…", ":", "。", "！", "？", "：")  # of sentences


class Text:
    """A sentence by its `code` in the catalogue; `params` are (name, value) in the order of names.

    Immutable and hashable; equal if code and parameters are. It has no language.
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

    @property
    def is_sentence(self) -> bool:
        """Whether it is a sentence of the catalogue, or several joined."""
        return self.code not in _WRITERS

    def as_json(self) -> dict[str, Any]:
        """As a JSON value: `{"code": …, "params": {…}}`."""
        return {"code": self.code, "params": {name: _as_json(value) for name, value in self.params}}


# What a person reads: a sentence or another value that each language writes in its own way, or a text
# that is in no language, as names and what a robot says are; "" where there is nothing to read.
TextLike = Text | str


def say(code: str, **about: Param) -> Text:
    """The sentence with this code and these parameters."""
    return Text(code, tuple(sorted(about.items())))


def hint(code: str) -> TextLike:
    """The sentence with this code; "" for none."""
    return say(code) if code else ""


def joined(parts: Iterable[TextLike], between: str = "between_sentences") -> TextLike:
    """Texts in sequence, without those that are ""; a single one is returned as it is. `between` is the
    code of the pattern that joins two of them."""
    texts = tuple(part for part in parts if part != "")
    if len(texts) > 1:
        return Text(between, (("parts", texts),))
    return texts[0] if texts else ""


def ended(text: TextLike) -> TextLike:
    """The text as a sentence that another follows: one of the panel file may lack its full stop."""
    is_plain = isinstance(text, Text) and text.is_sentence
    return text if is_plain or text == "" else Text(ENDED, (("said", text),))


def render(text: TextLike, language: str = ENGLISH) -> str:
    """The text in a language."""
    return text if isinstance(text, str) else _rendered(text, language)


@lru_cache(maxsize=1024)  # the same few sentences lock and open
def _rendered(text: Text, language: str) -> str:
    return readable(_filled(text, language))


when_changed(_rendered.cache_clear)


def _filled(text: Text, language: str) -> str:
    """A KeyError is a programming error: a test finds each code that the catalogue lacks."""
    code = text.code
    if code in _WRITERS:
        return _WRITERS[code](dict(text.params), language)
    sentence = sentences(language)[code]
    if code in BETWEEN:
        parts = text.params[0][1]
        assert isinstance(parts, tuple)  # as `joined` makes it
        return _in_a_row(parts, sentence, language)
    return sentence.format_map({name: _written(value, language) for name, value in text.params})


def _written(value: Param, language: str) -> Any:
    if isinstance(value, Text):
        return _filled(value, language)
    if isinstance(value, tuple):
        return _in_a_row(value, sentences(language)["between_names"], language)
    return number_in(repr(value), language) if isinstance(value, float) else value


def _in_a_row(parts: Iterable[Param], pattern: str, language: str) -> str:
    between = pattern.format(first="", last="")
    return between.join(str(_written(part, language)) for part in parts)


def _panel_text(params: Mapping[str, Any], language: str) -> str:
    """A text of the panel file in this language, else in the panel's own, whose tag is under ""."""
    others = (text for tag, text in params.items() if tag)
    chosen = params.get(language) or params.get(params[""]) or next(others)
    return str(_written(chosen, language))


def _parts(params: Mapping[str, Any], language: str) -> str:
    return "".join(str(_written(part, language)) for part in params["parts"])


def _ended(params: Mapping[str, Any], language: str) -> str:
    said = str(_written(params["said"], language)).rstrip()
    return said if said.endswith(ENDS) else sentences(language)["with_stop"].format(said=said)


def _number(params: Mapping[str, Any], language: str) -> str:
    text = number_in(params["text"], language)
    return f"{text} {_written(unit, language)}" if (unit := params["unit"]) else text


def _numbers(params: Mapping[str, Any], language: str) -> str:
    between = "; " if symbols(language).decimal == "," else ", "
    text = between.join(number_in(value, language) for value in params["texts"])
    return f"{text} {_written(unit, language)}" if (unit := params["unit"]) else text


_WRITERS: Final[Mapping[str, Callable[[Mapping[str, Any], str], str]]] = {
    PANEL: _panel_text,
    PARTS: _parts,
    NUMBER: _number,
    NUMBERS: _numbers,
    ENDED: _ended,
    TIME: lambda params, language: time_in(params["at"], language),
    DAY: lambda params, language: day_in(params["at"], language),
    SHORT_DAY: lambda params, language: short_day_in(params["at"], language),
    DATE_TIME: lambda params, language: date_time_in(params["at"], language),
}


def localized(value: Any, language: str) -> Any:
    """The same JSON value with every Text in it rendered."""
    if isinstance(value, str):  # most are
        return value
    if isinstance(value, dict):
        return {key: localized(item, language) for key, item in value.items()}
    if isinstance(value, Text):
        return _rendered(value, language)
    if isinstance(value, list | tuple):
        return [localized(element, language) for element in value]
    return value


def _as_json(value: Param) -> Any:
    if isinstance(value, Text):
        return value.as_json()
    return [_as_json(element) for element in value] if isinstance(value, tuple) else value


def present_code(stored: str) -> str:
    """The present code of a sentence that was stored with a code that may have been renamed since."""
    return renamed_codes().get(stored, stored)


def text_in(stored: str) -> Text:
    """The text in JSON of `as_json`, with its present code; ValueError if it is not one."""
    return _text_in(json.loads(stored))


def _text_in(stored: Any) -> Text:
    if not isinstance(stored, dict) or stored.keys() != {"code", "params"}:
        raise ValueError("it is no sentence with a code and params")
    code = present_code(stored["code"])
    return say(code, **{name: _param_in(param) for name, param in stored["params"].items()})


def _param_in(stored: Any) -> Any:
    if isinstance(stored, dict):
        return _text_in(stored)
    return tuple(_param_in(element) for element in stored) if isinstance(stored, list) else stored
