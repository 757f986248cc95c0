"""Records in which state the machine is (`[state]`), and what its counters show (`[oee]`), for the
shift report and the figures of a shift; and tells when it runs again after a stop."""

import asyncio
import json
import logging
import math
import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from app.cell.alarms.report import (
    NOT_RECORDED,
    CountRow,
    StateRow,
    close_states,
    shift_at,
    write_states,
)
from app.cell.session.session import RobotSession
from app.cell.view.displays import field_state
from app.panel.rules import STATE_ID, OeeCounter
from app.panel.values import same_value
from app.system.concurrency import keep_running
from app.system.errors import LogError, TooMany
from app.system.texts import Text

log = logging.getLogger("kiosk.alarms")

LOOK_EVERY_S: Final = 0.5  # a state that is shorter is left out
ALIVE_EVERY_S: Final = 30.0
COUNT_EVERY_S: Final = 60.0
ASK_BEFORE_END_S: Final = 900.0  # of a shift that its open reasons are asked
MAX_WAITING: Final = 1_000  # rows that the disk has refused; the oldest go


# Called with the robot's id and from when to when it stood still, as it runs again.
OnRestart = Callable[[str, float, float], None]
# Called with the time, some time before the end of each shift.
OnShiftEnd = Callable[[float], Awaitable[None]]


class StateRecorder:
    """Writes each change of the shown state of each robot, from `start` to `stop`. Used on the event
    loop only."""

    def __init__(
        self,
        path: Path,
        sessions: Sequence[RobotSession],
        on_restart: OnRestart = lambda *_: None,
        on_shift_end: OnShiftEnd | None = None,
    ) -> None:
        self._path = path
        self._on_restart = on_restart
        self._on_shift_end = on_shift_end
        self._asks_at = math.inf
        self._stood_since: dict[str, float] = {}
        self._counted_at: dict[str, float] = {}
        self._counts: list[CountRow] = []
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
        self._asks_at = self._next_end(time.time())
        # What is counted while nothing was recorded does not count.
        self._counts += [
            CountRow(time.time(), robot)
            for robot, session in self._sessions.items()
            if session.panel.oee is not None
        ]
        try:
            await asyncio.to_thread(close_states, self._path)
        except LogError as error:
            log.error("states are not recorded in %s: %s", self._path, error)
        while True:
            self._look(now := time.time())
            if self._waiting or self._counts or abs(now - self._alive_at) >= ALIVE_EVERY_S:
                await self._write(now)
            if self._on_shift_end is not None and now >= self._asks_at:
                await self._ask(self._on_shift_end, now)
            await asyncio.sleep(LOOK_EVERY_S)

    def _next_end(self, now: float) -> float:
        """When the reasons of the shift at this time are asked."""
        starts = next(iter(self._sessions.values())).panel.alarm_rules.shifts
        return shift_at(now, starts).until - ASK_BEFORE_END_S

    async def _ask(self, ask: OnShiftEnd, now: float) -> None:
        self._asks_at = self._next_end(now + ASK_BEFORE_END_S)
        try:
            await ask(now)
        except (LogError, TooMany) as error:
            log.error("the reasons of stops were not asked at the end of the shift: %s", error)

    def _look(self, now: float) -> None:
        for robot, session in self._sessions.items():
            shown = session.publisher.view["widgets"].get(STATE_ID, {})
            text = shown.get("text", "")
            look = {
                "text": text.as_json() if isinstance(text, Text) else text,
                "shape": shown.get("shape", ""),
                "colour": shown.get("colour", "none"),
            }
            if session.panel.oee is not None:
                look["value"] = value = _state_value(session)
                self._observe_stop(robot, session, value, now)
            state = json.dumps(look, ensure_ascii=False)
            has_changed = self._states.get(robot) != state
            if has_changed:
                self._states[robot] = state
                self._waiting.append(StateRow(now, robot, state))
            if has_changed or abs(now - self._counted_at.get(robot, 0.0)) >= COUNT_EVERY_S:
                self._count(robot, session, now)

    def _observe_stop(self, robot: str, session: RobotSession, value: Any, now: float) -> None:
        rules, states = session.panel.oee, session.panel.state
        if value is None or rules is None or states is None:
            return
        if not any(same_value(value, each) for each in rules.running_values(states)):
            self._stood_since.setdefault(robot, now)
        elif (since := self._stood_since.pop(robot, None)) is not None:
            self._on_restart(robot, since, now)

    def _count(self, robot: str, session: RobotSession, now: float) -> None:
        self._counted_at[robot] = now
        rules = session.panel.oee
        counters = rules.counters if rules else ()
        values = {counter.parts: _number(counter, session) for counter in counters}
        if any(value is not None for value in values.values()):
            row = CountRow(now, robot, values.get("good"), values.get("bad"), values.get("all"))
            self._counts.append(row)

    async def _write(self, now: float) -> None:
        """Writes what waits; what the disk refuses is kept for the next time."""
        self._alive_at = now
        rows, counts = self._waiting[-MAX_WAITING:], self._counts[-MAX_WAITING:]
        self._waiting, self._counts = [], []
        try:
            alive = [(robot, now) for robot in self._states]
            await asyncio.to_thread(write_states, self._path, rows, alive, counts)
        except LogError as error:
            self._waiting, self._counts = rows, counts
            if not self._has_failed:
                log.error("states are not recorded in %s: %s", self._path, error)
            self._has_failed = True
        else:
            self._has_failed = False


def _state_value(session: RobotSession) -> Any:
    """The value of the state that is shown; None for one that is not known now."""
    rules, robot = session.panel.state, session.robot
    if rules is None:
        return None
    if robot.alarmed.state is not None:
        return robot.alarmed.state.value
    field = field_state(rules.display, robot, time.monotonic())
    return field.value if field.state == "live" else None


def _number(counter: OeeCounter, session: RobotSession) -> float | None:
    """What a counter shows now; None where that is not known."""
    field = field_state(counter, session.robot, time.monotonic())
    value: Any = field.value if field.state == "live" else None
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number and math.isfinite(value) else None
