"""What can be wrong in what confirms a command: its topic's type, its field, its value."""

import re
from collections.abc import Collection, Iterator, Mapping

from app.errors import Fault, FieldError
from app.interfaces import Interfaces
from app.panel.checks.templates import NOW_IS, examples, unknown
from app.panel.model import Input, Panel
from app.panel.template import NOW, filled, named
from app.panel.widgets.check_displays import field_faults, misfit
from app.panel.widgets.publish import Confirm, Publish


def confirm_faults(
    place: str,
    widget: Publish,
    panel: Panel,
    inputs: Mapping[str, Input],
    anywhere: Collection[str],
    interfaces: Interfaces,
    faulty: Collection[str] = (),
) -> Iterator[Fault]:
    """Faults of a command's `confirm`; `inputs` are those of its page, `anywhere` all ids. A value that
    names a `faulty` input is not tried: that is told already."""
    confirm = widget.confirm
    if confirm is None:
        if widget.one_shot:
            what = "needs `confirm`: without it nothing tells when the command was answered"
            yield Fault(f"{place}.one_shot", what)
        return
    known = confirm.type or panel.subscriptions().get(confirm.topic)
    if known is None:
        what = f"is missing: nothing else in the panel says what {confirm.topic} is"
        yield Fault(f"{place}.confirm.type", what, cause=f"listens {confirm.topic}")
        return
    typed = confirm.model_copy(update={"type": known})
    faults = list(field_faults(f"{place}.confirm", typed, interfaces))
    yield from faults
    if not faults:
        kind = interfaces.field_type(known, confirm.field)
        yield from _equals(f"{place}.confirm", confirm, kind, inputs, anywhere, faulty)


def _equals(
    place: str,
    confirm: Confirm,
    kind: str,
    inputs: Mapping[str, Input],
    anywhere: Collection[str],
    faulty: Collection[str],
) -> Iterator[Fault]:
    if re.search(r"[/\]]", kind):
        what = f'"{confirm.field}" is {kind}: one value of it can confirm, not all'
        yield Fault(f"{place}.field", what)
        return
    try:
        names = list(named(confirm.equals, "equals"))
    except FieldError as error:
        yield Fault(f"{place}.{error.field}", error.message)
        return
    faults = list(unknown(place, names, inputs, anywhere))
    faults += [Fault(f"{place}.{where}", NOW_IS) for where, name in names if name == NOW]
    yield from faults
    if faults or {name for _, name in names} & set(faulty):
        return
    tried = {name: examples(inputs[name]) for _, name in names}
    for turn in range(max(map(len, tried.values()), default=1)):
        values = {name: some[min(turn, len(some) - 1)] for name, some in tried.items()}
        if fault := misfit(filled(confirm.equals, values), kind):
            yield Fault(f"{place}.equals", fault)
            return
