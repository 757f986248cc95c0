"""A page's own template, compiled and rendered in a process with limits (`app.system.page_process`).

It knows nothing of the robot: what it makes in a language is the same in every request, but for the
widgets in it. So it runs once, when the panel is loaded, and a page puts its widgets in between.
"""

import re
import secrets
import signal
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from markupsafe import Markup

from app.panel.file.wording import closest_name, list_names
from app.panel.layout import Page
from app.system.page_process import BYTES, NAME, SECONDS, Answer, PageRequest
from app.system.pictures import icons
from app.system.texts import ENGLISH, render
from app.system.worker import Limits, Worker, WorkerError

WITHIN_S: Final = 30.0  # on a machine that is busy; its own time is limited by itself
MOST_BYTES: Final = 1_000_000
MAX_TEMPLATES: Final = 64  # templates of a panel that are not run again
_FRAME: Final = re.compile(rf'File "{NAME}", line (\d+)')
ENDED: Final = f"it takes more than {SECONDS:g} s in one expression"


@dataclass(frozen=True, slots=True)
class TemplateFault:
    """What is wrong with a template; `line` counts from 1, 0 if it is not known. `cause` is as in a
    Fault."""

    line: int
    message: str
    cause: str = ""


# The parts between widgets and paths of pictures, in turn: None is the folder of pictures.
Parts = tuple[str | None, ...]


@dataclass(frozen=True, slots=True)
class PageParts:
    """What a template makes, by language: texts at even places, between them ids of widgets, and None
    for the folder of pictures."""

    by_language: Mapping[str, Parts]

    def placed(self, widget: str) -> bool:
        """Whether the readers of each language see a widget."""
        return all(widget in parts[1::2] for parts in self.by_language.values())

    def inside(self, language: str, show: Callable[[str], Markup], folder: str) -> Markup:
        """The inside of a page. `show` makes the widget with an id, `folder` is the path of the
        pictures."""
        shown = []
        for number, part in enumerate(self.by_language[language]):
            if number % 2:
                shown.append(folder if part is None else show(part))
            else:
                shown.append(part or "")
        return Markup("".join(shown))


def run_template(
    path: Path, page: Page, pictures: Collection[str], languages: Collection[str] = (ENGLISH,)
) -> TemplateFault | PageParts:
    """What a page's template makes for readers of these languages, or its first fault."""
    try:
        with path.open("rb") as file:
            source = file.read(MOST_BYTES + 1)
        if len(source) > MOST_BYTES:
            return TemplateFault(0, f"has more than {MOST_BYTES:,} bytes")
        text = source.decode()
    except UnicodeDecodeError:
        return TemplateFault(0, "is not UTF-8")
    except OSError as error:
        return TemplateFault(0, f"can't be read: {error.strerror}")
    titles = tuple((language, render(page.title, language)) for language in languages)
    return _run(text, titles, tuple(widget.id for widget in page.widgets), tuple(sorted(pictures)))


@lru_cache(MAX_TEMPLATES)
def _run(
    source: str,
    titles: tuple[tuple[str, str], ...],
    widgets: tuple[str, ...],
    pictures: tuple[str, ...],
) -> TemplateFault | PageParts:
    mark = f"[{secrets.token_hex(16)}:"
    request: PageRequest = {
        "source": source,
        "titles": dict(titles),
        "widgets": list(widgets),
        "pictures": list(pictures),
        "mark": mark,
    }
    limits = Limits(within_s=WITHIN_S, memory=BYTES, nice=0)
    results = []
    try:
        for result in Worker("app.system.page_process:render", request, limits=limits).results():
            results.append(result)
    except WorkerError as error:
        return _ended(error, results[0] if results else [])
    except OSError as error:
        return TemplateFault(0, f"can't be tried: {error.strerror}")
    return _answered(results[-1], mark, request)


def _ended(error: WorkerError, lines: Iterable[tuple[int, int]]) -> TemplateFault:
    """Of a process that could not even say what is wrong; `lines` are those of the template, with those
    of its code."""
    if error.ended_with not in (-signal.SIGVTALRM, -signal.SIGALRM):
        return TemplateFault(0, f"can't be tried: its process ended with status {error.ended_with}")
    at = _FRAME.search(error.output)
    before = [line for line, code in lines if at is not None and code <= int(at[1])]
    return TemplateFault(before[-1] if before else 0, ENDED)


def _answered(answer: Answer, mark: str, request: PageRequest) -> TemplateFault | PageParts:
    if "rendered" not in answer:
        return _fault(answer, request)
    parts_by_language = {}
    for language, text in answer["rendered"].items():
        parts = re.split(rf"{re.escape(mark)}(\d*)\.", text)
        placed = [int(number) for number in parts[1::2] if number]
        if any(mark.strip("[:") in part.lower() for part in parts[::2]) or len({*placed}) < len(placed):
            return TemplateFault(0, "what widget() and picture() give is placed once, as it is")
        ids = [request["widgets"][int(number)] if number else None for number in parts[1::2]]
        parts_by_language[language] = tuple(
            part if number % 2 == 0 else ids[number // 2] for number, part in enumerate(parts)
        )
    return PageParts(parts_by_language)


def _fault(answer: Answer, request: PageRequest) -> TemplateFault:
    line, name = answer.get("line", 0), answer.get("name", "")
    if twice := answer.get("twice"):
        return TemplateFault(line, f'the widget "{twice}" is placed twice')
    if noun := answer.get("unknown"):
        known = {"widget": request["widgets"], "picture": request["pictures"], "icon": icons()}[noun]
        cause = f"input {name}" if noun == "widget" else ""
        return TemplateFault(line, _unknown(noun, name, known), cause)
    return TemplateFault(line, answer.get("message", ""))


def _unknown(noun: str, name: str, known: Collection[str]) -> str:
    meant = closest_name(name, known)
    where = " on this page" if noun == "widget" else ""
    hint = f'did you mean "{meant}"?' if meant else f"there is {list_names(known)}"
    return f'no {noun} "{name}"{where}; {hint}'
