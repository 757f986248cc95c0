"""Checks of how a panel looks: its brand, pictures of help, and what grows on a page."""

from collections.abc import Iterator

from app.errors import Fault
from app.i18n.values import each_language
from app.panel.faults.wording import list_names
from app.panel.model import Panel


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
    if name not in panel.picture_files:
        names = list_names(panel.picture_files) if panel.picture_files else "none"
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
