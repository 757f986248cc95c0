"""Faults of missing or unusable types, and of fields that a type does not have."""

from collections.abc import Collection, Iterator
from typing import Final

from app.panel.numbers import NUMBERS
from app.ros.messages import Interfaces
from app.system.errors import Fault, InterfaceError

# The type that the server needs for its log.
ROSOUT: Final = "rcl_interfaces/msg/Log"
LEFT_OUT: Final = "data"  # the field where none is named
MOST: Final = 4  # paths that a fault proposes


def type_fault(place: str, error: InterfaceError) -> Fault:
    """The fault of an unusable type. Its cause is the file, package or name, which several types may
    share."""
    return Fault(place, str(error), cause=f"type {error.source or error.cause or error}")


def way_faults(place: str, type_name: str, *, of_service: bool) -> Iterator[Fault]:
    """A fault of the type of a topic where a service is named in the table at `place`, or the other way
    around."""
    if ("/srv/" in type_name) != of_service:
        kind, right = (
            ("service", "std_srvs/srv/Trigger") if of_service else ("topic", "std_msgs/msg/String")
        )
        message = f'"{type_name}" is no type of a {kind}: it must be like {right}'
        yield Fault(f"{place}.type", message)


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


def value_faults(
    place: str,
    type_name: str,
    path: str,
    who: str,
    interfaces: Interfaces,
    whole_types: Collection[str] = (),
) -> Iterator[Fault]:
    """The same, and of a field that is a message or a list where `who` ("a lamp") takes a single value,
    or a message of one of `whole_types`."""
    faults = list(field_faults(place, type_name, path, interfaces))
    yield from faults
    if faults:
        return
    kind = interfaces.type_at(type_name, path)
    if kind.container != "one" or (kind.is_nested and str(kind) not in whole_types):
        structure = interfaces.structures.get(kind.name) if kind.container == "one" else None
        inner = [f"{path}.{field.name}" for field in structure.fields] if structure else [f"{path}[0]"]
        message = f'"{path}" is {kind}: {who} takes one value of it, not all'
        yield Fault(f"{place}.field", f"{message}; write {' or '.join(inner[:MOST])}")


def number_faults(
    place: str, type_name: str, path: str, who: str, interfaces: Interfaces
) -> Iterator[Fault]:
    """The same of a field that is no number, where `who` ("a target") is one."""
    faults = list(value_faults(place, type_name, path, who, interfaces))
    yield from faults
    if not faults and (kind := interfaces.field_type(type_name, path)) not in NUMBERS:
        yield Fault(f"{place}.field", f'"{path}" is {kind}: {who} takes a number')


def entry_faults(
    place: str,
    type_name: str,
    listed: str,
    field: str | None,
    who: str,
    interfaces: Interfaces,
    whole_types: Collection[str] = (),
) -> Iterator[Fault]:
    """The same of a field of each entry of the list `listed`, or of the entry itself; the fault is at
    `place`."""
    path = f"{listed}[0].{field}" if field else f"{listed}[0]"
    for fault in field_faults("", type_name, path, interfaces):
        yield Fault(place, fault.message)
        return
    kind = interfaces.type_at(type_name, path)
    if kind.container != "one" or (kind.is_nested and str(kind) not in whole_types):
        named = f'"{field}" of an entry' if field else "an entry"
        yield Fault(place, f"{named} is {kind}: {who} takes one value of it, not all")
