"""What the reference says of tables and keys, in the language of who edits. Each catalogue has its
sentences by the English ones; what it lacks stays English. Only the editor loads them."""

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Final

from app.system.texts.catalogue import translations

LINK: Final = re.compile(r"\[([^\]]*)\]\([^)]*\)")  # of Markdown
TABLE: Final = re.compile(r"(?<!\w)\[\[?([a-z_]+)\]\]?")  # as a TOML file has it
BETWEEN: Final = "\n\n"  # the texts of a key that says several things


def plain_words(text: str) -> str:
    """A text of the reference without its marks of Markdown and the brackets of tables."""
    return TABLE.sub(r"\1", LINK.sub(r"\1", text)).replace("`", "")


def help_in(text: str, language: str) -> str:
    """A description of the reference in plain words, in a language where there is a translation."""
    known = help_texts(language)
    return BETWEEN.join(known.get(plain, plain) for plain in plain_words(text).split(BETWEEN))


@cache
def help_texts(language: str) -> Mapping[str, str]:
    """English → sentence in a language; empty for a language without a catalogue."""
    if not language.isalpha():
        return {}
    file = Path(__file__).with_name(f"{language}.po")
    return translations(file) if file.is_file() else {}
