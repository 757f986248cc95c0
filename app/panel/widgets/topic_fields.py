"""Checks of fields that a widget reads beside its own."""

from collections.abc import Iterator

from app.errors import Fault
from app.interfaces import Interfaces
from app.panel.checks.types import field_faults
from app.panel.constants import NUMBERS
from app.panel.widgets.families import TopicField


def number_field_faults(
    place: str, source: TopicField, noun: str, interfaces: Interfaces
) -> Iterator[Fault]:
    """Faults of a field that must be one number; `noun` names it, with its article."""
    faults = list(field_faults(place, source.type, source.field, interfaces))
    yield from faults
    if not faults and (field_type := interfaces.field_type(source.type, source.field)) not in NUMBERS:
        yield Fault(f"{place}.field", f'"{source.field}" is {field_type}: {noun} is a number')
