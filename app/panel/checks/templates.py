"""Checks templates by encoding them with example values of their inputs."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any, Final

from app.panel.file.wording import known_hint, no_such
from app.panel.template import NOW, TIME, add_now, fill, input_of, placeholders, value_at
from app.panel.widgets.families import CheckContext, Input
from app.ros.messages import Interfaces
from app.system.errors import Fault, FieldError, InterfaceError

# Parts of a place and of a tour, on their map.
GEOMETRY: Final = frozenset({"x", "y", "yaw", "orientation", "pose", "poses"})
NOW_RULE: Final = f'"{{{NOW}}}", alone, is the time of sending and fills a {TIME}'
ON_OTHER_PAGE: Final = " on this page: an input is read from the page it is on"


def template_faults(
    place: str, template: Mapping[str, Any], type_name: str, checking: CheckContext
) -> Iterator[Fault]:
    """The faults of a template for a type, at `place`. A template with a faulty input is not tried."""
    interfaces, inputs = checking.interfaces, checking.inputs
    try:
        names = list(placeholders(template))
        faults = list(unknown_input_faults(place, names, checking))
        used = [input_of(name) for _, name in names]
        if not {*used} & {*checking.faulty}:
            faults += _misplaced_now_faults(place, template, type_name, names, interfaces)
            known = {name: inputs[name] for name in used if name in inputs}
            faults += [] if faults else _encoding_faults(place, template, type_name, known, interfaces)
            faults += [] if faults else _frame_faults(place, template, type_name, names, interfaces)
        yield from faults
    except FieldError as error:
        yield Fault(f"{place}.{error.field}".rstrip("."), error.message)


def example_values(inputs: Mapping[str, Input]) -> Iterator[dict[str, Any]]:
    """Values that inputs send, by id; each example of each input appears at least once."""
    tried = {
        name: [*map(input_widget.sent_value, input_widget.examples())]
        for name, input_widget in inputs.items()
    }
    for turn in range(max(map(len, tried.values()), default=1)):
        yield {name: some[min(turn, len(some) - 1)] for name, some in tried.items()}


def unknown_input_faults(
    place: str, names: list[tuple[str, str]], checking: CheckContext
) -> Iterator[Fault]:
    """Faults of names of inputs that are not on the page, and of parts that an input does not have."""
    inputs = checking.inputs
    for where, name in names:
        input_id, _, part = name.partition(".")
        if name == NOW:
            continue
        if input_id not in inputs:
            elsewhere = input_id in checking.all_inputs
            hint = ON_OTHER_PAGE if elsewhere else f"; {known_hint(input_id, sorted(inputs))}"
            message = f'no input "{input_id}"{hint}'
            yield Fault(f"{place}.{where}", message, cause=f"input {input_id}")
        elif input_id not in checking.faulty and (fault := _part_fault(inputs[input_id], part)):
            yield Fault(f"{place}.{where}", fault)


def _part_fault(widget: Input, part: str) -> str:
    """What is wrong with the name of a part of an input's value, "" for none."""
    if part in widget.parts or not (part or widget.parts):
        return ""
    if not widget.parts:
        return f'"{widget.id}" has no parts: write "{{{widget.id}}}"'
    if not part:
        return (
            f'"{widget.id}" is a {widget.kind}: name a part, as in "{{{widget.id}.{widget.parts[0]}}}"'
        )
    return no_such(f'part of "{widget.id}"', part, widget.parts)


def _misplaced_now_faults(
    place: str,
    template: Mapping[str, Any],
    type_name: str,
    names: list[tuple[str, str]],
    interfaces: Interfaces,
) -> Iterator[Fault]:
    """Faults of `"{now}"` that is not alone, or not in a time field. An unknown field is reported
    elsewhere."""
    for where in (where for where, name in names if name == NOW):
        with suppress(InterfaceError):
            kind = interfaces.field_type(type_name, where)
            if kind != TIME or value_at(template, where) != f"{{{NOW}}}":
                yield Fault(f"{place}.{where}", f"{NOW_RULE}; the field is {kind}")


def _frame_faults(
    place: str,
    template: Mapping[str, Any],
    type_name: str,
    names: list[tuple[str, str]],
    interfaces: Interfaces,
) -> Iterator[Fault]:
    """Faults of a pose on a map in a message with another frame: the robot would take it for another
    place."""
    frames: dict[str, str] = {}  # the frame that a field has to have
    for where, name in names:
        input_id, _, part = name.partition(".")
        field = _frame_field(type_name, where, interfaces) if part in GEOMETRY else None
        if field is not None:
            frames.setdefault(field, f"{{{input_id}.frame}}")
    for field, frame in frames.items():
        if value_at(template, field) != frame:
            message = f'must be "{frame}": the pose is in the frame of its map'
            yield Fault(f"{place}.{field}", message)


def _frame_field(type_name: str, where: str, interfaces: Interfaces) -> str | None:
    """The field with the frame of what is at a field: that of the nearest header around it."""
    around = where
    while around:
        around = around.rpartition(".")[0]
        field = f"{around}.header.frame_id".lstrip(".")
        with suppress(InterfaceError):
            interfaces.field_type(type_name, field)
            return field
    return None


def _encoding_faults(
    place: str,
    template: Mapping[str, Any],
    type_name: str,
    inputs: Mapping[str, Input],
    interfaces: Interfaces,
) -> Iterator[Fault]:
    for values in example_values(inputs):
        try:
            interfaces.encode(type_name, fill(template, add_now(values)))
        except FieldError as error:
            message = _fault_message(error, template, type_name, inputs, values, interfaces)
            # The same input may be in several messages.
            cause = f"value {message}" if message.startswith("input ") else ""
            yield Fault(f"{place}.{error.field}".rstrip("."), message, cause=cause)
            return


def _fault_message(
    error: FieldError,
    template: Mapping[str, Any],
    type_name: str,
    inputs: Mapping[str, Input],
    values: Mapping[str, Any],
    interfaces: Interfaces,
) -> str:
    """The fault's message, with the input that caused it and the field's type."""
    written = value_at(template, error.field)
    names = [name for _, name in placeholders(written)] if isinstance(written, str) else []
    if not names:
        return error.message
    try:
        field = interfaces.field_type(type_name, error.field)
    except InterfaceError:  # the template has an unknown field
        return error.message
    if written not in (f"{{{names[0]}}}", f"-{{{names[0]}}}"):
        return error.message if _detail(error) else f'"{written}" makes text; the field is {field}'
    input_widget = inputs[input_of(names[0])]
    value = fill(written, values) if input_widget.parts else values[input_widget.id]
    gives = input_widget.describe_value(value, narrow=bool(_detail(error)))
    return f'input "{names[0]}" gives {gives}; the field is {field}{_detail(error)}'


def _detail(error: FieldError) -> str:
    """The details of an error that is not about the type: a range, a length."""
    return "" if error.message.startswith("must be") else f": {error.message}"
