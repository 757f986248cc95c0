"""Service calls: each gets one answer within its time, and each way of getting none has its words.

A call that timed out is not over: the robot may still do it. Its answer, when it comes late, is
logged and corrects the receipt.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Protocol

from app.clock import format_time
from app.concurrency import spawn_logged
from app.errors import DecodeError
from app.i18n import Text, TextLike, joined, say
from app.interfaces import Fields, Interfaces, plain_text
from app.panel.template import RESPONSE_PLACEHOLDER
from app.panel.widgets.service_action import Call
from app.printable import printable
from app.robot.command_status import CommandStatus, FinalCheck, OnCorrection, Outcome, no_check
from app.robot.state import RobotState
from app.ros_logging import RobotLog, rosout_extra

log = logging.getLogger("kiosk.calls")

LATE_FAILED: Final = "taking in a late answer failed"
CUT_NEWS_S: Final = 0.3
NOTHING: Final = "—"
LONGEST_SAID: Final = 500  # characters of one value: every browser gets it, and logs keep it
LATE_S: Final = 60.0  # how long after its time an answer is still waited for
MOST_UNANSWERED: Final = 8  # the bridge keeps ten requests of a service


class Asker(Protocol):
    """What a call needs of the link: one query, answered with bytes or with None."""

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]": ...


@dataclass(frozen=True, slots=True)
class Request:
    """What a widget asks of a service; `read` makes an answer of the fields at these `paths` of the
    response."""

    widget: str
    service: str
    type: str
    payload: bytes
    timeout_s: float
    paths: tuple[str, ...]
    read: Callable[[Fields], Outcome]


@dataclass(slots=True)
class _Waiting:
    """A call whose query is not over; `cut` is done when the bridge went away in the meantime."""

    request: Request
    press_id: str
    answered: "asyncio.Future[bytes | None]"
    cut: "asyncio.Future[None]"


class ServiceCalls:
    """The calls of one robot; used on the event loop only."""

    def __init__(
        self, interfaces: Interfaces, robot: RobotState, link: Asker, changed: Callable[[], None]
    ) -> None:
        """`changed` is called when what the widgets show has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._link = link
        self._changed = changed
        self._open: dict[int, _Waiting] = {}
        self._ever_answered: set[str] = set()
        self._latest: dict[str, str] = {}
        self._correcting: set[asyncio.Task[None]] = set()

    def unanswered(self, key: str) -> int:
        """How many requests of a service the bridge may still hold."""
        return sum(self._robot.key(w.request.service) == key for w in self._open.values())

    def full(self, service: str) -> TextLike:
        """Why no further request of a service is sent; "" while one may be."""
        full = self.unanswered(self._robot.key(service)) >= MOST_UNANSWERED
        return say("too_many", service=service) if full else ""

    def follow(self) -> None:
        """After every change of the graph: without a bridge no answer will come."""
        if not self._robot.graph.bridges:
            for waiting in self._open.values():
                if not waiting.cut.done():
                    waiting.cut.set_result(None)

    def mark_answered(self, service: str) -> None:
        """This service can answer: another one of its node has."""
        self._ever_answered.add(service)

    async def call(
        self,
        widget: Call,
        payload: bytes,
        press_id: str,
        corrected: OnCorrection,
        look: FinalCheck = no_check,
    ) -> Outcome:
        """Calls the service of a widget; see `ask`."""
        _, response_type = self._interfaces.service_types(widget.type)
        success = field_of(self._interfaces, response_type, widget.success, "success", "bool")
        message = field_of(self._interfaces, response_type, widget.message, "message", "string")
        paths = (*filter(None, (success, message)), *RESPONSE_PLACEHOLDER.findall(widget.answer))
        read = partial(_read_call, widget, success, message)
        to = (widget.id, widget.service, widget.type)
        request = Request(*to, payload, widget.timeout_s, paths, read)
        return await self.ask(request, press_id, corrected, look)

    async def ask(
        self, request: Request, press_id: str, corrected: OnCorrection, look: FinalCheck = no_check
    ) -> Outcome:
        """Sends a request and waits; `corrected` gets the answer that comes after the time."""
        key = self._robot.key(request.service)
        if why := self.full(request.service):
            return Outcome("refused", why)
        loop = asyncio.get_running_loop()
        look()
        query = self._link.query(key, request.payload, request.timeout_s + LATE_S)
        waiting = _Waiting(request, press_id, query, loop.create_future())
        number = id(waiting)
        self._open[number] = waiting
        query.add_done_callback(lambda _: self._open.pop(number, None))
        self._latest[request.widget] = press_id
        self._show(request, CommandStatus(busy=True, text=say("waiting_for_answer")))
        answer = await self._awaited(waiting, corrected)
        self._show(request, CommandStatus(outcome=answer.outcome, text=answer.text))
        return answer

    async def _awaited(self, waiting: _Waiting, corrected: OnCorrection) -> Outcome:
        asked = waiting.request
        ends: set[asyncio.Future[Any]] = {waiting.answered, waiting.cut}
        await asyncio.wait(ends, timeout=asked.timeout_s, return_when=asyncio.FIRST_COMPLETED)
        if waiting.answered.done() and (reply := waiting.answered.result()) is not None:
            return await self._read(asked, reply)
        if waiting.answered.done():  # without an answer: the news that the bridge is gone may follow
            await asyncio.wait({waiting.cut}, timeout=CUT_NEWS_S)
        else:
            waiting.answered.add_done_callback(lambda done: self._late(waiting, done, corrected))
        if waiting.cut.done() or not self._robot.graph.bridges:
            return Outcome("unknown", say("call_cut"))
        if waiting.answered.done():
            return Outcome("unknown", say("call_dropped", service=asked.service))
        hint = "" if asked.service in self._ever_answered else say("cyclone_hint")
        sentence = say("timed_out", seconds=f"{asked.timeout_s:g}")
        return Outcome("timed_out", joined([sentence, hint]))

    def _late(
        self, waiting: _Waiting, done: "asyncio.Future[bytes | None]", corrected: OnCorrection
    ) -> None:
        if done.cancelled() or (reply := done.result()) is None:
            return
        task = spawn_logged(self._correct(waiting, reply, corrected), self._log, LATE_FAILED)
        self._correcting.add(task)
        task.add_done_callback(self._correcting.discard)

    async def _correct(self, waiting: _Waiting, reply: bytes, corrected: OnCorrection) -> None:
        asked = waiting.request
        answer = await self._read(asked, reply)
        said = f"press {waiting.press_id}: a late answer: {answer.outcome}"
        self._log.warning("%s: %s", said, answer.text, extra=rosout_extra(said))
        corrected(waiting.press_id, answer)
        if self._latest.get(asked.widget) == waiting.press_id:
            self._show(asked, CommandStatus(outcome=answer.outcome, text=answer.text))

    async def _read(self, asked: Request, reply: bytes) -> Outcome:
        self._ever_answered.add(asked.service)
        _, response_type = self._interfaces.service_types(asked.type)
        reader = self._interfaces.field_reader(response_type, asked.paths)
        try:
            fields = await self._robot.slices.read_all(reader, reply)
        except DecodeError as error:
            self._log.error("%s: %s", asked.service, error)
            return Outcome("unknown", say("answer_unreadable", wanted=asked.type))
        return asked.read(fields)

    def _show(self, asked: Request, progress: CommandStatus) -> None:
        self._robot.command_status[asked.widget] = progress
        self._changed()


