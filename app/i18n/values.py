"""Values whose notation depends on the language: texts of the panel file, numbers, times."""

from collections.abc import Callable, Iterable, Mapping

from app.i18n.catalogue import ENGLISH
from app.i18n.text import (
    DATE_TIME,
    DAY,
    NUMBER,
    NUMBERS,
    PANEL,
    PARTS,
    SHORT_DAY,
    TIME,
    Text,
    TextLike,
    render,
)


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
