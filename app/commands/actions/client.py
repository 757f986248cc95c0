"""Client of an action server's services: `send_goal`, `cancel_goal`, `get_result`.

Wire format: ROS 2's `<action>/_action/…` services (design.ros2.org, "Actions").
"""

import asyncio
import logging
import time
import uuid
from typing import Any, Final

from app.clock import format_time
from app.commands.actions.goal import Goal
from app.commands.transport import Transport
from app.errors import DecodeError
from app.i18n import Text, hint, joined, number, say
from app.interfaces import Fields, Interfaces
from app.interfaces.names import of_action
from app.panel.response_text import response_paths
from app.panel.widgets.service_action import Action
from app.robot.command_status import Outcome
from app.robot.state import RobotState
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.actions")

CANCEL: Final = "action_msgs/srv/CancelGoal"
STATUS: Final = "status"
RESULT: Final = "result."  # prefix of the result's fields in the response of `get_result`
NO_SUCH_GOAL: Final = frozenset({2, 3})  # ERROR_UNKNOWN_GOAL_ID, ERROR_GOAL_TERMINATED

Query = asyncio.Future[bytes | None]


class ActionClient:
    """The action services of one robot. Methods that send raise LinkError if the request could not be
    sent; methods that read a reply return None if it is not readable."""

    def __init__(self, interfaces: Interfaces, robot: RobotState, transport: Transport) -> None:
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._transport = transport

    def is_offered(self, widget: Action) -> bool:
        """Whether the robot offers a widget's action with the same type."""
        return self._robot.graph.server_type("AS", self._robot.key(widget.action)) == widget.type

    def goal_request(self, widget: Action, goal_id: uuid.UUID, fields: dict[str, Any]) -> bytes:
        """The encoded request of `send_goal`; FieldError for bad fields."""
        wrapped = {"goal_id": {"uuid": list(goal_id.bytes)}, "goal": fields}
        return self._interfaces.encode(
            self._interfaces.action_types(widget.type).send_goal_request, wrapped
        )

    def send_goal(self, widget: Action, request: bytes) -> Query:
        return self._query(widget, "send_goal", request, widget.timeout_s)

    def cancel_goal(self, goal: Goal) -> Query:
        request, _ = self._interfaces.service_types(CANCEL)
        stamp = {"sec": 0, "nanosec": 0}
        info = {"goal_id": {"uuid": list(goal.id.bytes)}, "stamp": stamp}
        payload = self._interfaces.encode(request, {"goal_info": info})
        return self._query(goal.widget, "cancel_goal", payload, goal.widget.timeout_s)

    def get_result(self, goal: Goal, timeout_s: float) -> Query:
        request = self._interfaces.action_types(goal.widget.type).get_result_request
        payload = self._interfaces.encode(request, {"goal_id": {"uuid": list(goal.id.bytes)}})
        return self._query(goal.widget, "get_result", payload, timeout_s)

    def _query(self, widget: Action, service: str, payload: bytes, timeout_s: float) -> Query:
        key = of_action(self._robot.key(widget.action), service)
        return self._transport.query(key, payload, timeout_s)

    async def reply(self, goal: Goal, query: Query) -> bytes | None:
        """The reply; None at a timeout, or if the peer was lost in the meantime."""
        ends: set[asyncio.Future[Any]] = {query} if goal.cut.done() else {query, goal.cut}
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        reply = query.result() if query.done() else None
        if reply is None:
            # The peer's token may end a little later.
            await asyncio.wait({goal.cut}, timeout=self._robot.traits.loss_delay_s)
        return reply

    def goal_response(self, goal: Goal, reply: bytes | None) -> Outcome:
        """The outcome of `send_goal`, from its reply; None stands for no reply."""
        widget, now = goal.widget, format_time(time.time())
        if reply is not None:
            response = self._interfaces.action_types(widget.type).send_goal_response
            message = self._decoded(widget, response, reply)
            if message is None:
                return Outcome("unknown", say("call_response_unreadable", wanted=widget.type))
            if message.accepted:
                return Outcome("accepted", say("goal_accepted", time=now))
            return Outcome("rejected", say("goal_rejected", time=now))
        if goal.cut.done():
            return Outcome("unknown", goal.cut.result() or say("call_connection_lost"))
        sentence = say("timed_out", seconds=number(f"{widget.timeout_s:g}"))
        return Outcome("timed_out", joined([sentence, hint(self._robot.traits.sentences.timeout_hint)]))

    def cancel_response(self, widget: Action, reply: bytes) -> Any:
        """The response of `cancel_goal`: a message with `return_code` and `goals_canceling`."""
        return self._decoded(widget, self._interfaces.service_types(CANCEL)[1], reply)

    def no_response_reason(self, widget: Action) -> Text:
        """Why `cancel_goal` did not respond."""
        if self.is_offered(widget):
            return say("timed_out", seconds=number(f"{widget.timeout_s:g}"))
        return say("cancel_may_not_have_arrived", name=widget.action)

    async def result(self, widget: Action, reply: bytes) -> Fields | None:
        """The response of `get_result`: the status, and the result fields that the widget shows."""
        paths = (STATUS, *(RESULT + path for path in response_paths(widget.result)))
        response = self._interfaces.action_types(widget.type).get_result_response
        try:
            return await self._robot.slices.read_all(
                self._interfaces.field_reader(response, paths), reply
            )
        except DecodeError as error:
            self._log.error("%s: %s", widget.action, error)
            return None

    def _decoded(self, widget: Action, type_name: str, reply: bytes) -> Any:
        try:
            return self._interfaces.decode(type_name, reply)
        except DecodeError as error:
            self._log.error("%s: %s", widget.action, error)
            return None
