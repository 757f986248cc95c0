"""The sentences by which interlocks lock a button, and whether they have room on it."""

from collections.abc import Iterator, Mapping
from typing import Final

from app.i18n import TextLike, number, say
from app.panel.condition import Condition
from app.panel.interlock import Interlock
from app.panel.values import number_text
from app.panel.widgets.families import BaseWidget, KeyCommand
from app.panel.widgets.joystick import Joystick
from app.panel.widgets.service_action import Action
from app.panel.widgets.step import Step
from app.panel.widths.boxes import Box, Cell
from app.panel.widths.letters import text_width
from app.panel.widths.texts import FACE_PAD, beside_cancel, step_width
from app.panel.widths.values import with_some_value

ICON: Final = 15.0
# The heights of a button's face, in the size of small texts, from which on a reason has so many lines.
LINES: Final = ((7.7, 5), (6.5, 4), (5.4, 3))
LEAST_LINES: Final = 2
STEP_REASON: Final = 14.0
FACE_PADS: Final = 6.0  # above and below


def sentence(interlock: Interlock) -> TextLike:
    """What an interlock says where the robot's value does not meet it."""
    if interlock.locked is not None:
        return with_some_value(interlock.locked)
    if not interlock.comparisons:
        return say("interlock_not_permitted", name=interlock.name)
    wanted = some_value(interlock)
    return say("interlock_condition_unmet", name=interlock.name, value=wanted, wanted=wanted)


def some_value(condition: Condition) -> TextLike:
    """A value that a condition with comparisons has, as a sentence names it."""
    value = next(iter(condition.comparisons.values()))
    if isinstance(value, tuple):
        value = value[0]
    if isinstance(value, bool) or not isinstance(value, int | float):
        return f'"{value}"'
    return number(number_text(float(value)), condition.unit)


def reason_texts(
    widget: BaseWidget, interlocks: Mapping[str, Interlock], cell: Cell, *, inside: float = 0.0
) -> Iterator[Box]:
    """The reason of each interlock of a button; `inside` is the width of its face, where it is not in a
    cell."""
    if not isinstance(widget, KeyCommand | Step) or isinstance(widget, Joystick):
        return
    width, size, lines = inside or cell.width - FACE_PAD, cell.sizes.small, face_lines(cell)
    if isinstance(widget, Step):
        width, size, lines = step_width(cell), STEP_REASON, LEAST_LINES
    others = len(widget.interlocks) - 1
    more: TextLike = say("more_reasons", number=others) if others > 0 else ""
    for place, name in enumerate(widget.interlocks):
        box = Box(
            f"interlock[{place}]" if others else "interlock",
            sentence(interlocks[name]),
            width,
            size,
            lines=lines,
            wraps=True,
            indent=ICON + text_width(" ", size, cell.fonts),
            after=more,
            after_bold=True,
            name="button",
        )
        yield beside_cancel(box, cell) if isinstance(widget, Action) else box


def face_lines(cell: Cell) -> int:
    """How many lines a reason has on a button of this height."""
    height = (cell.height - FACE_PADS) / cell.sizes.small
    return next((lines for least, lines in LINES if height >= least), LEAST_LINES)