def field_of(
    interfaces: Interfaces, type_name: str, given: str | None, usual: str, kind: str
) -> str | None:
    """The field that the panel names, or the usual one where the type has it with the right kind."""
    if given is not None:
        return given
    own = {field.name: str(field.type) for field in interfaces.structures[type_name].fields}
    return usual if own.get(usual) == kind else None


def _read_call(widget: Call, success: str | None, message: str | None, fields: Fields) -> Outcome:
    """What a response says; `success` and `message` are its fields that mean this, if there are any."""
    words = [with_fields(f"{{{message}}}", fields)] if message else []
    words += [with_fields(widget.answer, fields)] if widget.answer else []
    said = " – ".join(word for word in words if word)
    now = format_time(time.time())
    if success is None or fields.get(success):
        return Outcome("succeeded", with_reply(say("answered", time=now), said))
    return Outcome("rejected", with_reply(say("said_no", time=now), said))


def with_reply(said: Text, reply: str) -> Text:
    """A sentence and what the robot said, which may be ""."""
    return say("with_reply", said=said, reply=reply) if reply else say("with_stop", said=said)


def with_fields(template: str, fields: Fields, within: str = "") -> str:
    """The template with each `{path}` (behind `within`) replaced by that field's value: cut where it is
    long, "—" where it is not there."""

    def shown(path: str) -> str:
        value = fields.get(within + path)
        return NOTHING if value is None else printable(plain_text(value, LONGEST_SAID))

    return RESPONSE_PLACEHOLDER.sub(lambda found: shown(found[1]), template)
