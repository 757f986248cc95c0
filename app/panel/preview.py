"""Previews of the messages of each press: with default values of fields that are not given, and with
the ids of inputs in place of their values."""

from collections.abc import Iterator, Mapping
from typing import Any

from app.errors import Remark
from app.interfaces import Interfaces, Type
from app.panel.constants import resolve_names
from app.panel.message_text import Comments, message_lines
from app.panel.model import Panel
from app.panel.template import NOW
from app.panel.widgets.families import Command, Input


def previews(panel: Panel, interfaces: Interfaces) -> Iterator[Remark]:
    """A remark for each widget that can be pressed or held."""
    for p, page in enumerate(panel.pages):
        comments = {w.id: w.comment for w in page.widgets if isinstance(w, Input)}
        comments[NOW] = "the time of sending"
        for place, widget in page.placed():
            if isinstance(widget, Command):
                lines = _preview_lines(widget, interfaces, comments)
                yield Remark(f"page[{p}].{place}", "\n".join(lines))
    for w, widget in enumerate(panel.frame.widgets):
        if isinstance(widget, Command):
            yield Remark(f"frame.widget[{w}]", "\n".join(_preview_lines(widget, interfaces, {})))


def _preview_lines(widget: Command, interfaces: Interfaces, comments: Comments) -> Iterator[str]:
    for sent in widget.sent_messages(interfaces):
        yield sent.when
        if sent.type_name:
            kind = Type(sent.type_name)
            named = resolve_names(sent.fields, kind, interfaces)
            fields = complete_value(named, kind, interfaces)
            every = {**comments, **sent.comments}
            yield from (f"  {line}" for line in message_lines(fields, every))


def complete_value(given: Any, kind: Type, interfaces: Interfaces) -> Any:
    """A value of a template with default values added; texts with input ids are unchanged."""
    if isinstance(given, list | tuple) and kind.container != "one":
        return [complete_value(one, kind.element, interfaces) for one in given]
    if isinstance(given, Mapping) and kind.is_nested:
        fields = interfaces.structures[kind.name].fields
        return {
            f.name: complete_value(given.get(f.name, f.default_value), f.type, interfaces)
            for f in fields
        }
    number = isinstance(given, int) and not isinstance(given, bool)
    return float(given) if number and kind.name.startswith("float") else given
