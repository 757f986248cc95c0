"""Checks of how a panel looks: its brand, and what grows on a page."""

from collections.abc import Iterator

from app.errors import Fault
from app.panel.faults.wording import list_names
from app.panel.model import Panel


def brand_faults(panel: Panel) -> Iterator[Fault]:
    """A logo that is not there."""
    if panel.brand and panel.brand.logo and panel.brand.logo not in panel.picture_files:
        names = list_names(panel.picture_files) if panel.picture_files else "none"
        message = f'no picture "{panel.brand.logo}" in the folder `pictures`; there is {names}'
        yield Fault("brand.logo", message, cause=f"picture {panel.brand.logo}")


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
