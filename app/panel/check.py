"""What can be wrong in a panel file whose shape is right: names, types and templates."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator

from app.errors import Fault, FieldError, InterfaceError
from app.interfaces import Interfaces
from app.panel.model import Action, Call, Interlock, Panel, Pressed, Publish, Readout, TextInput
from app.panel.template import PLACE, filled, named

NUMBER = r"u?int(8|16|32|64)|float(32|64)|byte|char"
WORDS = {NUMBER: "a number"}
ELSEWHERE = " on this page: an input is read from the page it is on"


def faults_in(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """Every fault of names, types and templates; of each message the first that its type has."""
    yield from _repeated("interlock", [i.id for i in panel.interlocks])
    for i, interlock in enumerate(panel.interlocks):
        yield from _interlock(f"interlock[{i}]", interlock, interfaces)
    if not panel.pages:
        yield Fault("page", "is missing: a panel has one page at least")
    yield from _repeated("page", [page.id for page in panel.pages])
    yield from _repeated_widgets(panel)
    inputs = {w.id: w for w in panel.widgets() if isinstance(w, TextInput)}
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            place = f"page[{p}].widget[{w}]"
            match widget:
                case TextInput():
                    yield from _text(place, widget)
                case Readout():
                    yield from _readout(place, widget, interfaces)
                case Publish() | Call() | Action():
                    on_page = {i.id for i in page.widgets} & inputs.keys()
                    yield from _pressed(place, widget, panel, on_page, inputs.keys(), interfaces)
    yield from _topics_of_two_types(panel)


def _repeated(table: str, ids: list[str]) -> Iterator[Fault]:
    for i, one in enumerate(ids):
        if one in ids[:i]:
            yield Fault(f"{table}[{i}].id", f'"{one}" is already the id of {table}[{ids.index(one)}]')


def _repeated_widgets(panel: Panel) -> Iterator[Fault]:
    seen: dict[str, str] = {}
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            place = f"page[{p}].widget[{w}]"
            if widget.id in seen:
                yield Fault(f"{place}.id", f'"{widget.id}" is already the id of {seen[widget.id]}')
            seen.setdefault(widget.id, place)


def _interlock(place: str, interlock: Interlock, interfaces: Interfaces) -> Iterator[Fault]:
    fault = list(_field(place, interlock, interfaces))
    yield from fault
    if not fault and (found := interfaces.field_type(interlock.type, interlock.field)) != "bool":
        yield Fault(f"{place}.field", f'"{interlock.field}" is {found}: an interlock needs a bool')


def _readout(place: str, readout: Readout, interfaces: Interfaces) -> Iterator[Fault]:
    fault = list(_field(place, readout, interfaces))
    yield from fault
    if not fault and re.search(r"[/\]]", found := interfaces.field_type(readout.type, readout.field)):
        yield Fault(
            f"{place}.field", f'"{readout.field}" is {found}: a readout shows one value of it, not all'
        )


def _field(place: str, of: Interlock | Readout, interfaces: Interfaces) -> Iterator[Fault]:
    try:
        interfaces.require(of.type)
    except InterfaceError as error:
        yield Fault(f"{place}.type", str(error))
        return
    try:
        interfaces.field_type(of.type, of.field)
    except InterfaceError as error:
        yield Fault(f"{place}.field", str(error))


def _text(place: str, text: TextInput) -> Iterator[Fault]:
    if len(text.default) > text.max_length:
        yield Fault(f"{place}.default", f"is longer than max_length ({text.max_length})")


def _pressed(
    place: str,
    widget: Pressed,
    panel: Panel,
    on_page: set[str],
    anywhere: Iterable[str],
    interfaces: Interfaces,
) -> Iterator[Fault]:
    if isinstance(widget, Publish) and widget.topic == "/rosout":
        yield Fault(f"{place}.topic", "/rosout is where the kiosk's own log goes: choose another")
    if widget.interlock is not None and panel.interlock(widget.interlock) is None:
        known = ", ".join(i.id for i in panel.interlocks) or "none"
        yield Fault(f"{place}.interlock", f'no interlock "{widget.interlock}"; there is {known}')
    try:
        part, type_name = _sent(widget, interfaces)
    except InterfaceError as error:
        yield Fault(f"{place}.type", str(error))
        return
    yield from _template(f"{place}.{part}", widget, type_name, on_page, anywhere, interfaces)
    if isinstance(widget, Call):
        yield from _response(place, widget, interfaces)
    elif isinstance(widget, Action):
        yield from _outcome(place, widget, interfaces)


def _sent(widget: Pressed, interfaces: Interfaces) -> tuple[str, str]:
    """The key that holds what is sent, and its type."""
    match widget:
        case Publish():
            interfaces.require(widget.type)
            return "message", widget.type
        case Call():
            return "request", interfaces.service(widget.type)[0]
        case Action():
            return "goal", interfaces.action(widget.type).goal


def _template(
    place: str,
    widget: Pressed,
    type_name: str,
    on_page: set[str],
    anywhere: Iterable[str],
    interfaces: Interfaces,
) -> Iterator[Fault]:
    unknown = False
    try:
        for where, name in named(widget.template):
            if name not in on_page:
                unknown = True
                there = ", ".join(sorted(on_page)) or "none"
                what = f"; there is {there}" if name not in anywhere else ELSEWHERE
                yield Fault(f"{place}.{where}", f'no input "{name}"{what}')
        if not unknown:
            interfaces.encode(type_name, filled(widget.template, dict.fromkeys(on_page, "text")))
    except FieldError as error:
        yield Fault(f"{place}.{error.field}".rstrip("."), error.message)


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


def _topics_of_two_types(panel: Panel) -> Iterator[Fault]:
    places = [(f"interlock[{i}]", x.topic, x.type) for i, x in enumerate(panel.interlocks)]
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            if isinstance(widget, Publish | Readout):
                places.append((f"page[{p}].widget[{w}]", widget.topic, widget.type))
    wanted: dict[str, Counter[str]] = {}
    for place, topic, type_name in places:
        types = wanted.setdefault(topic, Counter())
        if types and type_name not in types:
            yield Fault(f"{place}.type", f"{topic} is {type_name} here but {next(iter(types))} above")
        types[type_name] += 1
