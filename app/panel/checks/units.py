"""Notes about a number that is entered in one unit and fills a field of another."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Final

from app.errors import InterfaceError, Note
from app.interfaces import Interfaces, field_name, parent_path
from app.panel.model import Panel
from app.panel.template import placeholders, value_at
from app.panel.units import units_like
from app.panel.widgets.families import Command
from app.panel.widgets.numbers import Numeric
from app.panel.widgets.sent_message import SentMessage

# ROS 2 has metres and radians (REP 103): by the type that holds the field, and by the name of a vector.
OF_TYPE: Final = {"geometry_msgs/msg/Point": "m", "geometry_msgs/msg/Point32": "m"}
VECTOR: Final = "geometry_msgs/msg/Vector3"
OF_VECTOR: Final = {"linear": "m/s", "angular": "rad/s", "translation": "m"}
# By what a field's name ends with.
OF_NAME: Final = {
    "mm": "mm", "m": "m", "meters": "m", "mps": "m/s", "rad": "rad", "radians": "rad", "deg": "°",
    "ms": "ms", "s": "s", "sec": "s", "kelvin": "K", "celsius": "°C", "rpm": "rpm",
}  # fmt: skip


def unit_notes(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """Each input whose number leaves in another unit than the field that it fills has."""
    for p, page in enumerate(panel.pages):
        numbers = {widget.id: widget for widget in page.widgets if isinstance(widget, Numeric)}
        for place, widget in page.placed():
            if isinstance(widget, Command):
                for sent in widget.sent_messages(interfaces):
                    for message in _messages(sent, numbers, interfaces):
                        yield Note(f"page[{p}].{place}", message)


def _messages(
    sent: SentMessage, numbers: Mapping[str, Numeric], interfaces: Interfaces
) -> Iterator[str]:
    for where, name in placeholders(sent.fields) if sent.type_name else ():
        entry = numbers.get(name)
        if entry is None or value_at(sent.fields, where) not in (f"{{{name}}}", f"-{{{name}}}"):
            continue
        unit = entry.send_unit or ("" if entry.is_converted else str(entry.unit))
        with suppress(InterfaceError):
            field_unit = _unit_at(sent.type_name, where, interfaces)
            if unit != field_unit and unit in units_like(field_unit):
                right = f'write send_unit = "{field_unit}" at the input, or scale and offset'
                yield f'input "{name}" gives {unit}, and {where} is in {field_unit}: {right}'


def _unit_at(type_name: str, path: str, interfaces: Interfaces) -> str:
    """The unit of a field as far as its name or the type around it says it, else ""."""
    parent, name = parent_path(path), field_name(path)
    holder = str(interfaces.type_at(type_name, parent).element) if parent else type_name
    if holder in OF_TYPE:
        return OF_TYPE[holder]
    if holder == VECTOR and parent:
        return OF_VECTOR.get(field_name(parent), "")
    return OF_NAME.get(name.split("_")[-1], "") if "_" in name else ""
