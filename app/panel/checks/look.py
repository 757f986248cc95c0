"""Checks of how a panel looks: its brand, pictures of help, labels, and what grows on a page."""

from collections.abc import Iterator
from typing import Final

from app.errors import Fault
from app.i18n.values import each_language
from app.panel.faults.wording import list_names
from app.panel.model import Panel
from app.panel.widgets.families import BaseWidget, KeyCommand
from app.panel.widgets.static import PageLink, Static

WITH_FACE: Final = ("publish", "call", "action", "hold")  # kinds whose button has its label on it


def brand_faults(panel: Panel) -> Iterator[Fault]:
    """A logo that is not there."""
    if panel.brand and panel.brand.logo:
        yield from _picture_faults("brand.logo", panel.brand.logo, panel)


def help_faults(panel: Panel) -> Iterator[Fault]:
    """Pictures of what to do about an interlock that are not there."""
    for i, interlock in enumerate(panel.interlocks):
        place = f"interlock[{i}].help"
        if interlock.help.picture is not None:
            for name in dict.fromkeys(each_language(interlock.help.picture).values()):
                yield from _picture_faults(f"{place}.picture", name, panel)


def _picture_faults(place: str, name: str, panel: Panel) -> Iterator[Fault]:
    if name not in panel.shown_pictures:
        names = list_names(panel.shown_pictures)
        message = f'no picture "{name}" in the folder `pictures`; there is {names}'
        yield Fault(place, message, cause=f"picture {name}")


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
