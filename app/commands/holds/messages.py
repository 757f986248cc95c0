"""The messages of a hold: one published repeatedly while it is active, and the stop message at its end.
The server fills in a deadline and a counter if the panel file names fields for them."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from app.commands.transport import Transport
from app.errors import LinkError
from app.i18n import TextLike, say
from app.interfaces import INTEGER_RANGES, Interfaces
from app.panel.template import add_now, fill, input_ids
from app.panel.widgets.hold import HoldCommand, fill_own_fields
from app.permission.interlocks import link_verdict
from app.robot.command_status import FinalCheck, no_check
from app.robot.state import RobotState

Values = Mapping[str, Any]  # input values by input id, from the beginning of the hold
Checked = Callable[[Iterable[str], Values], dict[str, Any]]


class HoldMessages:
    """The hold messages of one robot. A widget's counter continues from hold to hold."""

    def __init__(
        self, interfaces: Interfaces, robot: RobotState, transport: Transport, checked: Checked
    ) -> None:
        """`checked` checks inputs and returns the values for the templates."""
        self._interfaces = interfaces
        self._robot = robot
        self._transport = transport
        self._checked = checked
        self._counts: dict[str, int] = {}

    def values(self, widget: HoldCommand, inputs: Mapping[str, Any]) -> Values:
        """The checked values for both messages; FieldError or InputError for bad input."""
        values = self._checked(input_ids(widget), inputs)
        for template in widget.templates():
            fields = fill(template, add_now(values))
            self._interfaces.encode(widget.type, fill_own_fields(widget, fields, 0, 0))
        return values

    def put(
        self,
        widget: HoldCommand,
        values: Values,
        final_check: FinalCheck,
        axes: tuple[float, float],
    ) -> None:
        """Publishes one message, with the values of a joystick's axes; LinkError if it could not be
        sent, PressRefused from `final_check`."""
        self._put(widget, widget.moving(*axes), values, widget.deadline_ms, final_check)

    def put_last(self, widget: HoldCommand, values: Values, now: float) -> TextLike:
        """Publishes the stop message if the link is up, even without permission: an extra stop does no
        harm. Returns why it was not sent, else ""."""
        if not self._robot.link_up or not self._robot.graph.peers:
            return link_verdict(self._robot, now).reason or ""
        try:
            self._put(widget, widget.stopping(), values, 0, no_check)
        except LinkError as error:
            return say("with_stop", said=error.text)
        return ""

    def _put(
        self,
        widget: HoldCommand,
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
