"""A page's own template: Jinja in a sandbox, which places the widgets of its page and pictures.

It has `title` (the page's), `language` (the reader's), `widget(id)`, `picture(name, alt)` and
`icon(name)`, and knows nothing of the robot. What it places in a language is the same in every request,
and is tried once when the panel is loaded.
"""

from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from jinja2 import StrictUndefined, Template, TemplateError
from jinja2.sandbox import ImmutableSandboxedEnvironment
from markupsafe import Markup

from app.i18n import ENGLISH, render
from app.icons import icon, icons
from app.panel.faults.wording import closest_name, list_names
from app.panel.layout import Page

PICTURE: Final = Markup('<img class="picture" src="{}/{}" alt="{}" draggable="false">')


class PlacementError(ValueError):
    """A template places an unknown name, or a widget twice. `cause` is as in a Fault."""

    def __init__(self, message: str, cause: str = "") -> None:
        super().__init__(message)
        self.cause = cause


@dataclass(frozen=True, slots=True)
class TemplateFault:
    """What is wrong with a template; `line` counts from 1, 0 if it is not known. `cause` is as in a
    Fault."""

    line: int
    message: str
    cause: str = ""


@cache
def _environment() -> ImmutableSandboxedEnvironment:
    made = ImmutableSandboxedEnvironment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    made.globals["icon"] = _icon
    return made


def _icon(name: str) -> Markup:
    if name not in icons():
        raise PlacementError(_unknown("icon", name, icons()))
    return icon(name)


def compile_template(path: Path) -> Template:
    """TemplateError for what is not written as Jinja has it; UnicodeDecodeError."""
    environment = _environment()
    source = path.read_text(encoding="utf-8")
    code = environment.compile(source, filename=str(path))
    return Template.from_code(environment, code, environment.make_globals(None))


def render_page(
    template: Template,
    page: Page,
    pictures: Collection[str],
    show: Callable[[str], Markup],
    folder: str = "",
    language: str = ENGLISH,
) -> Markup:
    """The inside of a page. `show` makes the widget with an id, `folder` is the path of the pictures,
    `language` that of the reader.
    Raises PlacementError, or what else a template may raise."""
    known = {widget.id for widget in page.widgets}
    placed: set[str] = set()

    def widget(name: str) -> Markup:
        if name not in known:
            what = _unknown("widget", name, [one.id for one in page.widgets])
            raise PlacementError(what, f"input {name}")
        if name in placed:
            raise PlacementError(f'the widget "{name}" is placed twice')
        placed.add(name)
        return show(name)

    def picture(name: str, alt: str = "") -> Markup:
        if name not in pictures:
            raise PlacementError(_unknown("picture", name, pictures))
        return PICTURE.format(folder, name, alt)

    given = {"title": render(page.title, language), "language": language}
    return Markup(template.render(**given, widget=widget, picture=picture))


def _unknown(what: str, name: Any, known: Collection[str]) -> str:
    meant = closest_name(str(name), known)
    where = " on this page" if what == "widget" else ""
    hint = f'did you mean "{meant}"?' if meant else f"there is {list_names(known)}"
    return f'no {what} "{name}"{where}; {hint}'


def try_template(
    path: Path, page: Page, pictures: Collection[str], languages: Collection[str] = (ENGLISH,)
) -> TemplateFault | list[str]:
    """The first fault of a page's template for readers of these languages, else the ids of the widgets
    that it does not place for all of them."""
    placed: Counter[str] = Counter()

    def show(name: str) -> Markup:
        placed[name] += 1
        return Markup()

    try:
        template = compile_template(path)
        for language in languages:
            render_page(template, page, pictures, show, language=language)
    except UnicodeDecodeError:
        return TemplateFault(0, "is not UTF-8")
    except Exception as error:  # a template may raise anything: 1 / 0, None.upper()
        return TemplateFault(_line(error, path), _message(error), getattr(error, "cause", ""))
    return [widget.id for widget in page.widgets if placed[widget.id] < len(languages)]


def _message(error: Exception) -> str:
    if isinstance(error, TypeError) and "no loader" in str(error):
        return "include, import and extends are not there: a template is one file"
    if isinstance(error, PlacementError | TemplateError):
        return str(error.args[0] if error.args else error)
    return f"{type(error).__name__}: {error}"


def _line(error: Exception, path: Path) -> int:
    """Where in the template: Jinja gives its frames the template's name and lines."""
    if (line := getattr(error, "lineno", None)) is not None:
        return int(line)
    return max(_lines(error, path), default=0)


def _lines(error: Exception, path: Path) -> Iterator[int]:
    step = error.__traceback__
    while step is not None:
        if step.tb_frame.f_code.co_filename == str(path):
            yield step.tb_lineno
        step = step.tb_next
