"""The texts of each kind of widgets and their places, from the sizes that static/css gives them.

tests/browser/test_widths_in_browser.py holds them against a browser. What has no known longest text is
not measured: values of topics without a scale, receipts, and the server's own sentences.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from app.panel.condition import Condition, Interlock, NamedCondition
from app.panel.values import number_text
from app.panel.widgets.displays import (
    Camera,
    Conditions,
    Indicator,
    LogView,
    PageLink,
    Pallet,
    Picture,
    TextLabel,
)
from app.panel.widgets.families import BaseWidget, KeyCommand
from app.panel.widgets.gauge import Figure, Gauge
from app.panel.widgets.hold import Joystick
from app.panel.widgets.inputs import SelectInput, ToggleInput
from app.panel.widgets.joints import Joints
from app.panel.widgets.kinds import find_row
from app.panel.widgets.map_view import MapView
from app.panel.widgets.numbers import Numeric, SliderInput
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.place import MapInput
from app.panel.widgets.publish import Step
from app.panel.widgets.sequence import Sequence as SequenceWidget
from app.panel.widgets.service_action import Action
from app.panel.widgets.switch import Switch
from app.panel.widgets.table import Table
from app.panel.widgets.templated import is_stop
from app.panel.widgets.tiles import ENTRY_MM, GAP_MM, KEY_MM, LOW_SCREEN, MIDDLE, STEP_SIDES
from app.panel.widths.boxes import Box, Cell
from app.panel.widths.fonts import text_width
from app.system.texts import PanelText, TextLike, say
from app.system.texts import number as text_number
from app.system.texts.text import changed, each_language, together

# The longest values that a panel file knows of: the ends of scales and limits, and units.

SOME_VALUE: Final = "00"  # of a value in a sentence whose own length is not known


def formatted(value: float, style: str | None) -> TextLike:
    """A number as it is shown, in a format of the panel file."""
    if style is None:
        return text_number(number_text(float(value)))
    return text_number(format(int(value) if style.endswith("d") else value, style))


def ends(low: float, high: float, style: str | None) -> Iterator[TextLike]:
    """The lowest and the highest number, as they are shown, with the digits of the format."""
    yield from (formatted(value, style) for value in (low, high) if math.isfinite(value))


def after_gap(unit: str | PanelText) -> TextLike:
    """A unit behind a number; "" without one."""
    return together([" ", unit]) if unit else ""


def with_some_value(text: str | PanelText) -> str | PanelText:
    """A text of the panel file whose {value} is not known."""
    return changed(text, lambda translation: translation.replace("{value}", SOME_VALUE))


Texts = Callable[[Any, Cell], Iterator[Box]]
BORDERS: Final = 3.0  # of a button, left and right
FACE_PAD: Final = 16.0
NARROW_FACE, NARROW_LABEL = 160.0, 17.0  # up to this width a button's label has this size
LAMP: Final = 46.0  # with the gap beside it, as the following ones
STEP_NUMBER: Final = 38.0
LEAST_LIMITS: Final = 3.0  # of what stands beside a label, in the size of its letters
MARKS: Final = 26.0  # of a value that is not normal
TOP: Final = 0.6  # of its width: the title of a sequence
SWITCH_GAP: Final = 12.0
CANCEL_PAD: Final = 15.0  # with the borders
FIELD_PAD: Final = 27.0  # of an input, with its borders
PICKER: Final = 24.0  # the arrow of a choice
NO_NAMES: Final = 620.0  # on a lower screen the name of a figure is only read aloud
JOINT_NAME_EM: Final = 7.0
MANY: Final = 99  # lines of a text that makes its place higher


def texts(widget: BaseWidget, cell: Cell) -> Iterator[Box]:
    """The texts of a widget in their places; a label may be only read aloud."""
    boxes = find_row(TEXTS, widget)(widget, cell)
    yield from (box for box in boxes if widget.show_label or box.part != "label")


def face_texts(widget: KeyCommand, inside: float, cell: Cell, size: float = 0.0) -> Iterator[Box]:
    """Label and note of a button with this width inside, and this size of the label. The label has one
    line while the button is locked, as any may be."""
    size = size or (NARROW_LABEL if inside <= NARROW_FACE else cell.sizes.label)
    yield Box("label", widget.label, inside, size, bold=True, wraps=True, name="button", locked=True)
    if widget.note:
        yield Box("note", widget.note, inside, cell.sizes.small, lines=2, wraps=True, name="button")


def _label(widget: BaseWidget, cell: Cell) -> Iterator[Box]:
    yield Box("label", widget.label, cell.width, cell.sizes.small)


def _nothing(widget: BaseWidget, cell: Cell) -> Iterator[Box]:
    yield from ()


def _key(widget: KeyCommand, cell: Cell) -> Iterator[Box]:
    yield from face_texts(widget, cell.width - FACE_PAD, cell)


def _action(widget: Action, cell: Cell) -> Iterator[Box]:
    for box in face_texts(widget, cell.width - FACE_PAD, cell):
        yield beside_cancel(box, cell)


def beside_cancel(box: Box, cell: Cell) -> Box:
    """A text beside the button that cancels, which takes a third, or what its word needs."""
    width = box.width - GAP_MM * cell.screen.mm - CANCEL_PAD
    size = cell.sizes.text if cell.width <= 380 else cell.sizes.label
    third = (cell.width - GAP_MM * cell.screen.mm) / 3 - CANCEL_PAD
    named = replace(box, width=width, beside=say("cancel"), beside_size=size, beside_bold=True)
    return replace(named, least_beside=third)


def _link(widget: PageLink, cell: Cell) -> Iterator[Box]:
    width = cell.width - FACE_PAD - BORDERS
    yield Box("label", widget.label, width, cell.sizes.label, lines=2, wraps=True, name="button")


def _text_label(widget: TextLabel, cell: Cell) -> Iterator[Box]:
    sizes = {"small": cell.sizes.small, "normal": cell.sizes.text, "large": cell.sizes.value}
    is_large = widget.size == "large"
    yield Box("label", widget.label, cell.width, sizes[widget.size], is_large, lines=MANY, wraps=True)


def _indicator(widget: Indicator, cell: Cell) -> Iterator[Box]:
    width = cell.width - LAMP
    yield Box("label", widget.label, width, cell.sizes.small)
    size = cell.sizes.text if cell.width <= 180 else cell.sizes.label
    for number, state in enumerate(widget.states):
        part, lines = f"states[{number}].text", 1 if cell.fit else 2
        yield Box(part, state.text, width, size, bold=True, lines=lines, wraps=not cell.fit)


def _figure(widget: Figure, cell: Cell) -> Iterator[Box]:
    if cell.screen.height > NO_NAMES:
        yield from _label(widget, cell)
    if not isinstance(widget.target, float):
        return
    is_small = cell.width <= 300
    size = 48.0 if is_small or cell.screen.height <= LOW_SCREEN else 64.0
    target = formatted(widget.target, None)
    rest = together([" ", say("figure_target", target=target), after_gap(widget.unit)])
    width = cell.width - _beside(widget, cell)
    number = formatted(widget.target, widget.format)
    rest_size = cell.sizes.label if is_small else 24.0
    yield Box("target", number, width, size, bold=True, after=rest, after_size=rest_size)


def _beside(figure: Figure, cell: Cell) -> float:
    """The width of the lines beside the number, with the gap."""
    widths = [
        text_width(text, cell.sizes.small if number else cell.sizes.label, cell.fonts, bold=not number)
        for number, line in enumerate(figure.lines)
        for text in each_language(with_some_value(line.text)).values()
    ]
    return 12 + max(widths) if widths else 0.0


def _gauge(widget: Gauge, cell: Cell) -> Iterator[Box]:
    if widget.orientation == "horizontal":
        return
    yield Box("label", widget.label, cell.width - MARKS, cell.sizes.small)
    is_tall = cell.fit and cell.width >= 250
    scale = 142.0 if is_tall else 80.0 if cell.width >= 150 else 48.0
    width = cell.width - scale - 5
    size = cell.sizes.label if cell.width <= 170 else cell.sizes.value
    yield from _numbers(widget, width, size, cell)


def _numbers(widget: Gauge | Step, width: float, size: float, cell: Cell) -> Iterator[Box]:
    """The ends of a scale, each with its unit, which is smaller."""
    unit = after_gap(widget.unit)
    for number in ends(widget.min, widget.max, widget.format):
        yield Box("value", number, width, size, bold=True, after=unit, after_size=cell.sizes.small)


def _number(widget: Numeric, cell: Cell) -> Iterator[Box]:
    """With the limits beside the label: on a narrow one the range only, else what is left of them."""
    named = together([widget.label, " (", widget.unit, ")"]) if widget.unit else widget.label
    least = LEAST_LIMITS * cell.sizes.small
    box = Box("label", named, cell.width - 8, cell.sizes.small)
    is_narrow = cell.width <= 330
    yield (
        replace(box, beside=widget.range_text, least_beside=least)
        if is_narrow
        else replace(box, width=box.width - least)
    )
    if isinstance(widget, SliderInput):
        return
    steps = 0.0 if cell.width <= 200 else 2 * (cell.screen.touch(ENTRY_MM) + 8)
    for number in ends(widget.min, widget.max, None):
        yield Box("value", number, cell.width - steps - FIELD_PAD, cell.sizes.label, bold=True)


def _parameter(widget: Parameter, cell: Cell) -> Iterator[Box]:
    limits = 8 + LEAST_LIMITS * cell.sizes.small
    yield Box("label", widget.label, cell.width - limits, cell.sizes.small)


def _pallet(widget: Pallet, cell: Cell) -> Iterator[Box]:
    if cell.screen.height > NO_NAMES:
        yield from _label(widget, cell)


def _select(widget: SelectInput, cell: Cell) -> Iterator[Box]:
    yield from _label(widget, cell)
    width = cell.width - FIELD_PAD - PICKER
    for number, option in enumerate(widget.options or ()):
        yield Box(f"options[{number}].label", option.label, width, cell.sizes.label)


def _toggle(widget: ToggleInput, cell: Cell) -> Iterator[Box]:
    yield from _label(widget, cell)
    entry = cell.screen.touch(ENTRY_MM)
    slide = 1.5 * entry if cell.width <= 200 else 2 * entry - SWITCH_GAP
    width = cell.width - slide - SWITCH_GAP
    for part, text in (("on", widget.on), ("off", widget.off)):
        yield Box(part, text, width, cell.sizes.label, bold=True, lines=2, wraps=True)


def _switch(widget: Switch, cell: Cell) -> Iterator[Box]:
    yield Box("label", widget.label, cell.width - 8, cell.sizes.small)
    is_narrow = cell.width <= 200
    size = cell.sizes.text if is_narrow else cell.sizes.label
    width = (cell.width - BORDERS) / 2 - (1.5 if is_narrow else 13.5)
    for part, text in (("on", widget.on), ("off", widget.off)):
        yield Box(part, text, width, size, bold=True, name="button")


def _step(widget: Step, cell: Cell) -> Iterator[Box]:
    width = step_width(cell)
    yield Box("label", widget.label, width, cell.sizes.small)
    size = cell.sizes.label if cell.width <= 330 else cell.sizes.value
    yield from _numbers(widget, width, size, cell)


def step_width(cell: Cell) -> float:
    """The width between the buttons of a step, or above them."""
    if cell.width < STEP_SIDES:
        return cell.width
    return cell.width - 2 * cell.screen.touch(KEY_MM) - 16


def _table(widget: Table, cell: Cell) -> Iterator[Box]:
    yield from _label(widget, cell)
    last = len(widget.columns) - 1
    size = cell.sizes.text if cell.screen.height <= LOW_SCREEN else 18.0
    for number, (column, percent) in enumerate(zip(widget.columns, widget.widths, strict=True)):
        width = cell.width * percent / 100 - (0 if number == last else 10)
        place = f"column[{number}]"
        yield Box(f"{place}.label", column.label, width, cell.sizes.small)
        for s, state in enumerate(column.states):
            yield Box(f"{place}.states[{s}].text", state.text, width - 32, size, bold=True)


def _joints(widget: Joints, cell: Cell) -> Iterator[Box]:
    yield from _label(widget, cell)
    size = cell.sizes.text
    for number, joint in enumerate(widget.joints):
        part, width = f"joint[{number}].label", JOINT_NAME_EM * size
        yield Box(part, joint.shown_label, width, size, bold=True)


def _sequence(widget: SequenceWidget, cell: Cell) -> Iterator[Box]:
    beside = widget.has_picture and cell.screen.width < MIDDLE
    width = ((cell.width - 12) * 3 / 5 if beside else cell.width) - 12 - STEP_NUMBER
    is_low = cell.screen.height <= NO_NAMES
    height = 40.0 if is_low else 46.0
    yield Box("label", widget.label, TOP * cell.width, cell.sizes.text, bold=True)
    for place, step in widget.all_steps:
        left = height - 14 * 1.1 if step.note else height
        lines = max(1, int(left / (cell.sizes.text * 1.1)))
        if step.text is not None:
            part = f"{place}.text"
            yield Box(part, step.text, width, cell.sizes.text, bold=True, lines=lines, wraps=True)
        if step.note is not None:
            yield Box(f"{place}.note", step.note, width, 14.0, wraps=True)


TEXTS: Final[Mapping[type[BaseWidget], Texts]] = {
    BaseWidget: _label,
    KeyCommand: _key,
    Action: _action,
    Joystick: _nothing,
    Camera: _nothing,
    Conditions: _nothing,
    LogView: _nothing,
    MapView: _nothing,
    Pallet: _pallet,
    MapInput: _label,
    Parameter: _parameter,
    PageLink: _link,
    TextLabel: _text_label,
    Picture: _nothing,
    Indicator: _indicator,
    Figure: _figure,
    Gauge: _gauge,
    Numeric: _number,
    SelectInput: _select,
    ToggleInput: _toggle,
    Switch: _switch,
    Step: _step,
    Table: _table,
    Joints: _joints,
    SequenceWidget: _sequence,
}


# The sentences by which interlocks lock a button, and whether they have room on it.

ICON: Final = 15.0
# The heights of a button's face, in the size of small texts, from which on a reason has so many lines.
LINES: Final = ((7.7, 5), (6.5, 4), (5.4, 3))
JAPANESE_LINES: Final = ((8.6, 5), (7.4, 4), (6.2, 3))  # which are higher
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
    return text_number(number_text(float(value)), condition.unit)


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


def stop_hint_text(
    widget: BaseWidget, hint: TextLike, cell: Cell, inside: float = 0.0
) -> Iterator[Box]:
    """What a stop button says before the reason of its lock; see `reason_texts`."""
    if not isinstance(widget, KeyCommand) or not is_stop(widget):
        return
    size = cell.sizes.small
    box = Box(
        "stop_hint",
        hint,
        inside or cell.width - FACE_PAD,
        size,
        lines=face_lines(cell, JAPANESE_LINES),
        wraps=True,
        indent=ICON + text_width(" ", size, cell.fonts),
        after="…",  # of the reason behind it
        name="button",
    )
    yield beside_cancel(box, cell) if isinstance(widget, Action) else box


def face_lines(cell: Cell, heights: Sequence[tuple[float, int]] = LINES) -> int:
    """How many lines a reason has on a button of this height."""
    height = (cell.height - FACE_PADS) / cell.sizes.small
    return next((lines for least, lines in heights if height >= least), LEAST_LINES)


# The rows of a check list of conditions: each with its name, its value and what to do.

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
