"""Faults of names that are written in two ways."""

from collections.abc import Iterator

from app.errors import Fault
from app.interfaces.names import GLOBAL, key_of
from app.panel.model import Panel
from app.panel.widgets.families import BaseWidget, Command, DisplayWidget
from app.panel.widgets.publish import PublishPress

NAME_KEYS = ("topic", "service", "action", "node")


def spelling_faults(panel: Panel, widgets: Iterator[tuple[str, BaseWidget]]) -> Iterator[Fault]:
    """Faults of names that are below the namespace and written as if they were not, beside the other
    way: what the panel knows of a topic, it knows by one name."""
    names = [(f"interlock[{i}].topic", interlock.topic) for i, interlock in enumerate(panel.interlocks)]
    for c, condition in enumerate(panel.own_conditions):
        names.append((f"condition[{c}].topic", condition.topic))
    for i, alarm in enumerate(panel.alarms):
        named = (("topic", alarm.topic), ("node", alarm.node))
        names += [(f"alarm[{i}].{key}", name) for key, name in named if name]
    for place, widget in widgets:
        names += _names(place, widget)
    if not any(name.startswith(GLOBAL) for _, name in names):
        return
    for namespace in {robot.namespace for robot in panel.robots} or {panel.namespace}:
        firsts: dict[str, tuple[str, str]] = {}
        for place, name in names:
            above, first = firsts.setdefault(key_of(name, namespace), (place, name))
            if name != first:
                yield Fault(place, f'"{name}" is "{first}" at {above}: write it in the same way')


def _names(place: str, widget: BaseWidget) -> Iterator[tuple[str, str]]:
    """(place, name) of each topic, service, action and node of a widget."""
    for key in NAME_KEYS:
        if isinstance(name := getattr(widget, key, None), str):
            yield f"{place}.{key}", name
    if isinstance(widget, DisplayWidget | Command):
        for source in widget.sources():
            if source.place:
                yield f"{place}.{source.place}.topic", source.topic
    if isinstance(widget, PublishPress) and widget.confirm is not None:
        yield f"{place}.confirm.topic", widget.confirm.topic
