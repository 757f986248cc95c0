"""Checks of pages with a template of their own."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from app.errors import Fault, Note
from app.panel.model import Panel

if TYPE_CHECKING:
    from app.panel.page_template import TemplateFault


def page_template_faults(panel: Panel) -> Iterator[Fault]:
    """The first fault of each template, with its line there."""
    for p, page in enumerate(panel.pages):
        if page.template is None:
            continue
        place = f"page[{p}].template"
        if page.groups:
            yield Fault(place, "a page with a template has no groups: the template places its widgets")
            continue
        found = _try(panel, p)
        if not isinstance(found, list):
            line = f"line {found.line}: " if found.line else ""
            yield Fault(place, f"{page.template.name}: {line}{found.message}", cause=found.cause)


def unplaced_notes(panel: Panel) -> Iterator[Note]:
    """Widgets that are on a page and that its template never places."""
    for p, page in enumerate(panel.pages):
        never = _try(panel, p) if page.template is not None else []
        if isinstance(never, list) and never and page.template is not None:
            named = ", ".join(f'"{name}"' for name in never)
            what = f"{page.template.name} never places {named}: no one sees what is not placed"
            yield Note(f"page[{p}].template", what)


def _try(panel: Panel, number: int) -> "TemplateFault | list[str]":
    """Imported only where a page has a template: the sandbox is needed by nothing else."""
    from app.panel.page_template import try_template

    page = panel.pages[number]
    assert page.template is not None
    return try_template(page.template, page, panel.picture_files, panel.readers_languages)
