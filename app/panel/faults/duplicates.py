"""Merges faults with one cause."""

import re
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from app.errors import Fault

MAX_PLACES: Final = 3
OWNER: Final = re.compile(r"(?:page\[[0-9]+\]|frame)(?:\.group\[[0-9]+\])?\.widget\[[0-9]+\]\.")


def merge_duplicates(faults: Iterable[Fault]) -> list[Fault]:
    """The first fault of each cause, with the places of the others in its message."""
    groups: dict[str, list[Fault]] = {}
    for number, fault in enumerate(faults):
        groups.setdefault(fault.cause or f"#{number}", []).append(fault)
    return [_merge(*group) for group in groups.values()]


def _merge(first: Fault, *others: Fault) -> Fault:
    if not others:
        return first
    owner = OWNER.match(first.place)
    near = owner[0] if owner else first.place
    places = ", ".join(fault.place.removeprefix(near) for fault in others[:MAX_PLACES])
    more = f" and {len(others) - MAX_PLACES} more" if len(others) > MAX_PLACES else ""
    return replace(first, message=f"{first.message} (also at {places}{more})")
