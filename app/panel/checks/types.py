"""Faults of missing or unusable types, and of fields that a type does not have."""

from collections.abc import Iterator
from typing import Final

from app.ros.messages import Interfaces
from app.ros.messages.definitions import Type
from app.system.errors import Fault, InterfaceError

# The type that the server needs for its log.
ROSOUT: Final = "rcl_interfaces/msg/Log"
LEFT_OUT: Final = "data"  # the field where none is named
MOST: Final = 4  # paths that a message proposes


def type_fault(place: str, error: InterfaceError) -> Fault:
    """The fault of an unusable type. Its cause is the file, package or name, which several types may
    share."""
    return Fault(place, str(error), cause=f"type {error.source or error.package or error}")


def field_faults(place: str, type_name: str, path: str, interfaces: Interfaces) -> Iterator[Fault]:
    """Faults of a missing type, or of a field that it does not have; `place` contains both keys."""
    try:
        interfaces.require(type_name)
    except InterfaceError as error:
        yield type_fault(f"{place}.type", error)
        return
    try:
        interfaces.field_type(type_name, path)
    except InterfaceError as error:
        left_out = f"{error}; data counts where no field is named" if path == LEFT_OUT else str(error)
        yield Fault(f"{place}.field", left_out)


def whole_field(path: str, kind: Type, widget_kind: str, interfaces: Interfaces) -> str:
    """That a widget needs a single value, and not a message or a list; with the paths in it."""
    who = f"an {widget_kind}" if widget_kind[0] in "aeiou" else f"a {widget_kind}"
    structure = interfaces.structures.get(kind.name) if kind.container == "one" else None
    inner = [f"{path}.{field.name}" for field in structure.fields] if structure else [f"{path}[0]"]
    return (
        f'"{path}" is {kind}: {who} shows one value of it, not all; write {" or ".join(inner[:MOST])}'
    )
