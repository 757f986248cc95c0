"""Rendering of texts within any value, and what a reason says without its wording."""

from typing import Any

from app.cell.commands.receipts import ADVICE, FRAMES
from app.system.texts import BETWEEN, Text, TextLike, localized, render


def english(value: Any) -> Any:
    """The same value with every `Text` in it rendered in English."""
    if isinstance(value, Text):
        return render(value)
    if isinstance(value, tuple):
        return tuple(english(element) for element in value)
    if isinstance(value, set | frozenset):
        return {english(element) for element in value}
    return (
        [english(element) for element in value] if isinstance(value, list) else localized(value, "en")
    )


def why(reason: TextLike | None) -> TextLike:
    """The sentence that says why, without what frames it and what follows."""
    if not isinstance(reason, Text):
        return reason or ""
    about: dict[str, Any] = dict(reason.params)
    if reason.code in BETWEEN:
        return why([part for part in about["parts"] if getattr(part, "code", "") not in ADVICE][-1])
    framed = about.get(FRAMES.get(reason.code, ""))
    return why(framed) if framed else reason


def coded(reason: TextLike | None, *names: str) -> tuple[Any, ...]:
    """The code of the sentence that says why ("" for what is none), and some of its parameters in
    English; None for one that it does not have."""
    sentence = why(reason)
    if not isinstance(sentence, Text):
        return ("", *(None for _ in names))
    about: dict[str, Any] = dict(sentence.params)
    return (sentence.code, *(english(about.get(name)) for name in names))
