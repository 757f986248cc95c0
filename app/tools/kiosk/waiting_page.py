"""The page that is shown until the panel server answers: `python -m app.kiosk.waiting_page PANEL FILE`.

It is made by a process of its own, once: the catalogues need more memory than all that watches the
screen.
"""

import sys
from collections.abc import Sequence
from html import escape
from pathlib import Path

from app.system.errors import KioskError
from app.system.texts import render, say
from app.system.texts.catalogue import files

STYLE = """
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
    waits, late = (
        escape(render(say(code), language)) for code in ("kiosk_starting", "kiosk_no_response")
    )
    return f'<div lang="{language}"><p>{waits}</p><p class="late">{late}</p></div>'


def page_of(panel: Path) -> str:
    """The page for a panel file. One with faults, or none, is waited for in every language."""
    from app.panel import load_panel

    try:
        loaded = load_panel(panel)
        first = loaded.language
        others = [tag for tag in loaded.readers_languages if tag != first]
        return waiting_page(render(loaded.title, first), [first, *others])
    except (KioskError, OSError):
        return waiting_page("", list(files()))


def main(arguments: Sequence[str]) -> int:
    panel, target = map(Path, arguments)
    page = page_of(panel)
    draft = target.with_suffix(".draft")
    draft.write_text(page)
    draft.replace(target)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
