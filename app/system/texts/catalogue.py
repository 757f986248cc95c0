"""The sentences of each language, by their codes: gettext catalogues, `<language>.po`.

A language is a BCP 47 tag, such as "en" or "pt-BR". `msgid` is the code, `msgstr` the sentence, with
`{name}` for a parameter. A sentence that a catalogue lacks is rendered in English.
"""

import re
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
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

    Read when it is first needed.
    """
    own = translations(files()[language])
    return own if language == ENGLISH else {**sentences(ENGLISH), **own}


# Catalogues as this project writes them are read here, in 3 ms. Babel takes 20 ms to load and 12 ms for
# each: it reads those with more in them, and says what is wrong with one.
_STRING: Final = re.compile(r'"((?:[^"\\]|\\.)*)"')
_ESCAPED: Final = re.compile(r"\\(.)")
_ESCAPES: Final = {"n": "\n", "t": "\t", "r": "\r"}
_COMMENTS: Final = ("# ", "#. ", "#: ")
_CHARSET: Final = "charset=utf-8"


def _plain_entries(text: str) -> dict[str, str] | None:
    """The entries of a catalogue that has only codes, sentences and comments; None for any other."""
    entries: list[list[str]] = [[]]  # of each the code, then the lines of its sentence, quoted
    for line in text.split("\n"):
        if line.startswith("msgid "):
            entries.append([line.removeprefix("msgid ")])
        elif line.startswith("msgstr ") and len(entries[-1]) == 1:
            entries[-1].append(line.removeprefix("msgstr "))
        elif line.startswith('"') and len(entries[-1]) > 1:
            entries[-1].append(line)
        elif line not in ("", "#") and not line.startswith(_COMMENTS):
            return None
    try:
        read = {_unquoted(code): "".join(map(_unquoted, lines)) for code, *lines in entries[1:]}
    except ValueError:
        return None
    if len(read) < len(entries) - 1 or _CHARSET not in read.pop("", "").lower():
        return None
    return {code: sentence for code, sentence in read.items() if sentence}


def _unquoted(line: str) -> str:
    """The text of a string in quotes; ValueError for what is not one."""
    text = line[1:-1]
    if len(line) > 1 and line[0] == line[-1] == '"' and '"' not in text and "\\" not in text:
        return text
    if not (quoted := _STRING.fullmatch(line)):
        raise ValueError(line)
    return _ESCAPED.sub(lambda match: _ESCAPES.get(match[1], match[1]), quoted[1])


def translations(path: Path) -> dict[str, str]:
    """What stands in one catalogue, without what is marked as fuzzy or not translated yet."""
    with suppress(UnicodeDecodeError):
        if (plain := _plain_entries(path.read_text(encoding="utf-8"))) is not None:
            return plain
    return babel_translations(path)


def babel_translations(path: Path) -> dict[str, str]:
    """The same, for every catalogue of gettext."""
    from babel.messages.pofile import read_po

    with path.open("rb") as file:
        catalogue = read_po(file, abort_invalid=True)
    return {
        str(message.id): str(message.string)
        for message in catalogue
        if message.id and message.string and not message.fuzzy
    }
