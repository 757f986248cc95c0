"""A hold: one WebSocket from the press to its end, since a closed socket is noticed at once.
`app/web/hold_protocol.py` describes its messages."""

import asyncio
import json
import secrets
import time
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from typing import Any, Final

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from starlette.types import Message as Received

from app.audit.press_record import PendingEntry
from app.commands.holds.lease import sent_at
from app.commands.holds.receipts import ActiveHold
from app.commands.press_context import PressContext
from app.commands.receipts import Receipt, with_log_fault
from app.errors import InputError, LogError
from app.i18n import localized, say
from app.panel.template import needed_inputs
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.client_cookie import principal_of
from app.web.hold_protocol import END_REASONS, Beat, Begin, End, HoldMessage, Message, read_message
from app.web.language import language_of
from app.web.request_body import received

router = APIRouter()

BEGIN_WITHIN_S: Final = 2.0  # from the opening of the socket
SILENCE_S: Final = 2.0  # without a message the client is gone; its lease ends long before
# 4000 + HTTP's
CLOSE: Final[Mapping[str, int]] = {
    "interlock": 4409,
    "input": 4422,
    "limit": 4429,
    "link": 4503,
    "log": 4503,
}


@router.websocket("/widgets/{widget}/hold")
async def hold(socket: WebSocket, widget: str, state: CurrentState, session: CurrentSession) -> None:
    session.holds.widget(widget)
    await socket.accept()
    served = _HoldSocket(socket, state, session, widget)
    with suppress(WebSocketDisconnect), state.in_flight.track():
        receipt = await served.run(widget)
        if receipt.cause != "limit":
            state.metrics.pressed(receipt.outcome)


