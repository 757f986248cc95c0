"""A draft without the parts that a panel file can't have: what a robot names or sends may be of any
length and any size. Pure."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final

from app.system.errors import Fault
from app.tools.scaffold.parts import Draft
from app.tools.scaffold.toml_text import toml_text, written

# (kind, name) of a widget; ("interlock", topic) of a candidate, ("alarm", topic) of alarms
Part = tuple[str, str]
LeftOut = Mapping[Part, str]  # with the reason of each
Check = Callable[[str], Sequence[Fault]]  # the faults of a panel file's text

_WIDGET: Final = re.compile(r"page\[(\d+)\]\.widget\[(\d+)\]\.?(?P<key>.*)")
_ALARM: Final = re.compile(r"alarm\[(\d+)\]\.?(?P<key>.*)")
_INTERLOCK: Final = re.compile(r"interlock\[(\d+)\]\.?(?P<key>.*)")


def checked_draft(make: Callable[[LeftOut], Draft], check: Check) -> tuple[Draft, Sequence[Fault]]:
    """The draft without the widgets and interlock candidates that have faults, and the faults that are
    of no such part. `make` returns the draft without some parts. Controls that will be commented out
    are checked too."""
    left_out: dict[Part, str] = {}
    while True:
        draft = make(left_out)
        faults = check(toml_text(draft, trial=True))
        more = {part: why for part, why in _blamed(draft, faults) if part not in left_out}
        if not more:
            return draft, faults
        left_out |= more


def _blamed(draft: Draft, faults: Sequence[Fault]) -> Iterator[tuple[Part, str]]:
    pages = written(draft, trial=True)
    for fault in faults:
        if (place := _WIDGET.fullmatch(fault.place)) is not None:
            entry = pages[int(place[1])][int(place[2])]
            yield (entry.kind, entry.name), _reason(place["key"], fault)
        elif (place := _INTERLOCK.fullmatch(fault.place)) is not None:
            topic = draft.interlocks[int(place[1])].topic
            yield ("interlock", topic), _reason(place["key"], fault)
        elif (place := _ALARM.fullmatch(fault.place)) is not None:
            yield ("alarm", draft.alarms[int(place[1])].topic), _reason(place["key"], fault)


def _reason(key: str, fault: Fault) -> str:
    return f"{key}: {fault.message}" if key else fault.message
