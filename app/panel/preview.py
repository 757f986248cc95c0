"""What each press of a panel sends, whole: with all that its message leaves out, and with the ids of
inputs where their values will stand."""

from collections.abc import Iterator, Mapping
from typing import Any

from app.errors import Remark
from app.interfaces import Interfaces, Type
from app.interfaces.validation import shown
from app.panel.checks.calls import sent
from app.panel.checks.holds import with_own_fields
from app.panel.message_text import Comments, message_lines
from app.panel.model import Input, Panel
from app.panel.template import NOW
from app.panel.widgets.hold import Hold
from app.panel.widgets.inputs import SelectInput, TextInput, ToggleInput, digits
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Action, Call


def previews(panel: Panel, interfaces: Interfaces) -> Iterator[Remark]:
    """One for each widget that can be pressed or held, at its place."""
    for p, page in enumerate(panel.pages):
        comments = {w.id: _about(w) for w in page.widgets if isinstance(w, Input)}
        comments[NOW] = "the time of sending"
        for w, widget in enumerate(page.widgets):
            if isinstance(widget, Publish | Call | Action | Hold | Parameter):
                lines = _preview(widget, interfaces, comments)
                yield Remark(f"page[{p}].widget[{w}]", "\n".join(lines))


def _preview(
    widget: Publish | Call | Action | Hold | Parameter, interfaces: Interfaces, comments: Comments
) -> Iterator[str]:
    match widget:
        case Parameter():
            yield f'sets {widget.parameter} of {widget.node} ({widget.type}) to "{{{widget.id}}}"'
        case Hold():
            yield from _held(widget, interfaces, comments)
        case _:
            yield f"{_verb(widget)} ({widget.type})"
            _, type_name = sent(widget, interfaces)
            yield from _fields(widget.template, type_name, interfaces, comments)


def _verb(widget: Publish | Call | Action) -> str:
    match widget:
        case Publish():
            return f"publishes {widget.topic}"
        case Call():
            return f"calls {widget.service}"
    return f"sends a goal to {widget.action}"


def _held(hold: Hold, interfaces: Interfaces, comments: Comments) -> Iterator[str]:
    own = {
        f".{hold.deadline_field}": "ms within which the next one comes",
        f".{hold.counter_field}": "counts the messages",
    }
    every = {**comments, **own}
    often = f"{digits(hold.rate_hz)} times a second while it is held"
    yield f"publishes {hold.topic} ({hold.type}) {often}"
    fields = with_own_fields(hold, hold.message, hold.deadline_ms, 1)
    yield from _fields(fields, hold.type, interfaces, every)
    yield "and once when it ends"
    yield from _fields(with_own_fields(hold, hold.release, 0, 1), hold.type, interfaces, every)


def _fields(
    template: Mapping[str, Any], type_name: str, interfaces: Interfaces, comments: Comments
) -> Iterator[str]:
    fields = whole(template, Type(type_name), interfaces)
    yield from (f"  {line}" for line in message_lines(fields, comments))


def whole(given: Any, kind: Type, interfaces: Interfaces) -> Any:
    """A value of a template with all that it leaves out; a text that names inputs stays as it is."""
    if isinstance(given, list | tuple) and kind.many != "one":
        return [whole(one, kind.element, interfaces) for one in given]
    if isinstance(given, Mapping) and kind.nested:
        fields = interfaces.structures[kind.name].fields
        return {f.name: whole(given.get(f.name, f.left_out), f.type, interfaces) for f in fields}
    number = isinstance(given, int) and not isinstance(given, bool)
    return float(given) if number and kind.name.startswith("float") else given


def _about(of: Input) -> str:
    """What an input gives, and what it has at first."""
    match of:
        case TextInput():
            return f"text, {shown(of.default)} at first"
        case SelectInput():
            return f"one of {', '.join(shown(option.value) for option in of.options)}"
        case ToggleInput():
            return f"true or false, {shown(of.default)} at first"
    unit = f" {of.unit}" if of.unit else ""
    return f"{digits(of.min)} to {digits(of.max)}{unit}" + (
        f", {of.start} at first" if of.start else ""
    )
