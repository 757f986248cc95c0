"""Fields that a widget reads beside its own: a number of the file or of a topic, and their checks."""

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any

from pydantic import GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue

from app.errors import Fault
from app.interfaces import Interfaces
from app.interfaces.validation import format_value
from app.panel.checks.types import field_faults
from app.panel.constants import NUMBERS
from app.panel.widgets.families import TopicField
from app.panel.widgets.numbers import MAX_EXACT_NUMBER


class OrNumber:
    """A JSON schema that has a number beside the table."""

    def __get_pydantic_json_schema__(
        self, schema: Any, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [{"type": "number"}, handler(schema)]}


def number_or_table(value: Any, validate: Any) -> Any:
    """A number, or the table of a field of a topic that has it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if number and isfinite(value) and abs(value) <= MAX_EXACT_NUMBER:
        return float(value)
    if isinstance(value, Mapping):
        return validate(value)
    expected = 'a number, or a table like { topic = "/setpoint", type = "std_msgs/msg/Float64" }'
    raise ValueError(f"must be {expected}, not {format_value(value)}")


def number_field_faults(
    place: str, source: TopicField, noun: str, interfaces: Interfaces
) -> Iterator[Fault]:
    """Faults of a field that must be one number; `noun` names it, with its article."""
    faults = list(field_faults(place, source.type, source.field, interfaces))
    yield from faults
    if not faults and (field_type := interfaces.field_type(source.type, source.field)) not in NUMBERS:
        yield Fault(f"{place}.field", f'"{source.field}" is {field_type}: {noun} is a number')
