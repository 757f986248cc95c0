"""Checks of how a panel looks: brand, help, labels, layout, and pages with a template."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.widgets.displays import PageLink, Static, picture_faults
from app.panel.widgets.families import BaseWidget, KeyCommand
from app.system.errors import Fault, Note
from app.system.texts.text import each_language

if TYPE_CHECKING:
    from app.panel.page_template import PageParts, TemplateFault


# Checks of how a panel looks: its brand, pictures of help, labels, and what grows on a page.

WITH_FACE: Final = ("publish", "call", "action", "hold")  # kinds whose button has its label on it


def brand_faults(panel: Panel) -> Iterator[Fault]:
    """A logo that is not there."""
    if panel.brand:
        yield from picture_faults("brand.logo", panel.brand.logo, panel.shown_pictures)


def help_faults(panel: Panel) -> Iterator[Fault]:
    """Pictures of what to do about an interlock that are not there."""
    for i, interlock in enumerate(panel.interlocks):
        place = f"interlock[{i}].help"
        if interlock.help.picture is not None:
            for name in dict.fromkeys(each_language(interlock.help.picture).values()):
                yield from picture_faults(f"{place}.picture", name, panel.shown_pictures)


def grow_faults(panel: Panel) -> Iterator[Fault]:
    """One widget of a group takes the height that is left."""
    for p, page in enumerate(panel.pages):
        growing: dict[str, str] = {}
        for place, widget in page.placed():
            group = place.rpartition("widget[")[0]
            if widget.grow and group in growing:
                message = f'"{growing[group]}" has it already: one widget of a group grows'
                yield Fault(f"page[{p}].{place}.grow", message)
            elif widget.grow:
                growing[group] = widget.id


def label_faults(panel: Panel) -> Iterator[Fault]:
    """Widgets of which nothing would say what they are for, without their label."""
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            if not widget.show_label and (reason := _needs_label(widget)):
                yield Fault(f"page[{p}].{place}.show_label", reason)
    for w, widget in enumerate(panel.frame.widgets):
        if not widget.show_label:
            message = "buttons of the frame show their labels: leave this key out"
            yield Fault(f"frame.widget[{w}].show_label", message)


def _needs_label(widget: BaseWidget) -> str:
    """Why the label of a widget is shown; "" if it need not be."""
    if isinstance(widget, KeyCommand) and widget.role == "stop":
        return "a stop button shows its label: leave this key out"
    if isinstance(widget, KeyCommand) and widget.kind in WITH_FACE and not widget.shown_icon:
        return 'a button without its label needs an icon, such as icon = "arrow-left"'
    if isinstance(widget, Static) and not (isinstance(widget, PageLink) and widget.icon):
        return f'of a widget of the kind "{widget.kind}" nothing else is read: leave this key out'
    return ""


# Checks of pages with a template of their own.


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
