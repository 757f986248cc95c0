"""The parts of a panel file that is being made: widgets with their keys, and the comments on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One widget. `keys` are its keys but for its id, in their order; a list of mappings becomes one
    inline table a line. `comment` stands above it. `control`: it acts on the robot."""

    kind: str
    name: str  # of the topic, service, action or node that it is about: its id and page are made of it
    keys: Mapping[str, Any]
    comment: str = ""
    control: bool = False
    page: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class InterlockCandidate:
    """A topic that may permit what the robot does."""

    id: str
    topic: str
    type: str
    kept: bool  # its publisher keeps the last value for those that come late
    nodes: str = ""  # the names of its publishers' nodes, where there are several


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A panel file that is not written yet. `remarks` are lines about what has no widget."""

    title: str
    namespace: str = ""
    robots: Sequence[Mapping[str, Any]] = ()
    distro: str = "jazzy"
    interfaces: Sequence[str] = ()
    interlocks: Sequence[InterlockCandidate] = ()
    pages: Mapping[str, Sequence[Entry]] = field(default_factory=dict)
    remarks: Sequence[str] = ()
