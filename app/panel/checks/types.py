"""Faults of missing or unusable types, and of fields that a type does not have."""

from collections.abc import Iterator
from typing import Final

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces

# The type that the server needs for its log.
ROSOUT: Final = "rcl_interfaces/msg/Log"


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
        yield Fault(f"{place}.field", str(error))
