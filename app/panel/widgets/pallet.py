"""A plan of a pallet that a count fills, box by box and layer by layer."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from app.errors import Fault
from app.interfaces import INTEGER_RANGES, Interfaces
from app.panel.base import Span
from app.panel.widgets.families import Display


class Pallet(Display):
    """Shows the layer that is filled: `across` boxes in a row, `along` rows, and `layers` of them."""

    kind: Literal["pallet"]
    across: Annotated[int, Field(ge=1, le=30)]
    along: Annotated[int, Field(ge=1, le=30)]
    layers: Annotated[int, Field(ge=1, le=100)] = 1
    span: Span = 4

    @property
    def in_layer(self) -> int:
        """The boxes of one layer."""
        return self.across * self.along

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        if field_type not in INTEGER_RANGES:
            message = f'"{self.field}" is {field_type}: a pallet is filled by a whole number'
            yield Fault(f"{place}.field", message)
