"""Records in which state the machine is (`[state]`), for the shift report."""

import asyncio
import json
import logging
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.cell.alarms.report import NOT_RECORDED, StateRow, close_states, write_states
from app.cell.session.session import RobotSession
from app.panel.rules import STATE_ID
from app.system.concurrency import keep_running
from app.system.errors import LogError
from app.system.texts import Text

log = logging.getLogger("kiosk.alarms")

LOOK_EVERY_S: Final = 0.5  # a state that is shorter is left out
ALIVE_EVERY_S: Final = 30.0
MAX_WAITING: Final = 1_000  # rows that the disk has refused; the oldest go


class StateRecorder:
    """Writes each change of the shown state of each robot, from `start` to `stop`. Used on the event
    loop only."""

    def __init__(self, path: Path, sessions: Sequence[RobotSession]) -> None:
        self._path = path
        self._sessions = {session.entry.id if session.entry else "": session for session in sessions}
        self._states: dict[str, str] = {}
        self._waiting: list[StateRow] = []
        self._alive_at = 0.0
        self._has_failed = False
        self._task: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._task = keep_running(self._run, log, "recording states failed")

    async def stop(self) -> None:
        """Ends the states, as they are not recorded from now on."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
            self._waiting += [StateRow(time.time(), robot, NOT_RECORDED) for robot in self._states]
            await self._write(time.time())

    async def _run(self) -> None:
        self._states.clear()
        try:
            await asyncio.to_thread(close_states, self._path)
        except LogError as error:
            log.error("states are not recorded in %s: %s", self._path, error)
        while True:
            self._look(now := time.time())
            if self._waiting or abs(now - self._alive_at) >= ALIVE_EVERY_S:
                await self._write(now)
            await asyncio.sleep(LOOK_EVERY_S)

    def _look(self, now: float) -> None:
        for robot, session in self._sessions.items():
            shown = session.publisher.view["widgets"].get(STATE_ID, {})
            text = shown.get("text", "")
            state = json.dumps(
                {
                    "text": text.as_json() if isinstance(text, Text) else text,
                    "shape": shown.get("shape", ""),
                    "colour": shown.get("colour", "none"),
                },
                ensure_ascii=False,
            )
            if self._states.get(robot) != state:
                self._states[robot] = state
                self._waiting.append(StateRow(now, robot, state))

    async def _write(self, now: float) -> None:
        """Writes what waits; what the disk refuses is kept for the next time."""
        self._alive_at = now
        rows = self._waiting[-MAX_WAITING:]
        self._waiting = []
        try:
            alive = [(robot, now) for robot in self._states]
            await asyncio.to_thread(write_states, self._path, rows, alive)
        except LogError as error:
            self._waiting = rows
            if not self._has_failed:
                log.error("states are not recorded in %s: %s", self._path, error)
            self._has_failed = True
        else:
            self._has_failed = False
