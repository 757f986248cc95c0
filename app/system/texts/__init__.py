"""The texts that a person reads: a sentence is a code with parameters until it is rendered in a
reader's language.

Codes are stable names for tests and logs; `catalogue` has the sentences of each language by code.
"""

from app.system.texts.catalogue import ENGLISH, sentences
from app.system.texts.text import (
    BETWEEN,
    PanelText,
    Param,
    Text,
    TextLike,
    date_and_time,
    ended,
    hint,
    joined,
    localized,
    named_day,
    number,
    present_code,
    render,
    rendered_if_known,
    say,
    short_day,
    text_in,
    time_of_day,
)

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
    "rendered_if_known",
    "say",
    "sentences",
    "short_day",
    "text_in",
    "time_of_day",
]
