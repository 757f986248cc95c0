"""Compiles and renders a page's own template, in a process (`app.system.worker`). A template may run
for ever, or take all memory: here it can take one second of the processor and 50 MB.

It is Jinja in a sandbox, with `title` (the page's), `language` (the reader's), `widget(id)`,
`picture(name, alt)` and `icon(name)`. A single expression that takes more than a second and a half ends
the process by SIGVTALRM, with its line on stderr.
"""

import faulthandler
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final, NoReturn, TypedDict

from jinja2 import StrictUndefined, Template, TemplateError, pass_context
from jinja2.sandbox import ImmutableSandboxedEnvironment
from markupsafe import Markup

from app.system.pictures import icon, icons

SECONDS: Final = 1.0
LAST_SECONDS: Final = 1.5
BYTES: Final = 50_000_000
MOST_CHARS: Final = 1_000_000  # of what a template makes
NAME: Final = "<template>"
LONGEST_NAME: Final = 100
LONGEST_MESSAGE: Final = 500
PICTURE: Final = Markup('<img class="picture" src="{}/{}" alt="{}" draggable="false">')


class PageRequest(TypedDict):
    """`titles` are the page's by the languages of readers. In what is rendered, `mark` and the number
    of a widget stand for the widget, and `mark` alone for the folder of pictures."""

    source: str
    titles: dict[str, str]
    widgets: list[str]
    pictures: list[str]
    mark: str


class Answer(TypedDict, total=False):
    """Either `rendered`, by language, or a fault: its line, and what is `unknown` (a widget, a picture
    or an icon, with its `name`), `twice` there, or another `message`."""

    rendered: dict[str, str]
    line: int
    unknown: str
    name: str
    twice: str
    message: str


class TooLong(Exception):
    """The template's time is over."""


class PlacementError(ValueError):
    """A template places an unknown name, or a widget twice."""

    def __init__(self, fault: Answer) -> None:
        super().__init__()
        self.fault = fault


@pass_context
def _unchanged(context: Any, value: Any) -> Any:
    """For `finalize`: what needs a context is computed when a template is rendered, so that its line is
    known, and not when it is compiled."""
    return value


def _environment() -> ImmutableSandboxedEnvironment:
    made = ImmutableSandboxedEnvironment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        optimized=False,
        finalize=_unchanged,
    )
    made.globals["icon"] = _icon
    return made


def _icon(name: str) -> Markup:
    if name not in icons():
        raise _unknown("icon", name)
    return icon(name)


def _unknown(kind: str, name: Any) -> PlacementError:
    return PlacementError({"unknown": kind, "name": str(name)[:LONGEST_NAME]})


@dataclass(frozen=True, slots=True)
class _Page:
    request: PageRequest

    def render(self, template: Template, language: str) -> str:
        placed: set[str] = set()
        widgets, mark = self.request["widgets"], self.request["mark"]

        def widget(name: str) -> Markup:
            if name not in widgets:
                raise _unknown("widget", name)
            if name in placed:
                raise PlacementError({"twice": name})
            placed.add(name)
            return Markup(f"{mark}{widgets.index(name)}.")

        def picture(name: str, alt: str = "") -> Markup:
            if name not in self.request["pictures"]:
                raise _unknown("picture", name)
            return PICTURE.format(Markup(f"{mark}."), name, alt)

        texts = {"title": self.request["titles"][language], "language": language}
        context = template.new_context({**texts, "widget": widget, "picture": picture})
        try:
            return _joined(template, template.root_render_func(context))
        except Exception:
            template.environment.handle_exception()  # raises it again, with lines of the template


def _joined(template: Template, made: Any) -> str:
    """The text of a generator of its parts."""
    parts, length = list[str](), 0
    for part in made:
        parts.append(part)
        length += len(part)
        if length > MOST_CHARS:
            line = template.get_corresponding_lineno(made.gi_frame.f_lineno)
            message = f"it makes more than {MOST_CHARS:,} characters"
            raise PlacementError({"message": message, "line": line})
    return "".join(parts)


def render(request: PageRequest) -> Iterator[Any]:
    """Two results: the lines of the template with those of its Python code, and what it makes, an
    `Answer`. A template that can't be compiled has the second only."""
    icons()
    with _limited_time():
        try:
            environment = _environment()
            code = environment.compile(request["source"], filename=NAME)
            template = Template.from_code(environment, code, environment.make_globals(None))
            yield template.debug_info
            page = _Page(request)
            answer: Answer = {
                "rendered": {
                    language: page.render(template, language) for language in request["titles"]
                }
            }
        except Exception as error:  # a template may raise anything: 1 / 0, None.upper()
            answer = _fault(error)
    yield answer


def _fault(error: Exception) -> Answer:
    line = getattr(error, "lineno", None) or max(_lines(error), default=0)
    if isinstance(error, PlacementError):
        return {"line": line, **error.fault}
    return {"line": line, "message": _message(error)[:LONGEST_MESSAGE]}


def _message(error: Exception) -> str:
    if isinstance(error, TooLong):
        return f"it takes more than {SECONDS:g} s"
    if isinstance(error, MemoryError):
        return f"it takes more than {BYTES // 1_000_000} MB"
    if isinstance(error, TypeError) and "no loader" in str(error):
        return "include, import and extends are not there: a template is one file"
    if isinstance(error, TemplateError):
        return str(error.args[0] if error.args else error)
    return f"{type(error).__name__}: {error}"


def _lines(error: Exception) -> Iterator[int]:
    """Where in the template: Jinja gives its frames the template's name and lines."""
    step = error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == NAME:
            yield step.tb_lineno
        step = step.tb_next


@contextmanager
def _limited_time() -> Iterator[None]:
    """Limits the time of the processor within the block."""

    def end(*_: object) -> NoReturn:
        raise TooLong

    faulthandler.register(signal.SIGVTALRM, all_threads=False, chain=True)
    signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    signal.setitimer(signal.ITIMER_VIRTUAL, LAST_SECONDS)
    yield
    signal.setitimer(signal.ITIMER_PROF, 0)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0)
