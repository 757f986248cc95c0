"""What can be wrong in what is sent by a button, and in what is shown of the answer."""

import re
from collections.abc import Iterator

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.model import Pressed
from app.panel.template import PLACE
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Action, Call

NUMBER = r"u?int(8|16|32|64)|float(32|64)|byte|char"
WORDS = {NUMBER: "a number"}


def sent(widget: Publish | Call | Action, interfaces: Interfaces) -> tuple[str, str]:
    """The key that holds what is sent, and its type; InterfaceError if there is no such type."""
    match widget:
        case Publish():
            interfaces.require(widget.type)
            return "message", widget.type
        case Call():
            return "request", interfaces.service(widget.type)[0]
        case Action():
            return "goal", interfaces.action(widget.type).goal


def answer_faults(place: str, widget: Pressed, interfaces: Interfaces) -> Iterator[Fault]:
    """Faults of the fields that are read from an answer."""
    match widget:
        case Call():
            yield from _response(place, widget, interfaces)
        case Action():
            yield from _outcome(place, widget, interfaces)


def _response(place: str, call: Call, interfaces: Interfaces) -> Iterator[Fault]:
    _, response = interfaces.service(call.type)
    for key, path, kind in (("success", call.success, "bool"), ("message", call.message, "string")):
        if path is not None:
            yield from _path(f"{place}.{key}", response, path, kind, interfaces)
    yield from _shown(f"{place}.answer", response, call.answer, interfaces)


def _outcome(place: str, action: Action, interfaces: Interfaces) -> Iterator[Fault]:
    types = interfaces.action(action.type)
    if action.progress is not None:
        yield from _path(f"{place}.progress", types.feedback, action.progress, NUMBER, interfaces)
    yield from _shown(f"{place}.feedback", types.feedback, action.feedback, interfaces)
    yield from _shown(f"{place}.result", types.result, action.result, interfaces)


def _shown(place: str, type_name: str, template: str, interfaces: Interfaces) -> Iterator[Fault]:
    for path in PLACE.findall(template):
        yield from _path(place, type_name, path, ".*", interfaces)


def _path(place: str, type_name: str, path: str, kind: str, interfaces: Interfaces) -> Iterator[Fault]:
    """A fault if there is no such field, or not of this kind (a regular expression)."""
    try:
        found = interfaces.field_type(type_name, path)
    except InterfaceError as error:
        yield Fault(place, str(error))
        return
    if not re.fullmatch(kind, found):
        yield Fault(place, f'"{path}" is {found}: it must be {WORDS.get(kind, kind)}')
