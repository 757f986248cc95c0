"""Buttons that are judged as one."""

from collections.abc import Iterable

from app.panel.alarm import Alarm
from app.panel.inhibits import inhibited_name
from app.panel.widgets.families import Command
from app.panel.widgets.publish import PublishPress

UniformButtons = dict[tuple[tuple[str, ...], bool], tuple[PublishPress, ...]]


def uniform_buttons(commands: Iterable[Command], alarms: Iterable[Alarm]) -> UniformButtons:
    """Buttons that publish, that no alarm locks and that no person confirms, by their interlocks and
    whether they stop: many are judged as one, as these and the graph decide their lock, which is all
    that is shown."""
    inhibited = {inhibited_name(name).control for alarm in alarms for name in alarm.inhibits}
    groups: UniformButtons = {}
    for widget in commands:
        if not isinstance(widget, PublishPress) or widget.shows_more:
            continue
        if widget.id not in inhibited and not widget.confirmation:
            key = widget.interlocks, widget.role == "stop"
            groups[key] = (*groups.get(key, ()), widget)
    return groups
