"""The templates of the pages, each with the texts in them rendered in one language."""

from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from app.i18n import Text, render
from app.icons import icons


def icon(name: str) -> Markup:
    """An icon as an element. It says nothing that the text beside it does not."""
    inside = Markup(icons()[name])
    return Markup('<svg class="icon" viewBox="0 0 24 24" aria-hidden="true">{}</svg>').format(inside)


class PageTemplates:
    """An environment for each language in use; a template is compiled when it is first needed."""

    def __init__(self, folder: Path) -> None:
        self._base = Environment(
            loader=FileSystemLoader(folder),
            autoescape=True,
            undefined=StrictUndefined,
            auto_reload=False,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        self._base.globals["icon"] = icon
        self._own: dict[str, Environment] = {}

    def environment(self, language: str) -> Environment:
        """That of a language with a catalogue."""
        if language not in self._own:

            def shown(value: Any) -> Any:
                return render(value, language) if isinstance(value, Text) else value

            self._own[language] = self._base.overlay(finalize=shown)
        return self._own[language]

    def render(self, name: str, language: str, **context: Any) -> str:
        """A page for a reader of this language."""
        template = self.environment(language).get_template(name)
        return template.render(language=language, **context)
