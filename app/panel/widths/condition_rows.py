"""The rows of a check list of conditions: each with its name, its value and what to do."""

from collections.abc import Iterator, Mapping
from typing import Final

from app.i18n import TextLike, say
from app.panel.condition import NamedCondition
from app.panel.widgets.conditions import Conditions
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.tiles import LOW_SCREEN
from app.panel.widths.boxes import Box, Cell
from app.panel.widths.reasons import some_value

SIGN: Final = 26.0
GAP: Final = 10.0  # beside the sign and the value
ROW, LOW_ROW = 42.0, 36.0
SMALL: Final = 14.0
LINE: Final = 1.1  # the height of a line in the size of its letters


def condition_texts(
    widget: BaseWidget, conditions: Mapping[str, NamedCondition], cell: Cell
) -> Iterator[Box]:
    """The rows as they are while none of the conditions is met: their letters are bold then. What is
    below a name has one line."""
    if not isinstance(widget, Conditions):
        return
    height = LOW_ROW if cell.screen.height <= LOW_SCREEN else ROW
    width, size = cell.width - SIGN - 2 * GAP, cell.sizes.text
    for place, name in enumerate(widget.conditions):
        condition = conditions[name]
        value: TextLike = say("condition_unmet")
        if condition.comparisons:
            value = some_value(condition)
        has_more = condition.comparisons or condition.action is not None
        lines = int((height - (SMALL * LINE if has_more else 0)) / (size * LINE))
        box = Box(
            f"conditions[{place}]",
            condition.name,
            width,
            size,
            bold=True,
            lines=max(1, lines),
            wraps=True,
            beside=value,
            beside_size=size,
            beside_bold=True,
            name="row",
        )
        yield box
        if condition.action is not None:
            yield Box(
                f"conditions[{place}] action",
                condition.action,
                width,
                SMALL,
                wraps=True,
                beside=value,
                beside_size=size,
                beside_bold=True,
                name="row",
            )
