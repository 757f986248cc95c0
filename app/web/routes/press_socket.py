"""Presses by WebSocket: a page opens one at its first touch, and sends all its presses there.

A press has the fields of a post's body, and `widget`. Its `id` is required, since answers come in any
order. `status` is that of the answer to a post, with a receipt or an `error`:

    browser  {"widget": "operation", "inputs": {…}, "id": "5f…", "seen": "<instance>-<n>", "at": …}
    server   {"press": "5f…", "status": 200, "id": "5f…", "outcome": "published", "code": "…", …}
    server   {"press": "5f…", "status": 404, "error": "…"}

A client that closes the socket loses only the answers: presses that were begun are finished and logged.
"""

import asyncio
import json
import logging
import re
from contextlib import suppress
from typing import Annotated, Any, Final

from fastapi import APIRouter, WebSocket, WebSocketDisconnect
from pydantic import Field
from starlette.types import Message

from app.commands.press import PRESS_ID
from app.errors import InputError, KioskError
from app.i18n import TextLike, localized, say
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.client_cookie import caller
from app.web.confirmations import confirmed
from app.web.language import language_of
from app.web.request_body import as_model, json_of, received
from app.web.routes.presses import STATUS, PressBody, receipt_of_press

log = logging.getLogger("kiosk.presses")

router = APIRouter()

MOST_AT_ONCE: Final = 16  # presses of one socket that have no answer yet
MOST_REFUSED: Final = (
    100  # messages of one socket, one after the other, that are no press or one too many
)
POLICY_VIOLATION: Final = 1008  # RFC 6455
PLACE: Final = "the message"


class SocketPress(PressBody):
    """The message of one press."""

    widget: str
    id: Annotated[str, Field(pattern=PRESS_ID)]


@router.websocket("/presses")
async def presses(socket: WebSocket, state: CurrentState, session: CurrentSession) -> None:
    """`session` is a dependency only to refuse the socket if there is no such robot."""
    await socket.accept()
    await _PressSocket(socket, state).run()


class _PressSocket:
    """One socket and its presses. Each press names the view that its page shows."""

    __slots__ = ("_caller", "_in_flight", "_language", "_refused", "_socket", "_state")

    def __init__(self, socket: WebSocket, state: AppState) -> None:
        self._socket = socket
        self._state = state
        self._caller = caller(socket)
        self._language = language_of(socket)
        self._in_flight: set[asyncio.Task[None]] = set()
        self._refused = 0  # one after the other

    async def run(self) -> None:
        """Reads presses until the socket is closed, then waits until all have ended."""
        try:
            while (message := await received(self._socket))["type"] == "websocket.receive":
                await self._begin(message)
                if self._refused >= MOST_REFUSED:
                    await self._socket.close(POLICY_VIOLATION)
                    break
        finally:
            await asyncio.gather(*self._in_flight)

    async def _begin(self, message: Message) -> None:
        """Starts the press of a message, without waiting for its receipt."""
        fields: Any = None
        try:
            text = message.get("text")
            if text is None:
                raise InputError(f"{PLACE} is not text")
            fields = json_of(text, PLACE)
            body = as_model(SocketPress, fields, PLACE)
        except InputError as error:
            await self._refuse(_press_id(fields), error.status, error.text)
            return
        if len(self._in_flight) >= MOST_AT_ONCE:
            await self._refuse(body.id, 429, say("press_too_many_pending", most=MOST_AT_ONCE))
            return
        task = asyncio.create_task(self._press(body))
        self._in_flight.add(task)
        task.add_done_callback(self._in_flight.discard)

    async def _press(self, body: SocketPress) -> None:
        state, socket = self._state, self._socket
        try:
            shown = state.fleet.session(socket.path_params.get("robot"))
            session = state.fleet.session_for(shown, body.widget)
            who = self._caller.principal(state)
            press = body.press(session.presses.widget(body.widget), who)
            press = confirmed(state, self._caller, press, body.confirmation)
            receipt = await receipt_of_press(state, session, press)
        except KioskError as error:
            await self._answer(body.id, error.status, error=error.text)
        except Exception:
            log.exception("press %s broke off", body.id)
            await self._answer(body.id, 500, error=say("press_server_error"))
        else:
            self._refused = self._refused + 1 if receipt.cause == "limit" else 0
            await self._answer(body.id, STATUS[receipt.cause], **receipt.as_json())

    async def _refuse(self, press_id: str | None, status: int, error: TextLike) -> None:
        self._refused += 1
        await self._answer(press_id, status, error=error)
        await asyncio.sleep(0)  # much may come in one piece: others have their turn

    async def _answer(self, press_id: str | None, status: int, **fields: TextLike | None) -> None:
        answer = localized({"press": press_id, "status": status, **fields}, self._language)
        text = json.dumps(answer, ensure_ascii=False)
        with suppress(WebSocketDisconnect, RuntimeError):  # the client is gone
            await self._socket.send_text(text)


def _press_id(fields: object) -> str | None:
    """The press id in an invalid message, None without one."""
    press_id = fields.get("id") if isinstance(fields, dict) else None
    return press_id if isinstance(press_id, str) and re.fullmatch(PRESS_ID, press_id) else None
