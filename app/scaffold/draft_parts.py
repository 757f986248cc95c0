"""The parts of a panel file that is being made: widgets with their keys, and the comments on them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True, kw_only=True)
class DraftWidget:
    """One widget. `keys` are its keys but for its id, in their order; a list of mappings becomes one
    inline table a line. `comment` stands above it. `control`: it acts on the robot.

    `place` are the parts of its namespace, or else of its node: its page. A control's `scope` is the
    namespace whose permission it needs, `nodes` are those that it acts on, and `interlock` is the id of
    a candidate, "" for none.
    """

    kind: str
    name: str  # of the topic, service, action or node that it is about: its id is made of it
    keys: Mapping[str, Any]
    comment: str = ""
    control: bool = False
    place: tuple[str, ...] = ()
    scope: str = ""
    nodes: tuple[str, ...] = ()
    interlock: str = ""


@dataclass(frozen=True, slots=True)
class Omission:
    """A topic, or a field of one, without a widget: why."""

    name: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class InterlockCandidate:
    """A topic that may permit what the robot does."""

    id: str
    label: str
    topic: str
    type: str
    kept: bool  # its publisher keeps the last value for those that come late
    owners: tuple[str, ...] = ()  # the nodes that publish it
    nodes: str = ""  # the names of its publishers' nodes, where there are several


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosticAlarms:
    """The alarms of a topic with diagnostics, one for each status. `keys` are those of its table, but
    for its id."""

    topic: str
    keys: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A panel file that is not written yet. `remarks` are lines about what has no widget; `alike` are
    namespaces that look like robots."""

    title: str
    namespace: str = ""
    reached: Mapping[str, Any] = field(default_factory=dict)  # `dialect` and `domain`, if not the usual
    robots: Sequence[Mapping[str, Any]] = ()
    distro: str = "jazzy"
    interfaces: Sequence[str] = ()
    interlocks: Sequence[InterlockCandidate] = ()
    alarms: Sequence[DiagnosticAlarms] = ()
    pages: Mapping[str, Sequence[DraftWidget]] = field(default_factory=dict)
    remarks: Sequence[str] = ()
    alike: Sequence[str] = ()
