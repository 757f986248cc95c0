"""Service calls of presses, and calls that read the options of selects."""

import asyncio
import json
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

from app.cell.commands.press import PressHandle
from app.cell.commands.transport import Transport
from app.cell.permission.verdict import server_offered
from app.cell.robot.definitions import timeout_hint
from app.cell.robot.option_list import OptionList
from app.cell.robot.state import RobotState
from app.panel.known_values import known_value
from app.panel.model import Panel
from app.panel.response_text import ResponseField, is_number, pieces, response_paths
from app.panel.robot_texts import NO_TEXTS, RobotTexts, robot_text
from app.panel.widgets.robot_options import EACH, MOST, ListingService
from app.panel.widgets.service_action import Call
from app.records.entry import CommandStatus, Outcome
from app.ros.messages import Fields, Interfaces, plain_text
from app.system.clock import format_time
from app.system.concurrency import end_tasks, keep_running, spawn_logged
from app.system.errors import DecodeError, LinkError
from app.system.log import RobotLog, rosout_extra
from app.system.printable import printable, without_terminal_codes
from app.system.texts import PanelText, Text, TextLike, hint, joined, number, say
from app.system.texts.text import filled_in, together

# Service calls: one response within the timeout, or a reason why there is none.
#
# After a timeout the robot may still execute the request. A late response is logged and corrects the
# receipt.

log = logging.getLogger("kiosk.calls")

LATE_FAILED: Final = "processing a late response failed"
NO_VALUE: Final = "—"
MAX_VALUE_CHARS: Final = 500  # of one value: every browser gets it, and logs keep it
LATE_S: Final = 60.0  # after the timeout, a response still corrects the receipt


@dataclass(frozen=True, slots=True)
class ServiceRequest:
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

    request: ServiceRequest
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
        status_set: Callable[[str], None],
    ) -> None:
        """`status_set` is called with the id of a widget of which the status has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._transport = transport
        self._status_set = status_set
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
        read = partial(_read_call, widget, (success, message), self._robot.texts)
        to = (widget.id, widget.service, widget.type)
        request = ServiceRequest(*to, payload, widget.timeout_s, paths, read)
        return await self.send_request(request, handle)

    async def send_request(self, request: ServiceRequest, handle: PressHandle) -> Outcome:
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
        key = self._robot.key(request.service)  # below: what the node is, while it is there
        known_hint = timeout_hint(self._robot.graph, "SS", key, sentences.timeout_hint)
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
        advice = "" if request.service in self._answering else hint(known_hint)
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
        if self._latest.get(request.widget) == handle.press_id:
            self._show(request, CommandStatus(outcome=answer.outcome, text=answer.text))
        handle.correct(answer)

    async def _read(self, request: ServiceRequest, reply: bytes) -> Outcome:
        self._answering.add(request.service)
        _, response_type = self._interfaces.service_types(request.type)
        reader = self._interfaces.field_reader(response_type, request.paths)
        try:
            fields = await self._robot.slices.read_all(reader, reply)
        except DecodeError as error:
            self._log.error("%s: %s", request.service, error)
            return Outcome("unknown", say("call_response_unreadable", wanted=request.type))
        return request.read(fields)

    def _show(self, request: ServiceRequest, progress: CommandStatus) -> None:
        self._robot.command_status[request.widget] = progress
        self._status_set(request.widget)


def field_of(
    interfaces: Interfaces, type_name: str, name: str | None, usual: str, kind: str
) -> str | None:
    """The field named in the panel file, else the `usual` one if the type has it with this type."""
    if name is not None:
        return name
    own = {field.name: str(field.type) for field in interfaces.structures[type_name].fields}
    return usual if own.get(usual) == kind else None


def _read_call(
    widget: Call, names: tuple[str | None, str | None], texts: RobotTexts, fields: Fields
) -> Outcome:
    """The outcome in a response; `names` are those of the fields `success` and `message`, None
    without."""
    success, message = names
    words = [with_fields(f"{{{message}}}", fields, texts=texts)] if message else []
    words += (
        [with_fields(widget.answer, fields, texts=texts, kind=widget.type)] if widget.answer else []
    )
    several = [part for word in words if word for part in (" – ", word)]
    reply = together(several[1:])
    now = format_time(time.time())
    if success is None or fields.get(success):
        return Outcome("succeeded", with_reply(say("call_succeeded", time=now), reply))
    return Outcome("rejected", with_reply(say("call_rejected", time=now), reply))


def reply_of(text: TextLike) -> TextLike:
    """The robot's own text in such a sentence; "" without one."""
    if not isinstance(text, Text) or text.code != "with_reply":
        return ""
    reply = dict(text.params)["reply"]
    return reply if isinstance(reply, str | Text) else ""


