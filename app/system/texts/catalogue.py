"""The sentences of each language, by their codes: gettext catalogues, `<language>.po`.

A language is a BCP 47 tag, such as "en" or "pt-BR". `msgid` is the code, `msgstr` the sentence, with
`{name}` for a parameter. A sentence that a catalogue lacks is rendered in English.
"""

import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Final

ENGLISH: Final = "en"
SUFFIX: Final = ".po"

_folders: list[Path] = [Path(__file__).parent]
_forget_made: list[Callable[[], None]] = []


@contextmanager
def catalogues_in(folder: Path) -> Iterator[None]:
    """A context in which the catalogues of `folder` are used before others of the same language."""
    _folders.append(folder)
    _forget()
    try:
        yield
    finally:
        _folders.remove(folder)
        _forget()


def when_changed(forget: Callable[[], None]) -> None:
    """Calls `forget` when the catalogues change: what was cached from the earlier ones is then
    invalid."""
    _forget_made.append(forget)


def _forget() -> None:
    for forget in (files.cache_clear, sentences.cache_clear, *_forget_made):
        forget()


@cache
def files() -> Mapping[str, Path]:
    """The catalogue of each language."""
    paths = {path.stem: path for folder in _folders for path in folder.glob(f"*{SUFFIX}")}
    return dict(sorted(paths.items()))


@cache
def renamed_codes() -> Mapping[str, str]:
    """The present code of each sentence by its former one, which stored texts may have."""
    return tomllib.loads((Path(__file__).parent / "renamed_codes.toml").read_text(encoding="utf-8"))


@cache
def sentences(language: str) -> Mapping[str, str]:
    """The sentences of a language by their codes; KeyError for one without a catalogue.

    Read when it is first needed: Babel takes 15 ms to load, and a catalogue as long to read.
    """
    own = translations(files()[language])
    return own if language == ENGLISH else {**sentences(ENGLISH), **own}


def translations(path: Path) -> dict[str, str]:
    """What stands in one catalogue, without what is marked as fuzzy or not translated yet."""
    from babel.messages.pofile import read_po

    with path.open("rb") as file:
        catalogue = read_po(file, abort_invalid=True)
    return {
        str(message.id): str(message.string)
        for message in catalogue
        if message.id and message.string and not message.fuzzy
    }
