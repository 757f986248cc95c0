"""What is said on the WebSocket of a hold.

The server speaks first. Every message of the server's has `stamp`, its own time in ms since the socket
opened; every message of the browser's has the last `stamp` that it got, and `after`, for how many ms it
had it: so each one's age is known. Without an answer no browser shows that something is held.

    server   {"stamp": 0.2}
    browser  {"do": "begin", "inputs": {…}, "seen": "<instance>-<version>", "stamp": 0.2, "after": 0.9}
    server   {"stamp": 2.1, "state": "held", "lease": "…", "reason": "Held since 10:00:00."}
    browser  {"do": "beat", "number": 1, "lease": "…", "stamp": 2.1, "after": 80}
    server   {"stamp": 83.0, "state": "held"}
    browser  {"do": "end", "why": "released", "lease": "…", "stamp": 83.0, "after": 12}
    server   {"stamp": 96.4, "state": "ended", "outcome": "published", "code": "hold_released", …}

A joystick's beats have its deflection, `x` to the right and `y` to the front, each from -1 to 1; the
answer has `moves`, what was sent of it. One out of these limits is no message, and ends the hold.

A begin may have a `confirmation`, for a widget whose press a person confirms.

An end without a lease is that of a browser which has no answer to its begin yet; it may come instead of
a begin, too, and is answered as any other.
"""

import asyncio
import json
import secrets
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, Final, Literal

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import BaseModel, ConfigDict, Field, JsonValue, TypeAdapter, ValidationError
from starlette.types import Message as Received

from app.cell.commands.holds import RELEASED, ActiveHold, Deflection, sent_at
from app.cell.commands.press import EVENT_ID, Press
from app.cell.commands.receipts import Receipt, Refusal, with_log_fault
from app.cell.session.session import RobotSession
from app.panel.widgets.hold import HoldCommand
from app.records.press_record import PendingEntry
from app.system.errors import Cause, InputError, LogError
from app.system.texts import TextLike, localized, say
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.caller import LONGEST_TOKEN, Caller, caller_of, confirmed
from app.web.requests import json_of, received

# What a browser may say of why it ends a hold → the code of the sentence.
END_REASONS: Final[Mapping[str, str]] = {
    "released": RELEASED,
    "cancel": "hold_by_cancel",
    "sliding": "hold_by_sliding",
    "moved": "hold_by_moved_button",
    "second": "hold_by_second_finger",
    "menu": "hold_by_menu",
    "blur": "hold_by_blur",
    "hiding": "hold_by_hiding",
    "leaving": "hold_by_leaving",
    "lock": "hold_by_lock",
    "escape": "hold_by_escape",
    "gamepad": "hold_by_gamepad",
    "silence": "hold_by_no_response",
}
Deflected = Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]
Milliseconds = Annotated[float, Field(ge=0, le=1e12, allow_inf_nan=False)]


class HoldMessage(BaseModel):
    """The fields of every message of a browser."""

    model_config = ConfigDict(extra="forbid")

    stamp: Milliseconds
    after: Milliseconds


class Begin(HoldMessage):
    do: Literal["begin"]
    inputs: dict[str, JsonValue]
    seen: Annotated[str, Field(pattern=EVENT_ID)]
    confirmation: Annotated[str, Field(max_length=LONGEST_TOKEN)] = ""


class Beat(HoldMessage):
    do: Literal["beat"]
    lease: str
    number: Annotated[int, Field(ge=1)]
    x: Deflected | None = None
    y: Deflected | None = None

    @property
    def deflection(self) -> Deflection | None:
        """The deflection of a joystick, if both axes are given."""
        return None if self.x is None or self.y is None else (self.x, self.y)


class End(HoldMessage):
    do: Literal["end"]
    lease: str = ""
    why: str


Message = Begin | Beat | End
_message: TypeAdapter[Message] = TypeAdapter(Annotated[Message, Field(discriminator="do")])


def read_message(text: str) -> Message | None:
    """The message in a browser's text; None if it is invalid."""
    try:
        return _message.validate_python(json_of(text))
    except (InputError, ValidationError):
        return None


# A hold: one WebSocket from the press to its end, since a closed socket is noticed at once.

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
    "role": 4403,
}


@router.websocket("/widgets/{widget}/hold")
async def hold(socket: WebSocket, widget: str, state: CurrentState, session: CurrentSession) -> None:
    command = session.holds.widget(widget)
    await socket.accept()
    who = caller_of(socket)
    press = Press(secrets.token_hex(8), command, {}, who.principal)
    served = _HoldSocket(socket, state, session, press, who)
    holding = state.access.sessions.holding(who.session)
    with suppress(WebSocketDisconnect), state.in_flight.track(), holding:
        receipt = await served.run()
        if receipt.cause != "limit":
            state.metrics.pressed(receipt.outcome)


