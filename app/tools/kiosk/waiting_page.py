"""The page that is shown until the panel server answers.

It is on the screen while the server still loads, so it reads of the panel file only the title and the
languages, and imports nothing but Python's own library. `python -m app.kiosk.waiting_page PANEL FILE`
writes it too, for a watcher that has run since before an update.
"""

import sys
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any, Final

from app.system.texts.catalogue import ENGLISH, files, translations
from app.system.whole_file import write_whole
from app.tools.kiosk.config import TAG

STYLE: Final = """
html { background: #1b1f23; color: #fff;
  font: min(28px, 4.2vh)/1.4 "Noto Sans", "Noto Sans CJK JP", sans-serif }
body { margin: 0 4vw; height: 100vh; display: grid; gap: 1.2em; place-content: center;
  justify-items: center; text-align: center; user-select: none; cursor: none }
h1 { font-size: 1.3em; margin: 0 } p { margin: .2em 0 } p.late { color: #c8ccd0; font-size: .8em }
i { width: 2em; height: 2em; border: .3em solid #555; border-top-color: #fff; border-radius: 50%;
  animation: turn 1.2s steps(12) infinite }
.late { visibility: hidden; animation: show 0s 60s forwards }
@keyframes turn { to { transform: rotate(1turn) } }
@keyframes show { to { visibility: visible } }
"""


def waiting_page(title: str, languages: Sequence[str]) -> str:
    """The page's HTML: what it waits for in each language, and after a minute what to do."""
    sentences = "".join(_sentences(language) for language in languages)
    return (
        f'<!doctype html><html lang="{languages[0]}" data-theme="dark"><meta charset="utf-8">'
        f"<title>{escape(title)}</title><style>{STYLE}</style>"
        f"<body data-waiting><h1>{escape(title)}</h1><i></i><div>{sentences}</div>"
    )


def _sentences(language: str) -> str:
    said = translations(files()[language if language in files() else ENGLISH])
    waits, late = escape(said["kiosk_starting"]), escape(said["kiosk_no_response"])
    return f'<div lang="{language}"><p>{waits}</p><p class="late">{late}</p></div>'


def page_of(panel: Path) -> str:
    """The page for a panel file. One that can't be read is waited for in every language."""
    try:
        keys = tomllib.loads(panel.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return waiting_page("", list(files()))
    languages = _languages(keys)
    return waiting_page(_title(keys.get("title"), languages[0]), languages)


def _languages(keys: Mapping[str, Any]) -> list[str]:
    """The panel's language, then the others that a reader can choose, as `Panel.readers_languages`."""
    first, chosen = keys.get("language", ENGLISH), keys.get("languages")
    if not isinstance(chosen, list):
        written = set(_languages_of_texts(keys)) or files().keys()
        chosen = [tag for tag in files() if tag in written]
    tags = [tag for tag in (first, *chosen) if isinstance(tag, str) and TAG.fullmatch(tag)]
    return list(dict.fromkeys(tags)) or list(files())


def _languages_of_texts(value: Any) -> Iterator[str]:
    """The languages of all texts in several languages: tables whose keys are languages."""
    if isinstance(value, list):
        for element in value:
            yield from _languages_of_texts(element)
    elif isinstance(value, dict):
        if value and value.keys() <= files().keys():
            yield from value
        for element in value.values():
            yield from _languages_of_texts(element)


def _title(title: Any, language: str) -> str:
    """In the panel's language, else in any that it has."""
    if isinstance(title, dict):
        title = title.get(language) or next(iter(title.values()), "")
    return title if isinstance(title, str) else ""


def write_page(panel: Path, target: Path) -> None:
    """Writes the whole page at once: the browser may be reading the one before."""
    write_whole(target, page_of(panel).encode(), mode=None, durable=False)


def main(arguments: Sequence[str]) -> int:
    panel, target = map(Path, arguments)
    write_page(panel, target)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