def with_reply(sentence: Text, reply: TextLike) -> Text:
    """A sentence, followed by the robot's own text if there is one."""
    return say("with_reply", said=sentence, reply=reply) if reply else say("with_stop", said=sentence)


def value_in_words(value: Any, texts: RobotTexts) -> TextLike:
    """A value that is no number, shortened if it is long."""
    plain = printable(plain_text(value, MAX_VALUE_CHARS, without_terminal_codes))
    return robot_text(texts, value, plain)


def with_fields(
    template: str | PanelText,
    fields: Fields,
    within: str = "",
    texts: RobotTexts = NO_TEXTS,
    kind: str = "",
) -> TextLike:
    """The template with each `{path}` (relative to `within`) replaced by the field's value, shortened
    if it is long, "—" if the message has no such element. `texts` are those of the panel file, `kind`
    is the type of the service or action, whose known numbers are sentences."""

    def shown(field: ResponseField) -> TextLike:
        value = fields.get(within + field.path)
        if value is None:
            return NO_VALUE
        if not field.is_written and (known := known_value(kind, field.path, value)):
            return known
        if is_number(value):
            return number(field.text(value))
        return value_in_words(value, texts)

    def filled(text: str) -> TextLike:
        parts = pieces(text)
        return together(shown(part) if isinstance(part, ResponseField) else part for part in parts)

    if isinstance(template, str):
        return filled(template)
    return filled_in(template, filled)


# Calls the services that list the options of selects, again and again while their servers are there.
#
# A list is forgotten as soon as its server is gone: until the next one answers, what may be chosen is
# not known.

options_log = logging.getLogger("kiosk.options")

FAILED: Final = "asking for the options of a select failed"
ANSWER_S: Final = 10.0  # an answer that takes longer does not count, and the service is called again


@dataclass(slots=True, eq=False)
class _Listing:
    """A service, how often it is called, and the task that does it while the server is there."""

    service: ListingService
    every_s: float
    task: "asyncio.Task[None] | None" = None


class OptionLists:
    """The lists of one robot's services. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        changed: Callable[[], None],
    ) -> None:
        """`changed` is called when a list has changed, is renewed or is forgotten."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(options_log, robot.name)
        self._transport = transport
        self._changed = changed
        self._listings = [_Listing(*named) for named in panel.option_services().items()]

    def on_graph_change(self) -> None:
        """Starts to call new servers and stops for lost ones. Call it after every change of the
        graph."""
        for listing in self._listings:
            service = listing.service
            offered = server_offered("SS", service.name, service.type, self._robot) is None
            if not (offered and self._robot.graph.peers):
                self._cut(listing)
            elif listing.task is None:
                listing.task = keep_running(partial(self._keep_asking, listing), self._log, FAILED)

    async def stop(self) -> None:
        """Ends the tasks."""
        await end_tasks(listing.task for listing in self._listings)

    def _cut(self, listing: _Listing) -> None:
        if listing.task is None:
            return
        listing.task.cancel()
        listing.task = None
        if self._robot.option_lists.pop(listing.service, None) is not None:
            self._changed()

    async def _keep_asking(self, listing: _Listing) -> None:
        await asyncio.sleep(self._robot.traits.server_settle_s)  # earlier requests may be lost
        while True:
            texts = await self._ask(listing.service)
            if texts is not None:
                self._robot.option_lists[listing.service] = OptionList(texts, time.monotonic())
                self._changed()
            await asyncio.sleep(listing.every_s)

    async def _ask(self, service: ListingService) -> tuple[str, ...] | None:
        """The texts of one answer; None without one in time, or for one that can't be read."""
        request, response = self._interfaces.service_types(service.type)
        payload = self._interfaces.encode(request, json.loads(service.request))
        try:
            reply = await self._transport.query(self._robot.key(service.name), payload, ANSWER_S)
        except LinkError as error:
            self._log.debug("%s: %s", service.name, error)
            return None
        if reply is None:
            self._log.warning("%s did not list its options within %g s", service.name, ANSWER_S)
            return None
        try:
            return await self._texts(response, service.field, reply)
        except DecodeError as error:
            self._log.error("%s: %s", service.name, error)
            return None

    async def _texts(self, response: str, field: str, reply: bytes) -> tuple[str, ...]:
        """The texts in a response: of a list, or a field of each message of a list."""
        slices = self._robot.slices
        if EACH not in field:
            fields = await slices.read_all(self._interfaces.field_reader(response, [field]), reply)
            return tuple(fields.get(field) or ())
        path, item = field.split(EACH, 1)
        rows = await slices.read_all(self._interfaces.row_reader(response, path, [item], MOST), reply)
        return tuple(str(row[0]) for row in rows.values)
