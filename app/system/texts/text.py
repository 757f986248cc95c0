"""A sentence as a value: its code and parameters, and other values whose notation depends on the
language.

State holds these values; an edge renders them. An edge is where something leaves for a reader: a page,
an event, a response, a terminal, a ROS log.
"""

import json
import logging
from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from typing import Any, Final, NoReturn, Union

from app.system.printable import readable
from app.system.texts.catalogue import ENGLISH, renamed_codes, sentences, when_changed
from app.system.texts.locales import date_time_in, day_in, number_in, short_day_in, symbols, time_in

log = logging.getLogger("kiosk.i18n")

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
    """The text in a language. A sentence that the catalogue lacks is its code: no page is refused for
    it."""
    return text if isinstance(text, str) else _rendered(text, language)


def rendered_if_known(text: Text, language: str) -> str | None:
    """The text in a language; None for a sentence that the catalogue lacks, or one of another version
    with other parameters."""
    try:
        return readable(_filled(text, language))
    except (KeyError, IndexError, ValueError):
        return None


@lru_cache(maxsize=1024)  # the same few sentences lock and open
def _rendered(text: Text, language: str) -> str:
    if (known := rendered_if_known(text, language)) is not None:
        return known
    log.error("no sentence in %s: %r", language, text)
    return readable(text.code)


when_changed(_rendered.cache_clear)


def _filled(text: Text, language: str) -> str:
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
    return text_from(json.loads(stored))


def text_from(stored: Any) -> Text:
    """The text of what `as_json` returned, with its present code; ValueError if it is not one."""
    if not isinstance(stored, dict) or stored.keys() != {"code", "params"}:
        raise ValueError("it is no sentence with a code and params")
    code = present_code(stored["code"])
    return say(code, **{name: _param_in(param) for name, param in stored["params"].items()})


def _param_in(stored: Any) -> Any:
    if isinstance(stored, dict):
        return text_from(stored)
    return tuple(_param_in(element) for element in stored) if isinstance(stored, list) else stored


# Values whose notation depends on the language: texts of the panel file, numbers, times.


class PanelText(Text):
    """A text of the panel file in several languages. A reader of another language gets the text in
    `own`, the panel's language."""

    __slots__ = ()

    def __init__(self, texts: Mapping[str, str], own: str) -> None:
        """`texts` are by their languages: tags of BCP 47."""
        super().__init__(PANEL, (("", own), *sorted(texts.items())))

    @property
    def own(self) -> str:
        """The panel's language."""
        return str(self.params[0][1])

    @property
    def texts(self) -> Mapping[str, str]:
        """The texts by their languages."""
        return {tag: str(text) for tag, text in self.params[1:]}

    def __str__(self) -> str:
        """In the panel's language, for what has no reader: a log, a fault of the panel file."""
        return render(self, self.own)


def each_language(text: TextLike) -> Mapping[str, str]:
    """A text of the panel file by its languages; one without a language is under ""."""
    return text.texts if isinstance(text, PanelText) else {"": str(text)}


def alike(text: TextLike, other: TextLike) -> bool:
    """Whether two texts of the panel file read the same in a language of either."""
    tags = {*each_language(text), *each_language(other)}
    return any(render(text, tag or ENGLISH) == render(other, tag or ENGLISH) for tag in tags)


def changed(text: str | PanelText, change: Callable[[str], str]) -> str | PanelText:
    """A text of the panel file, changed in each of its languages."""
    if isinstance(text, str):
        return change(text)
    return PanelText({tag: change(translation) for tag, translation in text.texts.items()}, text.own)


def together(parts: Iterable[TextLike]) -> TextLike:
    """Texts joined to one, with nothing between them."""
    shown = tuple(part for part in parts if part != "")
    texts = [part for part in shown if isinstance(part, str)]
    return "".join(texts) if len(texts) == len(shown) else Text(PARTS, (("parts", shown),))


def filled_in(text: PanelText, fill: Callable[[str], TextLike]) -> Text:
    """A text of the panel file, filled in in each of its languages."""
    return Text(
        PANEL, (("", text.own), *((tag, fill(translation)) for tag, translation in text.texts.items()))
    )


def number(text: str, unit: TextLike = "") -> TextLike:
    """A number as Python writes it ("-1,234.5", "1e-07", "NaN"), and its unit. A number that has the
    same notation in all languages is a plain text."""
    if isinstance(unit, str) and not ("." in text or "," in text or "-" in text):
        return f"{text} {unit}" if unit else text
    return Text(NUMBER, (("text", text), ("unit", unit)))


def number_like(*, whole: bool) -> TextLike:
    """An example of how a number is written."""
    return number("1,234" if whole else "1,234.5")


def numbers(texts: Iterable[str], unit: TextLike = "") -> Text:
    """A list of numbers as Python writes them, and their unit."""
    return Text(NUMBERS, (("texts", tuple(texts)), ("unit", unit)))


def after_space(unit: str | PanelText) -> str | PanelText:
    """A unit as it follows a number within a sentence; "" without one."""
    return changed(unit, lambda text: f" {text}") if unit else ""


def with_unit(text: str, unit: str | PanelText) -> TextLike:
    """A text that is not a number, or a list of numbers, followed by the unit if it is not ""."""
    return changed(unit, lambda symbol: f"{text} {symbol}") if unit else text


def time_of_day(at: str) -> Text:
    """A time of day like "14:02:11", or "02:30:07 +01:00" with an offset from UTC."""
    return Text(TIME, (("at", at),))


def date_and_time(at: str) -> Text:
    """A date and a time like "2026-11-21 14:02:11"."""
    return Text(DATE_TIME, (("at", at),))


def named_day(at: str) -> Text:
    """A day like "2026-11-21", by its names."""
    return Text(DAY, (("at", at),))


def short_day(at: str) -> Text:
    """A day like "2026-11-21", by its short names and without the year."""
    return Text(SHORT_DAY, (("at", at),))


def longest(text: TextLike) -> int:
    """The length in characters of a text of the panel file in the language in which it is longest."""
    return max(map(len, each_language(text).values()))
