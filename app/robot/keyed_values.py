"""The newest value of each field with a key, as `position[name=joint_2]`, over the messages of a topic.

Several nodes may publish parts of a list on one topic, such as an arm and a gripper on /joint_states.
So an element that a message lacks keeps its value, and has an age of its own.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.interfaces import Fields
from app.robot.sample import Sample

# How long newer messages may lack an element where nothing else limits its age: slow publishers of
# parts, as those of /diagnostics, publish once a second.
KEPT_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class KeyedValue:
    """The value in the newest message that has the element; `at`, `wall` and `source` as in `Sample`.
    `is_ambiguous`: several elements have the key."""

    value: Any
    at: float
    wall: float
    source: str | None
    is_ambiguous: bool = False


KeyedValues = Mapping[str, KeyedValue]  # by path
NO_VALUES: Final[KeyedValues] = {}


def updated(values: KeyedValues, paths: Iterable[str], fields: Fields, sample: Sample) -> KeyedValues:
    """The values after a message."""
    newer = dict(values)
    for path in paths:
        value, is_ambiguous = fields.get(path), fields.is_ambiguous(path)
        if value is not None or is_ambiguous:
            newer[path] = KeyedValue(value, sample.at, sample.wall, sample.source, is_ambiguous)
    return newer


def without_source(values: KeyedValues, source: str) -> KeyedValues:
    """The values that did not come from a peer."""
    return {path: value for path, value in values.items() if value.source not in (source, None)}


def kept_s(max_age_s: float | None, *, single_publisher: bool = False) -> float:
    """How long newer messages may lack an element: if the topic has a single publisher, not at all;
    with `max_age_s` its own age decides."""
    if single_publisher:
        return 0.0
    return KEPT_S if max_age_s is None else math.inf
