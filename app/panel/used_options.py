"""Which commands of a panel send a choice of options that the robot has."""

from collections.abc import Mapping

from app.panel.model import Panel
from app.panel.template import input_ids
from app.panel.widgets.inputs import SelectInput


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
