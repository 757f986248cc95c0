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

from app.commands.press_context import PRESS_ID
from app.errors import InputError, KioskError
from app.i18n import TextLike, localized, say
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.client_cookie import caller
from app.web.language import language_of
from app.web.request_body import as_model, json_of, received
from app.web.routes.presses import STATUS, Press, receipt_of_press

log = logging.getLogger("kiosk.presses")

router = APIRouter()

MOST_AT_ONCE: Final = 16  # presses of one socket that have no answer yet
MOST_REFUSED: Final = (
    100  # messages of one socket, one after the other, that are no press or one too many
)
POLICY_VIOLATION: Final = 1008  # RFC 6455
PLACE: Final = "the message"


class SocketPress(Press):
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

    __slots__ = ("_caller", "_language", "_refused", "_socket", "_state", "_under_way")

    def __init__(self, socket: WebSocket, state: AppState) -> None:
        self._socket = socket
        self._state = state
        self._caller = caller(socket)
        self._language = language_of(socket)
        self._under_way: set[asyncio.Task[None]] = set()
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
            await asyncio.gather(*self._under_way)

    async def _begin(self, message: Message) -> None:
        """Starts the press of a message, without waiting for its receipt."""
        given: Any = None
        try:
            text = message.get("text")
            if text is None:
                raise InputError(f"{PLACE} is not text")
            given = json_of(text, PLACE)
            said = as_model(SocketPress, given, PLACE)
        except InputError as error:
            await self._refuse(_id_in(given), error.status, error.text)
            return
        if len(self._under_way) >= MOST_AT_ONCE:
            await self._refuse(said.id, 429, say("press_too_many_pending", most=MOST_AT_ONCE))
            return
        task = asyncio.create_task(self._press(said))
        self._under_way.add(task)
        task.add_done_callback(self._under_way.discard)

    async def _press(self, said: SocketPress) -> None:
        state, socket = self._state, self._socket
        try:
            session = state.fleet.session(socket.path_params.get("robot"))
            who = self._caller.principal(state)
            receipt = await receipt_of_press(state, session, who, said.widget, said)
        except KioskError as error:
            await self._answer(said.id, error.status, error=error.text)
        except Exception:
            log.exception("press %s broke off", said.id)
            await self._answer(said.id, 500, error=say("press_server_error"))
        else:
            self._refused = self._refused + 1 if receipt.cause == "limit" else 0
            await self._answer(said.id, STATUS[receipt.cause], **receipt.as_json())

    async def _refuse(self, press_id: str | None, status: int, error: TextLike) -> None:
        self._refused += 1
        await self._answer(press_id, status, error=error)
        await asyncio.sleep(0)  # much may come in one piece: others have their turn

    async def _answer(self, press_id: str | None, status: int, **what: TextLike | None) -> None:
        said = localized({"press": press_id, "status": status, **what}, self._language)
        text = json.dumps(said, ensure_ascii=False)
        with suppress(WebSocketDisconnect, RuntimeError):  # the client is gone
            await self._socket.send_text(text)


def _id_in(given: object) -> str | None:
    """The id of what is no press otherwise, if it has one."""
    found = given.get("id") if isinstance(given, dict) else None
    return found if isinstance(found, str) and re.fullmatch(PRESS_ID, found) else None
