"""A check list of interlocks and conditions."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from app.errors import Fault
from app.panel.base import Interlocks, Span
from app.panel.faults.wording import list_names
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource


def name_faults(place: str, widget: DisplayWidget, checking: CheckContext) -> Iterator[Fault]:
    """Faults of an id in a list at `place` that is of no condition."""
    known = list_names(checking.conditions)
    for name in widget.named_conditions:
        if name not in checking.conditions:
            message = f'no interlock or condition "{name}"; there is {known}'
            yield Fault(place, message, cause=f"interlock {name}")


class Conditions(DisplayWidget):
    """Shows interlocks and conditions, those that are not met first; at most `rows_shown` of them."""

    kind: Literal["conditions"]
    conditions: Interlocks
    rows_shown: Annotated[int, Field(ge=1, le=20)] = 4
    span: Span = 6

    @property
    def rows_at_most(self) -> int:
        return min(self.rows_shown, len(self.conditions))

    @property
    def named_conditions(self) -> tuple[str, ...]:
        return self.conditions

    def sources(self) -> Iterator[TopicSource]:
        yield from ()  # the panel listens to its conditions

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from name_faults(f"{place}.conditions", self, checking)