class _HoldSocket:
    """One socket and its one hold."""

    def __init__(self, socket: WebSocket, state: AppState, session: RobotSession, widget: str) -> None:
        self._socket = socket
        self._limits = state.limits
        self._session = session
        self._opened_at = time.monotonic()
        self._ended: asyncio.Future[Receipt] = asyncio.get_running_loop().create_future()
        self._who = principal_of(socket, state)
        self._language = language_of(socket)
        self._id = secrets.token_hex(8)  # of the hold: in the log, its receipt and its recording
        self._context = session.press_guard.context_for(widget, self._who)
        self._room = session.press_log.has_room(self._context.origin)
        self._pending: PendingEntry | None = None
        self._receipt: Receipt | None = None  # of its end, when all of it is known
        self._next: asyncio.Future[Received] | None = None  # the browser's next message

    async def run(self, widget: str) -> Receipt:
        """From the first message to the end; the receipt of the hold, of a refusal too."""
        await self._say()
        begun = await self._begun(widget)
        if self._pending is not None:
            self._pending.set_verdict("permitted" if isinstance(begun, ActiveHold) else begun.cause)
        if isinstance(begun, Receipt):
            begun = await self._refused(begun)
            await self._say(state="refused", status=CLOSE[begun.cause] - 4000, **begun.as_json())
            await self._close(CLOSE[begun.cause])
            return begun
        sending = asyncio.create_task(self._send_end())
        try:
            if not self._ended.done():
                await self._say(state="held", lease=begun.lease.id, reason=begun.since)
            await self._listen(begun)
        finally:
            self._session.holds.end(begun, "hold_by_closing")
            await asyncio.gather(sending, return_exceptions=True)
        return self._receipt or self._ended.result()

    async def _begun(self, widget: str) -> Receipt | ActiveHold:
        holds, by = self._session.holds, self._context
        refuse = partial(holds.refuse, widget, hold_id=self._id, trace=self._room)
        try:
            async with asyncio.timeout(BEGIN_WITHIN_S):
                said = await self._read()
        except TimeoutError:
            return refuse(by, say("hold_press_too_late"))
        if not self._limits.admit(self._who):
            return refuse(by, say("press_too_often"), "limit", trace=False)
        if isinstance(said, End):
            return refuse(by, say("hold_released_early"))
        if not isinstance(said, Begin):
            return refuse(by, say("hold_by_invalid_message"))
        sent = self._sent(said)
        inputs = self._session.dispatcher.with_defaults(holds.widget(widget), said.inputs)
        try:
            by = self._context = self._session.press_guard.context_for(widget, self._who, said.seen)
            if not self._room and (left_out := holds.refusal(widget, inputs, sent, by)):
                return left_out
            still_held = await self._log_begin(widget, inputs, by)
        except InputError as error:
            return refuse(by, say("with_stop", said=error.text), "input")
        except LogError as error:
            return refuse(by, error.text, "log")
        if not still_held:
            return refuse(by, say("hold_released_early"))
        return holds.begin(widget, inputs, sent, by, self._ended.set_result, self._id)

    async def _log_begin(self, widget: str, inputs: Mapping[str, Any], context: PressContext) -> bool:
        """Writes the log entry of the press; False if a message, as of an end, arrived before that."""
        own = needed_inputs(self._session.holds.widget(widget), inputs)
        writing = asyncio.ensure_future(
            self._session.press_log.pressed(widget, own, self._id, context.origin, "hold")
        )
        self._next = asyncio.ensure_future(self._received())
        await asyncio.wait({writing, self._next}, return_when=asyncio.FIRST_COMPLETED)
        let_go = self._next.done()
        self._pending = await writing
        return not let_go

    async def _refused(self, receipt: Receipt) -> Receipt:
        """Logs a hold that was refused; its receipt says if the log failed."""
        if self._pending is not None:
            return await self._closed(receipt)
        if receipt.cause == "limit":
            return receipt
        if not self._room:
            self._session.press_log.count_unlogged(self._context.origin)
            return receipt
        why = await self._session.press_log.refused(
            receipt.widget, receipt.inputs, receipt.id, self._context.origin, receipt.reason, "hold"
        )
        return with_log_fault(receipt, why)

    async def _closed(self, receipt: Receipt) -> Receipt:
        """Logs the end of the hold, on the disk before the receipt is sent."""
        why = await self._pending.close(receipt.outcome, receipt.reason) if self._pending else ""
        return with_log_fault(receipt, why)

    async def _listen(self, holding: ActiveHold) -> None:
        """Reads and answers messages until the browser closes the socket or is silent for SILENCE_S,
        after the end of the hold too."""
        with suppress(TimeoutError, WebSocketDisconnect):
            while True:
                async with asyncio.timeout(SILENCE_S):
                    said = await self._read()
                if self._process(said, holding):
                    self._session.control.touch(self._who)
                    await self._say(state="held", **_deflection_texts(holding))
                elif isinstance(said, Beat) and self._receipt is not None:
                    await self._say(state="ended", **self._receipt.as_json())
        await self._close(1000)

    def _process(self, said: Message | None, holding: ActiveHold) -> bool:
        """Applies a message to the hold; False once it has ended."""
        holds = self._session.holds
        if isinstance(said, End) and said.lease in ("", holding.lease.id):
            holds.end(holding, END_REASONS.get(said.why, "hold_by_invalid_message"))
            return False
        if not isinstance(said, Beat) or said.lease != holding.lease.id:
            holds.end(holding, "hold_by_invalid_message")
            return False
        return holds.beat(holding, said.number, self._sent(said), said.deflection)

    async def _received(self) -> Received:
        return await received(self._socket)

    async def _read(self) -> Message | None:
        waiting, self._next = self._next or asyncio.ensure_future(self._received()), None
        try:
            message = await waiting
        finally:
            waiting.cancel()
        if message["type"] == "websocket.disconnect":
            raise WebSocketDisconnect(message.get("code", 1000))
        return read_message(message.get("text") or "")

    def _sent(self, said: HoldMessage) -> float:
        return sent_at(self._opened_at, said.stamp, said.after, time.monotonic())

    async def _send_end(self) -> None:
        """Waits for the end of the hold, whatever ends it, and sends its receipt."""
        receipt = await asyncio.shield(self._ended)
        if receipt.outcome != "unknown" and not await self._session.peer.flushed():
            receipt = self._session.holds.unconfirmed(receipt)
        self._receipt = receipt = await self._closed(receipt)
        with suppress(WebSocketDisconnect, RuntimeError):
            await self._say(state="ended", **receipt.as_json())

    async def _say(self, **what: Any) -> None:
        stamp = round(1000 * (time.monotonic() - self._opened_at), 1)
        said = localized({"stamp": stamp, **what}, self._language)
        await self._socket.send_text(json.dumps(said, ensure_ascii=False))

    async def _close(self, code: int) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):  # the browser was faster
            await self._socket.close(code)


def _deflection_texts(holding: ActiveHold) -> dict[str, Any]:
    """`moves`: the values published for a joystick's deflection, as texts; empty for other widgets."""
    moves = holding.widget.texts_at(*holding.moved)
    return {"moves": moves} if moves else {}
