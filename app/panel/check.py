"""What can be wrong in a panel file whose shape is right: names, types and templates."""

import re
from collections import Counter
from collections.abc import Iterable, Iterator

from app.errors import Fault, FieldError, InterfaceError
from app.interfaces import Interfaces
from app.panel.model import Interlock, Panel, Publish, Readout, TextInput
from app.panel.template import filled, named

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
                case Publish():
                    on_page = {i.id for i in page.widgets} & inputs.keys()
                    yield from _publish(place, widget, panel, on_page, inputs.keys(), interfaces)
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


def _publish(
    place: str,
    publish: Publish,
    panel: Panel,
    on_page: set[str],
    anywhere: Iterable[str],
    interfaces: Interfaces,
) -> Iterator[Fault]:
    if publish.interlock is not None and panel.interlock(publish.interlock) is None:
        known = ", ".join(i.id for i in panel.interlocks) or "none"
        yield Fault(f"{place}.interlock", f'no interlock "{publish.interlock}"; there is {known}')
    try:
        interfaces.require(publish.type)
    except InterfaceError as error:
        yield Fault(f"{place}.type", str(error))
        return
    unknown = False
    try:
        for where, name in named(publish.message):
            if name not in on_page:
                unknown = True
                there = ", ".join(sorted(on_page)) or "none"
                what = f"; there is {there}" if name not in anywhere else ELSEWHERE
                yield Fault(f"{place}.message.{where}", f'no input "{name}"{what}')
        if not unknown:
            interfaces.encode(publish.type, filled(publish.message, dict.fromkeys(on_page, "text")))
    except FieldError as error:
        yield Fault(f"{place}.message.{error.field}".rstrip("."), error.message)


def _topics_of_two_types(panel: Panel) -> Iterator[Fault]:
    places = [(f"interlock[{i}]", x.topic, x.type) for i, x in enumerate(panel.interlocks)]
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            if not isinstance(widget, TextInput):
                places.append((f"page[{p}].widget[{w}]", widget.topic, widget.type))
    wanted: dict[str, Counter[str]] = {}
    for place, topic, type_name in places:
        types = wanted.setdefault(topic, Counter())
        if types and type_name not in types:
            yield Fault(f"{place}.type", f"{topic} is {type_name} here but {next(iter(types))} above")
        types[type_name] += 1
