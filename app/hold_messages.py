"""What a hold publishes: a message while it is held and one that ends it, each with the fields that the
panel lets the server fill in (a deadline, a counter)."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from app.errors import LinkError
from app.interfaces import INTEGERS, Interfaces
from app.interlocks import way
from app.panel.check_holds import with_own_fields
from app.panel.model import Hold
from app.panel.template import filled, inputs_of
from app.progress import LastLook, no_look
from app.robot import Robot

Checked = Callable[[Iterable[str], Mapping[str, Any]], dict[str, Any]]


class Way(Protocol):
    """What a hold needs of the link."""

    def put(self, key: str, payload: bytes) -> None: ...


@dataclass(frozen=True, slots=True)
class Filled:
    """The fields of both messages, with the inputs as they were when the hold began."""

    message: Mapping[str, Any]
    release: Mapping[str, Any]


class HoldMessages:
    """Those of one robot; the counter of a widget goes on from hold to hold."""

    def __init__(self, interfaces: Interfaces, robot: Robot, way: Way, checked: Checked) -> None:
        """`checked` are the values that a template gets of what was entered."""
        self._interfaces = interfaces
        self._robot = robot
        self._way = way
        self._checked = checked
        self._counts: dict[str, int] = {}

    def filled(self, widget: Hold, inputs: Mapping[str, Any]) -> Filled:
        """What would be published; FieldError or InputError for bad input."""
        values = self._checked(inputs_of(widget), inputs)
        both = Filled(filled(widget.message, values), filled(widget.release, values))
        for fields in (both.message, both.release):
            self._interfaces.encode(widget.type, with_own_fields(widget, fields, 0, 0))
        return both

    def put(self, widget: Hold, both: Filled, look: LastLook) -> None:
        """One message more; LinkError where it could not be sent, PressRefused where the last look
        finds that it may not be."""
        self._put(widget, both.message, widget.deadline_ms, look)

    def put_last(self, widget: Hold, both: Filled, now: float) -> str:
        """The message that ends it, if there is any way now, be it in doubt: one stop too many harms
        nobody. Why it was not sent, or ""."""
        if not self._robot.link_up or not self._robot.graph.bridges:
            return way(self._robot, now).reason or ""
        try:
            self._put(widget, both.release, 0, no_look)
        except LinkError as error:
            return f"{error}."
        return ""

    def _put(self, widget: Hold, fields: Mapping[str, Any], deadline_ms: int, look: LastLook) -> None:
        count = self._counts.get(widget.id, 0) + 1
        if widget.counter_field is not None:
            kind = self._interfaces.field_type(widget.type, widget.counter_field)
            count %= INTEGERS[kind][1] + 1
        whole = with_own_fields(widget, fields, deadline_ms, count)
        payload = self._interfaces.encode(widget.type, whole)
        look()
        self._way.put(self._robot.key(widget.topic), payload)
        self._counts[widget.id] = count
