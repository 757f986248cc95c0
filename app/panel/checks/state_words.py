"""Notes about interlocks of the field of `[state]` whose `locked` text is the word of another state.

Only what is certain: no interlock of another field is judged, and no text that says more than a word.
"""

from collections.abc import Iterator
from typing import Any, Final

from app.panel.condition import Interlock
from app.panel.model import Panel
from app.panel.values import same_value
from app.panel.widgets.displays import LampState
from app.system.errors import Note
from app.system.texts.text import each_language

ALREADY: Final = frozenset({"already", "bereits", "schon"})  # beside the word of a state


def state_word_notes(panel: Panel) -> Iterator[Note]:
    """Each interlock that locks in a state by the word of another one."""
    if panel.state is None:
        return
    states, key = panel.state.states, (panel.state.topic, panel.state.field)
    for number, interlock in enumerate(panel.interlocks):
        if (interlock.topic, interlock.field) == key and interlock.locked is not None:
            locking = [state for state in states if not _permits(interlock, state.value)]
            for tag, text in each_language(interlock.locked).items():
                said = [state for state in states if _word(text) in _words(state, tag)]
                wrong = next((state for state in locking if said and state not in said), None)
                if wrong is not None:
                    message = (
                        f'locks in the state {wrong.value} too, and then says "{text}", '
                        f"which is the state {said[0].value}: give that state an interlock of its own"
                    )
                    yield Note(f"interlock[{number}].locked", message)
                    break


def _permits(interlock: Interlock, value: Any) -> bool:
    comparisons = interlock.comparisons
    if not {"equals", "not_equals", "one_of"} & comparisons.keys():
        return True  # limits of a number: not judged
    return (
        ("equals" not in comparisons or same_value(value, comparisons["equals"]))
        and ("not_equals" not in comparisons or not same_value(value, comparisons["not_equals"]))
        and any(same_value(value, other) for other in comparisons.get("one_of", (value,)))
    )


def _words(state: LampState, tag: str) -> set[str]:
    texts = each_language(state.text)
    return {_word(texts.get(tag, "")), _word(texts.get("", "")), _word(str(state.value))} - {""}


def _word(text: str) -> str:
    """A text without its end and "already"."""
    parts = text.casefold().rstrip(".。!").split()
    return " ".join(part for part in parts if part not in ALREADY)
