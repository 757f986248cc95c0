"""Service calls: one response within the timeout, or a reason why there is none.

After a timeout the robot may still execute the request. A late response is logged and corrects the
receipt.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from app.clock import format_time
from app.commands.press import PressHandle
from app.commands.transport import Transport
from app.concurrency import spawn_logged
from app.errors import DecodeError
from app.i18n import PanelText, Text, TextLike, hint, joined, number, say
from app.i18n.values import filled_in, together
from app.interfaces import Fields, Interfaces, plain_text
from app.panel.response_text import ResponseField, is_number, pieces, response_paths
from app.panel.widgets.service_action import Call
from app.printable import printable, without_terminal_codes
from app.robot.command_status import CommandStatus, Outcome
from app.robot.state import RobotState
from app.ros_logging import RobotLog, rosout_extra

log = logging.getLogger("kiosk.calls")

LATE_FAILED: Final = "processing a late response failed"
NO_VALUE: Final = "—"
MAX_VALUE_CHARS: Final = 500  # of one value: every browser gets it, and logs keep it
LATE_S: Final = 60.0  # after the timeout, a response still corrects the receipt


@dataclass(frozen=True, slots=True)
class Request:
    """A widget's service request; `read` converts the fields at `paths` of the response to an
    outcome."""

    widget: str
    service: str
    type: str
    payload: bytes
    timeout_s: float
    paths: tuple[str, ...]
    read: Callable[[Fields], Outcome]


@dataclass(slots=True)
class _Waiting:
    """A call whose query is open; `cut` is done when the peer was lost in the meantime."""

    request: Request
    handle: PressHandle
    answered: "asyncio.Future[bytes | None]"
    cut: "asyncio.Future[None]"


class ServiceCalls:
    """The service calls of one robot. Used on the event loop only."""

    def __init__(
        self,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        changed: Callable[[], None],
    ) -> None:
        """`changed` is called when the status of a command has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._transport = transport
        self._changed = changed
        self._open: dict[int, _Waiting] = {}
        self._answering: set[str] = set()
        self._latest: dict[str, str] = {}
        self._correcting: set[asyncio.Task[None]] = set()

    def unanswered(self, key: str) -> int:
        """How many requests of a service the peer may still hold."""
        return sum(self._robot.key(w.request.service) == key for w in self._open.values())

    def full(self, service: str) -> TextLike:
        """Why no further request of a service may be sent, "" if it may."""
        full = self.unanswered(self._robot.key(service)) >= self._robot.traits.max_unanswered
        return say("call_too_many_pending", service=service) if full else ""

    def on_graph_change(self) -> None:
        """Ends the waiting calls if no peer is left. Call it after every change of the graph."""
        if not self._robot.graph.peers:
            for waiting in self._open.values():
                if not waiting.cut.done():
                    waiting.cut.set_result(None)

    def mark_answered(self, service: str) -> None:
        """Marks a service as able to respond, because another service of its node did."""
        self._answering.add(service)

    async def call(self, widget: Call, payload: bytes, handle: PressHandle) -> Outcome:
        """Calls the service of a widget; see `send_request`."""
        _, response_type = self._interfaces.service_types(widget.type)
        success = field_of(self._interfaces, response_type, widget.success, "success", "bool")
        message = field_of(self._interfaces, response_type, widget.message, "message", "string")
        paths = (*filter(None, (success, message)), *response_paths(widget.answer))
        read = partial(_read_call, widget, success, message)
        to = (widget.id, widget.service, widget.type)
        request = Request(*to, payload, widget.timeout_s, paths, read)
        return await self.send_request(request, handle)

    async def send_request(self, request: Request, handle: PressHandle) -> Outcome:
        """Sends a request and waits for its outcome; a late one corrects the receipt."""
        key = self._robot.key(request.service)
        if why := self.full(request.service):
            return Outcome("refused", why)
        loop = asyncio.get_running_loop()
        handle.final_check()
        query = self._transport.query(key, request.payload, request.timeout_s + LATE_S)
        waiting = _Waiting(request, handle, query, loop.create_future())
        number = id(waiting)
        self._open[number] = waiting
        query.add_done_callback(lambda _: self._open.pop(number, None))
        self._latest[request.widget] = handle.press_id
        self._show(request, CommandStatus(busy=True, text=say("call_waiting")))
        answer = await self._response(waiting)
        self._show(request, CommandStatus(outcome=answer.outcome, text=answer.text))
        return answer

    async def _response(self, waiting: _Waiting) -> Outcome:
        request, sentences = waiting.request, self._robot.traits.sentences
        ends: set[asyncio.Future[Any]] = {waiting.answered, waiting.cut}
        await asyncio.wait(ends, timeout=request.timeout_s, return_when=asyncio.FIRST_COMPLETED)
        if waiting.answered.done() and (reply := waiting.answered.result()) is not None:
            return await self._read(request, reply)
        if waiting.answered.done():  # without a reply: the peer's token may end a little later
            await asyncio.wait({waiting.cut}, timeout=self._robot.traits.loss_delay_s)
        else:
            waiting.answered.add_done_callback(partial(self._on_late_response, waiting))
        if waiting.cut.done() or not self._robot.graph.peers:
            return Outcome("unknown", say("call_connection_lost"))
        if waiting.answered.done():
            return Outcome("unknown", say(sentences.no_reply, service=request.service))
        advice = "" if request.service in self._answering else hint(sentences.timeout_hint)
        sentence = say("timed_out", seconds=number(f"{request.timeout_s:g}"))
        return Outcome("timed_out", joined([sentence, advice]))

    def _on_late_response(self, waiting: _Waiting, done: "asyncio.Future[bytes | None]") -> None:
        if done.cancelled() or (reply := done.result()) is None:
            return
        task = spawn_logged(self._correct(waiting, reply), self._log, LATE_FAILED)
        self._correcting.add(task)
        task.add_done_callback(self._correcting.discard)

    async def _correct(self, waiting: _Waiting, reply: bytes) -> None:
        request, handle = waiting.request, waiting.handle
        answer = await self._read(request, reply)
        line = f"press {handle.press_id}: late response: {answer.outcome}"
        self._log.warning("%s: %s", line, answer.text, extra=rosout_extra(line))
        handle.correct(answer)
        if self._latest.get(request.widget) == handle.press_id:
            self._show(request, CommandStatus(outcome=answer.outcome, text=answer.text))

    async def _read(self, request: Request, reply: bytes) -> Outcome:
        self._answering.add(request.service)
        _, response_type = self._interfaces.service_types(request.type)
        reader = self._interfaces.field_reader(response_type, request.paths)
        try:
            fields = await self._robot.slices.read_all(reader, reply)
        except DecodeError as error:
            self._log.error("%s: %s", request.service, error)
            return Outcome("unknown", say("call_response_unreadable", wanted=request.type))
        return request.read(fields)

    def _show(self, request: Request, progress: CommandStatus) -> None:
        self._robot.command_status[request.widget] = progress
        self._changed()


