"""The texts that a person reads: a sentence is a code with parameters until it is rendered in a
reader's language.

Codes are stable names for tests and logs; `catalogue` has the sentences of each language by code.
"""

from app.i18n.catalogue import ENGLISH, sentences
from app.i18n.text import (
    BETWEEN,
    Param,
    Text,
    TextLike,
    ended,
    hint,
    joined,
    localized,
    present_code,
    render,
    say,
    text_in,
)
from app.i18n.values import PanelText, date_and_time, named_day, number, short_day, time_of_day

__all__ = [
    "BETWEEN",
    "ENGLISH",
    "PanelText",
    "Param",
    "Text",
    "TextLike",
    "date_and_time",
    "ended",
    "hint",
    "joined",
    "localized",
    "named_day",
    "number",
    "present_code",
    "render",
    "say",
    "sentences",
    "short_day",
    "text_in",
    "time_of_day",
]
