"""What a hold publishes: a message while it is held and one that ends it, each with the fields that the
panel lets the server fill in (a deadline, a counter)."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, Protocol

from app.errors import LinkError
from app.i18n import TextLike, say
from app.interfaces import INTEGER_RANGES, Interfaces
from app.panel.template import add_now, fill, input_ids
from app.panel.widgets.hold import Hold, fill_own_fields
from app.permission.interlocks import link_verdict
from app.robot.command_status import FinalCheck, no_check
from app.robot.state import RobotState

Values = Mapping[str, Any]  # of inputs by their ids, as they were when the hold began
Checked = Callable[[Iterable[str], Values], dict[str, Any]]


class Transport(Protocol):
    """What a hold needs of the link."""

    def put(self, key: str, payload: bytes) -> None: ...


class HoldMessages:
    """Those of one robot; the counter of a widget goes on from hold to hold."""

    def __init__(
        self, interfaces: Interfaces, robot: RobotState, transport: Transport, checked: Checked
    ) -> None:
        """`checked` are the values that a template gets of what was entered."""
        self._interfaces = interfaces
        self._robot = robot
        self._transport = transport
        self._checked = checked
        self._counts: dict[str, int] = {}

    def values(self, widget: Hold, inputs: Mapping[str, Any]) -> Values:
        """Those that both messages get; FieldError or InputError for bad input."""
        values = self._checked(input_ids(widget), inputs)
        for template in (widget.message, widget.release):
            fields = fill(template, add_now(values))
            self._interfaces.encode(widget.type, fill_own_fields(widget, fields, 0, 0))
        return values

    def put(self, widget: Hold, values: Values, final_check: FinalCheck) -> None:
        """One message more; LinkError where it could not be sent, PressRefused where the last look
        finds that it may not be."""
        self._put(widget, widget.message, values, widget.deadline_ms, final_check)

    def put_last(self, widget: Hold, values: Values, now: float) -> TextLike:
        """The message that ends it, if there is any way now, be it in doubt: one stop too many harms
        no one. Why it was not sent, or ""."""
        if not self._robot.link_up or not self._robot.graph.bridges:
            return link_verdict(self._robot, now).reason or ""
        try:
            self._put(widget, widget.release, values, 0, no_check)
        except LinkError as error:
            return say("with_stop", said=error.text)
        return ""

    def _put(
        self,
        widget: Hold,
        template: Mapping[str, Any],
        values: Values,
        deadline_ms: int,
        final_check: FinalCheck,
    ) -> None:
        count = self._counts.get(widget.id, 0) + 1
        if widget.counter_field is not None:
            kind = self._interfaces.field_type(widget.type, widget.counter_field)
            count %= INTEGER_RANGES[kind][1] + 1
        fields = fill(template, add_now(values))
        whole = fill_own_fields(widget, fields, deadline_ms, count)
        payload = self._interfaces.encode(widget.type, whole)
        final_check()
        self._transport.put(self._robot.key(widget.topic), payload)
        self._counts[widget.id] = count
