"""Where a panel takes options from that the robot has, and which commands send a choice of them."""

from collections.abc import Mapping

from app.panel.model import Panel
from app.panel.template import input_ids
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.robot_options import ListingService


def selects_by_command(panel: Panel) -> Mapping[str, tuple[SelectInput, ...]]:
    """The selects with `options_from` that a command's message has, by the command's id."""
    selects = {
        widget.id: widget
        for widget in panel.widgets()
        if isinstance(widget, SelectInput) and widget.options_from is not None
    }
    if not selects:
        return {}
    used = {
        command.id: tuple(selects[name] for name in input_ids(command) if name in selects)
        for command in panel.commands
    }
    return {command: choices for command, choices in used.items() if choices}


def listing_services(panel: Panel) -> Mapping[ListingService, float]:
    """The services that list options, and every how many seconds each is called."""
    services: dict[ListingService, float] = {}
    for widget in panel.widgets():
        source = widget.options_from if isinstance(widget, SelectInput) else None
        if source is not None and (service := source.listing) is not None:
            services[service] = min(source.every_s, services.get(service, source.every_s))
    return services
