"""The known states of one robot's parameters. Only this module changes them."""

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

from app.panel.widgets.parameter import Parameter
from app.robot.parameter_state import UNKNOWN, ParameterState, decode_value, type_name
from app.robot.state import RobotState
from app.ros_logging import RobotLog


class KnownParameters:
    """Parameter states by widget. Used on the event loop only."""

    def __init__(self, robot: RobotState, log: RobotLog) -> None:
        self._robot = robot
        self._log = log

    def state(self, widget: Parameter) -> ParameterState:
        return self._robot.parameters.get(widget.id, UNKNOWN)

    def set(self, widget: Parameter, state: ParameterState) -> None:
        if state.state == "undeclared" and self.state(widget).state != "undeclared":
            self._log.warning("%s has no parameter %s", widget.node, widget.parameter)
        self._robot.parameters[widget.id] = state

    def apply_event(self, widget: Parameter, value: Any, wall: float) -> bool:
        """Applies a new value (a ParameterValue) from a parameter event at `wall` (seconds since the
        epoch). False if the node has to be queried instead."""
        known = self.state(widget)
        if known.state not in ("live", "missing"):
            return False
        if type_name(value.type) != widget.type:
            self.set(widget, ParameterState("mistyped", robot_type=type_name(value.type), wall=wall))
        else:
            self.set(widget, replace(known, state="live", value=decode_value(widget, value), wall=wall))
        return True

    def mark_unreadable(self, widgets: Iterable[Parameter], wall: float) -> None:
        """The node's response is not decodable."""
        for widget in widgets:
            self.set(widget, ParameterState("unreadable", wall=wall))

    def mark_silent(self, node: str, widgets: Collection[Parameter]) -> None:
        """The node does not respond."""
        if any(self.state(widget).state != "silent" for widget in widgets):
            self._log.warning("%s does not respond to requests for its parameters", node)
        for widget in widgets:
            self.set(widget, replace(self.state(widget), state="silent"))

    def mark_cut(self, widgets: Iterable[Parameter]) -> None:
        """The node is gone. Its values are no longer current."""
        for widget in widgets:
            known = self.state(widget)
            cut = replace(known, state="cut") if known.value is not None else UNKNOWN
            self._robot.parameters[widget.id] = cut