class _HoldSocket:
    """One socket and its one hold. The press has no inputs, and the event that the operator saw only
    after the message that begins the hold."""

    def __init__(
        self,
        socket: WebSocket,
        state: AppState,
        session: RobotSession,
        press: Press[HoldCommand],
        who: Caller,
    ) -> None:
        self._socket = socket
        self._state = state
        self._who = who
        self._limits = state.limits
        self._session = session
        self._opened_at = time.monotonic()
        self._ended: asyncio.Future[Receipt] = asyncio.get_running_loop().create_future()
        self._language = who.language
        self._press = press
        session.press_guard.receive(press)
        self._room = session.press_log.has_room(press.origin)
        self._pending: PendingEntry | None = None
        self._receipt: Receipt | None = None  # of its end, when all of it is known
        self._next: asyncio.Future[Received] | None = None  # the browser's next message

    async def run(self) -> Receipt:
        """From the first message to the end; the receipt of the hold, of a refusal too."""
        await self._say()
        begun = await self._open_hold()
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
            with self._state.access.notifying(partial(self._check_user, begun)):
                self._check_user(begun)  # it may have changed while the press was logged
                await self._listen(begun)
        finally:
            self._session.holds.end(begun, "hold_by_closing")
            await asyncio.gather(sending, return_exceptions=True)
        return self._receipt or self._ended.result()

    def _check_user(self, holding: ActiveHold) -> None:
        """Ends the hold of a user who has signed out, is disabled, or may do something else now."""
        now, then = self._who.principal, self._press.principal
        if (now.user, now.role, now.groups) != (then.user, then.role, then.groups):
            self._session.holds.end(holding, "hold_by_sign_out")

    async def _open_hold(self) -> Receipt | ActiveHold:
        try:
            async with asyncio.timeout(BEGIN_WITHIN_S):
                message = await self._read()
        except TimeoutError:
            return self._refuse(say("hold_press_too_late"))
        if not self._limits.admit(self._press.principal):
            refusal = Refusal(say("press_too_often"), "limit")
            return self._session.holds.refuse(self._press, refusal, recorded=False)
        if isinstance(message, End):
            return self._refuse(say("hold_released_early"))
        if not isinstance(message, Begin):
            return self._refuse(say("hold_by_invalid_message"))
        return await self._begin(message, self._sent(message))

    async def _begin(self, message: Begin, sent: float) -> Receipt | ActiveHold:
        """Begins the hold, sent at `sent` (monotonic seconds) at the latest."""
        holds, seen = self._session.holds, replace(self._press, seen=message.seen)
        press = replace(seen, inputs=message.inputs)
        press = confirmed(self._state, self._who, press, message.confirmation)
        press = self._session.dispatcher.with_defaults(press)
        try:
            self._session.press_guard.receive(press)
            self._press = seen
            if not self._room and (unlogged := holds.refusal(press, sent)):
                return unlogged
            still_held = await self._log_begin(press)
        except InputError as error:
            return self._refuse(say("with_stop", said=error.text), "input")
        except LogError as error:
            return self._refuse(error.text, "log")
        if not still_held:
            return self._refuse(say("hold_released_early"))
        return holds.begin(press, sent, self._ended.set_result)

    def _refuse(self, reason: TextLike, cause: Cause = "interlock") -> Receipt:
        """Refuses the hold without checking permission."""
        refusal = Refusal(reason, cause)
        return self._session.holds.refuse(self._press, refusal, recorded=self._room)

    async def _log_begin(self, press: Press[HoldCommand]) -> bool:
        """Writes the log entry of the press; False if a message, as of an end, arrived before that."""
        writing = asyncio.ensure_future(self._session.press_log.pressed(press.logged("hold")))
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
            self._session.press_log.count_unlogged(self._press.origin)
            return receipt
        fault = await self._session.press_log.refused(self._press.logged("hold"), receipt.reason)
        return with_log_fault(receipt, fault)

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
                    message = await self._read()
                if self._process(message, holding):
                    self._session.control.touch(self._press.principal)
                    await self._say(state="held", **_deflection_texts(holding))
                elif isinstance(message, Beat) and self._receipt is not None:
                    await self._say(state="ended", **self._receipt.as_json())
        await self._close(1000)

    def _process(self, message: Message | None, holding: ActiveHold) -> bool:
        """Applies a message to the hold; False once it has ended."""
        holds = self._session.holds
        if isinstance(message, End) and message.lease in ("", holding.lease.id):
            holds.end(holding, END_REASONS.get(message.why, "hold_by_invalid_message"))
            return False
        if not isinstance(message, Beat) or message.lease != holding.lease.id:
            holds.end(holding, "hold_by_invalid_message")
            return False
        return holds.beat(holding, message.number, self._sent(message), message.deflection)

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

    def _sent(self, message: HoldMessage) -> float:
        return sent_at(self._opened_at, message.stamp, message.after, time.monotonic())

    async def _send_end(self) -> None:
        """Waits for the end of the hold, whatever ends it, and sends its receipt."""
        receipt = await asyncio.shield(self._ended)
        if receipt.outcome != "unknown" and not await self._session.peer.flushed():
            receipt = self._session.holds.unconfirmed(receipt)
        self._receipt = receipt = await self._closed(receipt)
        with suppress(WebSocketDisconnect, RuntimeError):
            await self._say(state="ended", **receipt.as_json())

    async def _say(self, **fields: Any) -> None:
        stamp = round(1000 * (time.monotonic() - self._opened_at), 1)
        message = localized({"stamp": stamp, **fields}, self._language)
        await self._socket.send_text(json.dumps(message, ensure_ascii=False))

    async def _close(self, code: int) -> None:
        with suppress(WebSocketDisconnect, RuntimeError):  # the browser was faster
            await self._socket.close(code)


def _deflection_texts(holding: ActiveHold) -> dict[str, Any]:
    """`moves`: the values published for a joystick's deflection, as texts; empty for other widgets."""
    moves = holding.widget.texts_at(*holding.moved)
    return {"moves": moves} if moves else {}
