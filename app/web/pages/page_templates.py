"""The templates of the pages, with their texts rendered in one language.

A page with its own template is what that template made when the panel was loaded, with the widgets of
the usual macros in it, then the frame around it.
"""

import logging
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from jinja2 import Environment
from markupsafe import Markup

from app.panel.layout import Page
from app.panel.numbers import decimal_text
from app.panel.rules import CLEANING_S
from app.panel.widgets.families import BaseWidget
from app.system.pictures import icon
from app.system.printable import printable
from app.system.texts import Text, render, say
from app.system.texts.locales import clear_text, list_separator, number_in, symbols
from app.system.version import installed_version
from app.web.assets import PAGE_GUARD
from app.web.pages.compiled_templates import environment_of

if TYPE_CHECKING:
    from app.panel.page_template import PageParts

log = logging.getLogger("kiosk.web")

FAILURE: Final = say("widget_failed")


class PageTemplates:
    """An environment for each language in use; a template is compiled, or read compiled, at its first
    use."""

    def __init__(
        self,
        folder: Path,
        own: "Mapping[str, PageParts] | None" = None,
        compiled: Path | None = None,
    ) -> None:
        """`own` is what the pages' own templates make, by the ids of the pages; `compiled` the folder
        of those that the wheel has compiled."""
        self._base = environment_of(folder, compiled)
        self._base.globals["icon"] = icon
        self._base.globals["cleaning_s"] = CLEANING_S
        self._base.globals["version"] = installed_version()
        self._base.globals["page_guard"] = PAGE_GUARD
        self._environments: dict[str, Environment] = {}
        self._failing: set[str] = set()  # ids of widgets whose failure was logged
        self._own = own or {}

    def use(self, own: "Mapping[str, PageParts]") -> None:
        """Uses what the pages' own templates of another panel make."""
        self._own = own

    def environment(self, language: str) -> Environment:
        """The environment of a language that has a catalogue."""
        if language not in self._environments:

            def shown(value: Any) -> Any:
                return render(value, language) if isinstance(value, Text) else value

            made = self._environments[language] = self._base.overlay(finalize=shown)
            own = {
                "said": shown,
                "number": lambda text: number_in(f"{text}", language),
                "decimal": symbols(language).decimal,
                "tile": partial(self._tile, language),
                "group": symbols(language).group,
                "typed": lambda entry: typed_in(entry, language),
            }
            made.globals = {**self._base.globals, **own}
        return self._environments[language]

    def render(self, name: str, language: str, **context: Any) -> str:
        """A page for a reader of this language."""
        template = self.environment(language).get_template(name)
        return template.render(language=language, **context)

    def screen(self, page: Page, language: str, context: Mapping[str, Any]) -> str:
        """A page of the panel; `context` is that of `page_context`."""
        widgets = {name: context[name] for name in ("view", "inputs", "receipt", "words")}
        inside = self.inside(page, language, **widgets)
        return self.render("screen.html", language, **{**context, "inside": inside})

    def _tile(
        self, language: str, widget: BaseWidget, shown: Mapping[str, Any], *context: Any
    ) -> Markup:
        """The HTML of a widget, by the macro of its kind; a sentence in its place if that fails: no
        widget takes the page. The failure is logged once, until the widget is rendered again."""
        if "failed" not in shown:
            try:
                macros = self.environment(language).get_template(f"widgets/{widget.kind}.html").module
                html = getattr(macros, widget.kind)(widget, shown, *context)
            except Exception:
                if widget.id not in self._failing:
                    log.exception(
                        'widget "%s" can not be rendered; the page shows the others', widget.id
                    )
                self._failing.add(widget.id)
            else:
                self._failing.discard(widget.id)
                return Markup(html)
        failed = self.environment(language).get_template("_failed.html")
        return Markup(failed.render(widget=widget, why=shown.get("failed", FAILURE)))

    def inside(self, page: Page, language: str, **context: Any) -> Markup | None:
        """The HTML of a page's own template; None if it has none. `context` has what a widget's macro
        takes (`_cell.html`)."""
        if page.id not in self._own:
            return None
        widgets = {widget.id: widget for widget in page.widgets}
        cell = self.environment(language).get_template("_cell.html")

        def show(name: str) -> Markup:
            return Markup(cell.render(widget=widgets[name], placed="", **context))

        return self._own[page.id].inside(language, show, context["words"]["pictures"])


def typed_in(entry: Any, language: str) -> Any:
    """An entry of a form as it is shown again: numbers in the reader's notation, others as they are."""
    if isinstance(entry, str):
        return printable(entry)
    if isinstance(entry, list | tuple):
        between = f"{list_separator(language)} "
        return between.join(str(typed_in(element, language)) for element in entry)
    if isinstance(entry, bool) or not isinstance(entry, int | float):
        return entry
    return number_in(clear_text(decimal_text(entry)), language)
