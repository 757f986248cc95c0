"""What can be wrong in a hold: its two messages, and the fields that the kiosk itself fills in."""

import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any, Final

from app.errors import Fault, FieldError, InterfaceError
from app.interfaces import Interfaces
from app.panel.checks.templates import template_faults
from app.panel.checks.types import type_fault
from app.panel.model import Input
from app.panel.template import placed
from app.panel.widgets.hold import Hold

DEADLINE: Final = (r"uint(16|32|64)|float(32|64)", "uint16, uint32, uint64, float32 or float64")
COUNTER: Final = (r"uint(8|16|32|64)", "uint8, uint16, uint32 or uint64")


def hold_faults(
    place: str,
    hold: Hold,
    inputs: Mapping[str, Input],
    anywhere: Collection[str],
    interfaces: Interfaces,
    faulty: Collection[str] = (),
) -> Iterator[Fault]:
    """`inputs` are those of its page, `anywhere` all ids of inputs; of each message the first fault."""
    try:
        interfaces.require(hold.type)
    except InterfaceError as error:
        yield type_fault(f"{place}.type", error)
        return
    fields = list(_own_fields(place, hold, interfaces))
    yield from fields
    if fields:
        return
    for part, template in (("message", hold.message), ("release", hold.release)):
        try:
            whole = with_own_fields(hold, template, 0, 0)
        except FieldError as error:
            yield Fault(f"{place}.{part}.{error.field}", error.message)
            continue
        yield from template_faults(
            f"{place}.{part}", whole, hold.type, inputs, anywhere, interfaces, faulty
        )


def with_own_fields(hold: Hold, fields: Mapping[str, Any], deadline_ms: int, count: int) -> Any:
    """The fields of a message with its deadline and its number, where the hold has places for them."""
    whole: Any = fields
    if hold.deadline_field is not None:
        whole = placed(whole, hold.deadline_field, deadline_ms)
    if hold.counter_field is not None:
        whole = placed(whole, hold.counter_field, count)
    return whole


def _own_fields(place: str, hold: Hold, interfaces: Interfaces) -> Iterator[Fault]:
    own = (
        ("deadline_field", hold.deadline_field, DEADLINE),
        ("counter_field", hold.counter_field, COUNTER),
    )
    for key, path, (kinds, words) in own:
        if path is None:
            continue
        try:
            found = interfaces.field_type(hold.type, path)
        except InterfaceError as error:
            yield Fault(f"{place}.{key}", str(error))
            continue
        if not re.fullmatch(kinds, found):
            yield Fault(f"{place}.{key}", f'"{path}" is {found}: it must be {words}')
            continue
        for part, template in (("message", hold.message), ("release", hold.release)):
            if _gives(template, path):
                what = f"is filled in by the kiosk: it is the {key}"
                yield Fault(f"{place}.{part}.{path}", what, cause=f"own {place} {key}")
    if hold.counter_field is not None and hold.counter_field == hold.deadline_field:
        yield Fault(f"{place}.counter_field", f'"{hold.counter_field}" is the deadline_field already')


def _gives(template: Mapping[str, Any], path: str) -> bool:
    """Whether a template says the field itself; in a list each element must stand there anyway."""
    found: Any = template
    for step in path.split("."):
        if "[" in step or not isinstance(found, Mapping) or step not in found:
            return False
        found = found[step]
    return True
