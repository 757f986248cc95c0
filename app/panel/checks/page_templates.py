"""Checks of pages with a template of their own."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

from app.errors import Fault, Note
from app.panel.layout import Page
from app.panel.model import Panel

if TYPE_CHECKING:
    from app.panel.page_template import PageParts, TemplateFault


def page_template_faults(panel: Panel) -> Iterator[Fault]:
    """The first fault of each template, with its line there."""
    for p, page in enumerate(panel.pages):
        if page.template is None:
            continue
        place = f"page[{p}].template"
        if page.groups:
            yield Fault(place, "a page with a template has no groups: the template places its widgets")
            continue
        _, fault = _run(panel, page)
        if fault is not None:
            line = f"line {fault.line}: " if fault.line else ""
            yield Fault(place, f"{page.template.name}: {line}{fault.message}", cause=fault.cause)


def unplaced_notes(panel: Panel) -> Iterator[Note]:
    """Widgets that are on a page and that its template never places."""
    for p, page in enumerate(panel.pages):
        if page.template is None:
            continue
        parts, _ = _run(panel, page)
        never = [widget.id for widget in page.widgets if parts and not parts.placed(widget.id)]
        if never:
            named = ", ".join(f'"{name}"' for name in never)
            message = f"{page.template.name} never places {named}: no one sees what is not placed"
            yield Note(f"page[{p}].template", message)


def page_parts(panel: Panel) -> "dict[str, PageParts]":
    """What the templates of a panel without faults make, by the ids of their pages."""
    made = {page.id: _run(panel, page)[0] for page in panel.pages if page.template is not None}
    return {name: parts for name, parts in made.items() if parts is not None}


def _run(panel: Panel, page: Page) -> "tuple[PageParts | None, TemplateFault | None]":
    """Imported only where a page has a template: its process is needed by nothing else."""
    from app.panel.page_template import TemplateFault, run_template

    assert page.template is not None
    result = run_template(page.template, page, panel.shown_pictures, panel.readers_languages)
    return (None, result) if isinstance(result, TemplateFault) else (result, None)