def field_of(
    interfaces: Interfaces, type_name: str, name: str | None, usual: str, kind: str
) -> str | None:
    """The field named in the panel file, else the `usual` one if the type has it with this type."""
    if name is not None:
        return name
    own = {field.name: str(field.type) for field in interfaces.structures[type_name].fields}
    return usual if own.get(usual) == kind else None


def _read_call(widget: Call, success: str | None, message: str | None, fields: Fields) -> Outcome:
    """The outcome in a response; `success` and `message` are the names of these fields, None
    without."""
    words = [with_fields(f"{{{message}}}", fields)] if message else []
    words += [with_fields(widget.answer, fields)] if widget.answer else []
    several = [part for word in words if word for part in (" – ", word)]
    reply = together(several[1:])
    now = format_time(time.time())
    if success is None or fields.get(success):
        return Outcome("succeeded", with_reply(say("call_succeeded", time=now), reply))
    return Outcome("rejected", with_reply(say("call_rejected", time=now), reply))


def with_reply(sentence: Text, reply: TextLike) -> Text:
    """A sentence, followed by the robot's own text if there is one."""
    return say("with_reply", said=sentence, reply=reply) if reply else say("with_stop", said=sentence)


def with_fields(template: str | PanelText, fields: Fields, within: str = "") -> TextLike:
    """The template with each `{path}` (relative to `within`) replaced by the field's value, shortened
    if it is long, "—" if the message has no such element."""

    def shown(field: ResponseField) -> TextLike:
        value = fields.get(within + field.path)
        if value is None:
            return NO_VALUE
        if is_number(value):
            return number(field.text(value))
        return printable(plain_text(value, MAX_VALUE_CHARS, without_terminal_codes))

    def filled(text: str) -> TextLike:
        parts = pieces(text)
        return together(shown(part) if isinstance(part, ResponseField) else part for part in parts)

    if isinstance(template, str):
        return filled(template)
    return filled_in(template, filled)
