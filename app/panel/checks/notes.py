"""Hints about a panel that are no faults; `python -m app.check` prints them."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Final

from app.panel.base import Label
from app.panel.checks.fit import fit_notes
from app.panel.checks.look import unplaced_notes
from app.panel.checks.memory import NO_MEMORY, CheckMemory
from app.panel.checks.panel import untranslated_notes
from app.panel.checks.robot_texts import robot_text_notes
from app.panel.checks.state_words import state_word_notes
from app.panel.model import Panel
from app.panel.numbers import units_like
from app.panel.template import placeholders, value_at
from app.panel.widgets.families import Command, SentMessage
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.key_parts import ConfirmationKeys
from app.panel.widgets.numbers import Numeric
from app.panel.widgets.service_action import Action
from app.panel.widgets.trend import Trend, history_bytes
from app.panel.widths.cut_texts import cut_notes
from app.ros.messages import Interfaces, field_name, parent_path
from app.system.errors import InterfaceError, Note

# Notes about a number that is entered in one unit and fills a field of another.

# ROS 2 has metres and radians (REP 103): by the type that holds the field, and by the name of a vector.
OF_TYPE: Final = {"geometry_msgs/msg/Point": "m", "geometry_msgs/msg/Point32": "m"}
VECTOR: Final = "geometry_msgs/msg/Vector3"
OF_VECTOR: Final = {"linear": "m/s", "angular": "rad/s", "translation": "m"}
# By what a field's name ends with.
OF_NAME: Final = {
    "mm": "mm", "m": "m", "meters": "m", "mps": "m/s", "rad": "rad", "radians": "rad", "deg": "°",
    "ms": "ms", "s": "s", "sec": "s", "kelvin": "K", "celsius": "°C", "rpm": "rpm",
}  # fmt: skip


def unit_notes(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """Each input whose number leaves in another unit than the field that it fills has."""
    for p, page in enumerate(panel.pages):
        numbers = {widget.id: widget for widget in page.widgets if isinstance(widget, Numeric)}
        for place, widget in page.placed():
            if isinstance(widget, Command):
                for sent in widget.sent_messages(interfaces):
                    for message in _messages(sent, numbers, interfaces):
                        yield Note(f"page[{p}].{place}", message)


def _messages(
    sent: SentMessage, numbers: Mapping[str, Numeric], interfaces: Interfaces
) -> Iterator[str]:
    for where, name in placeholders(sent.fields) if sent.type_name else ():
        entry = numbers.get(name)
        if entry is None or value_at(sent.fields, where) not in (f"{{{name}}}", f"-{{{name}}}"):
            continue
        unit = entry.send_unit or ("" if entry.is_converted else str(entry.unit))
        with suppress(InterfaceError):
            field_unit = _unit_at(sent.type_name, where, interfaces)
            if unit != field_unit and unit in units_like(field_unit):
                right = f'write send_unit = "{field_unit}" at the input, or scale and offset'
                yield f'input "{name}" gives {unit}, and {where} is in {field_unit}: {right}'


def _unit_at(type_name: str, path: str, interfaces: Interfaces) -> str:
    """The unit of a field as far as its name or the type around it says it, else ""."""
    parent, name = parent_path(path), field_name(path)
    holder = str(interfaces.type_at(type_name, parent).element) if parent else type_name
    if holder in OF_TYPE:
        return OF_TYPE[holder]
    if holder == VECTOR and parent:
        return OF_VECTOR.get(field_name(parent), "")
    return OF_NAME.get(name.split("_")[-1], "") if "_" in name else ""


MOVING: Final = (HoldCommand, Action)


def find_notes(panel: Panel, interfaces: Interfaces, memory: CheckMemory = NO_MEMORY) -> Iterator[Note]:
    """All notes with their places in the panel file, without ids and lines."""
    yield from _stop_notes(panel)
    yield from _unbounded_trust_notes(panel)
    yield from _embedded_controls_notes(panel)
    yield from _unused_interlock_notes(panel)
    yield from _unsaid_interlock_notes(panel)
    yield from _wordless_label_notes(panel)
    yield from _unasked_notes(panel)
    yield from _unused_source_notes(panel)
    yield from robot_text_notes(panel, interfaces)
    yield from _unusable_type_notes(panel, interfaces)
    yield from _trend_notes(panel)
    yield from state_word_notes(panel)
    yield from unit_notes(panel, interfaces)
    yield from fit_notes(panel)
    yield from cut_notes(panel, memory)
    yield from unplaced_notes(panel)
    yield from untranslated_notes(panel)


def _stop_notes(panel: Panel) -> Iterator[Note]:
    """The first widget that moves the robot, where Stop is not on every page."""
    if any(widget in panel.stops for widget in panel.frame.widgets):
        return
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            if isinstance(widget, MOVING) or getattr(widget, "role", "") == "start":
                message = (
                    "can move the robot, and Stop is not on every page: add a [[frame.widget]] with "
                    'role = "stop"'
                )
                yield Note(f"page[{p}].{place}", message)
                return


def _unbounded_trust_notes(panel: Panel) -> Iterator[Note]:
    """Interlocks whose last value counts without a limit: see docs/permissions.md."""
    for i, interlock in enumerate(panel.interlocks):
        if interlock.max_age_s is None and not interlock.require_publisher:
            yield Note(
                f"interlock[{i}]",
                f"the last value on {interlock.topic} counts for as long as the bridge is connected, "
                "also when its publisher is gone or one of its messages is lost: give max_age_s where "
                "it is published regularly, or require_publisher = true where its publisher stays",
            )


def _embedded_controls_notes(panel: Panel) -> Iterator[Note]:
    """Controls in pages of others."""
    if panel.embed.controls and panel.embed.origins:
        yield Note(
            "embed.controls",
            "a page that embeds this panel can lay something over a button, so that an operator "
            "presses without seeing it: list only origins that you trust as much as the panel",
        )


def _unused_interlock_notes(panel: Panel) -> Iterator[Note]:
    """Interlocks that no control uses."""
    used = {name for widget in panel.commands for name in widget.interlocks}
    for i, interlock in enumerate(panel.interlocks):
        if interlock.id not in used:
            message = f'locks nothing: no control has interlock = "{interlock.id}"'
            yield Note(f"interlock[{i}]", message)


def _unsaid_interlock_notes(panel: Panel) -> Iterator[Note]:
    """Interlocks with a label in a sentence that is not made for it: "does not permit Door closed"."""
    for i, interlock in enumerate(panel.interlocks):
        if not interlock.locked and is_title(interlock.label):
            message = (
                f'an operator reads "The robot does not permit {interlock.label}.": give the reason '
                'and what to do, such as locked = "The cell door is open. Close it."'
            )
            yield Note(f"interlock[{i}]", message)


def is_title(label: Label | None) -> bool:
    """Whether a label stands alone, as "Door closed" does, and not in a sentence, as "operation"."""
    return str(label or "")[:1].isupper()


def _wordless_label_notes(panel: Panel) -> Iterator[Note]:
    """Labels that are not shown and have no word: the log and screen readers use them."""
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            label = str(getattr(widget, "label", "") or "")
            if label and not widget.show_label and not any(map(str.isalnum, label)):
                message = f'label "{label}" is the name in the log and for screen readers: write a word'
                yield Note(f"page[{p}].{place}", message)


def _unasked_notes(panel: Panel) -> Iterator[Note]:
    """Consequences that no question shows."""
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            if isinstance(widget, ConfirmationKeys) and widget.consequence and not widget.confirm_press:
                message = (
                    "consequence is part of a question that is never asked: add confirm_press = true"
                )
                yield Note(f"page[{p}].{place}", message)


def _unused_source_notes(panel: Panel) -> Iterator[Note]:
    """Sources whose topic nothing listens to."""
    listened = panel.listened()
    for number, source in enumerate(panel.sources):
        if source.topic not in listened:
            yield Note(f"source[{number}]", f'nothing has source = "{source.id}"')


def _unusable_type_notes(panel: Panel, interfaces: Interfaces) -> Iterator[Note]:
    """Unusable types of each folder that the panel does not need."""
    for f, folder in enumerate(panel.interfaces):
        errors = interfaces.unusable.items()
        own = [(n, why) for n, why in errors if why.source and why.source.is_relative_to(folder)]
        if own:
            name, why = own[0]
            more = f"; {len(own) - 1} more can't be used either" if len(own) > 1 else ""
            message = f"{name} can't be used, and this panel does not need it: {why}{more}"
            yield Note(f"interfaces[{f}]", message)


def _trend_notes(panel: Panel) -> Iterator[Note]:
    """The memory that the history of each trend takes, and on disk."""
    robots = len(panel.robots) or 1
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            if isinstance(widget, Trend) and f"page[{p}].{place}" not in panel.copies:
                size = robots * len(widget.pens) * history_bytes(widget.keep_s) / 1e6
                where = "memory, and as much on disk" if widget.disk else "memory"
                pens = f"{len(widget.pens)} pen{'s' * (len(widget.pens) > 1)}"
                message = f"keeps {widget.keep} of {pens}: {size:.1f} MB of {where}"
                yield Note(f"page[{p}].{place}", message)
