"""Types that are not there or can't be used, and fields that a type does not have."""

from collections.abc import Iterator
from typing import Final

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces

# What the kiosk says beside what widgets are for.
ROSOUT: Final = "rcl_interfaces/msg/Log"


def type_fault(place: str, error: InterfaceError) -> Fault:
    """A type that can't be used; one file, package or name that is wrong may be that of several."""
    return Fault(place, str(error), cause=f"type {error.source or error.package or error}")


def field_faults(place: str, type_name: str, path: str, interfaces: Interfaces) -> Iterator[Fault]:
    """A type that is not there, a field that it does not have; `place` has both keys."""
    try:
        interfaces.require(type_name)
    except InterfaceError as error:
        yield type_fault(f"{place}.type", error)
        return
    try:
        interfaces.field_type(type_name, path)
    except InterfaceError as error:
        yield Fault(f"{place}.field", str(error))
