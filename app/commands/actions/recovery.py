"""Recovery of goals after a restart: goals whose end is not in the operator's log are tracked again.

A goal's id is made of the hash of its press's entry (`goal.goal_id`), so the log is enough to request
its result from the robot. Recovery sends nothing else.
"""

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Final

from app.audit import OpenPress
from app.audit.press_record import PendingEntry, PressLog
from app.clock import format_datetime, format_time
from app.commands.actions.goal import UNKNOWN, Goal, goal_id
from app.commands.actions.goals import GoalTracker
from app.concurrency import spawn_logged
from app.errors import LogError
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.widgets.service_action import Action
from app.robot.command_status import IDLE, CommandStatus
from app.robot.state import RobotState
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.actions")

LOOK_BACK_S: Final = 86_400.0
# Reasons for goals that the robot does not know: these are not tracked again. Logs of older versions
# have no codes, only these sentences.
FINAL: Final = frozenset({"goal_forgotten", "goal_not_known"})
FINAL_SENTENCES: Final = frozenset(
    {
        "The robot no longer knows this goal: what came of it is not known.",
        "The robot does not know this goal: it did not get it, or knows it no longer.",
    }
)
TODAY_S: Final = 43_200.0  # older times are shown with their date
READ_AGAIN_S: Final = 1.0


class GoalRecovery:
    """Recovers the goals of one robot. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        press_log: PressLog,
        actions: GoalTracker,
        changed: Callable[[], None],
        read_again_s: float = READ_AGAIN_S,
    ) -> None:
        """`changed` is called when the status of a command has changed."""
        self._widgets = {w.id: w for w in panel.widgets() if isinstance(w, Action)}
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._press_log = press_log
        self._actions = actions
        self._changed = changed
        self._read_again_s = read_again_s
        self._unreadable_status = IDLE  # shown while the log can't be read
        self._reading: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Returns when the goals are known. If the log can't be read, reading is retried; until then no
        goal is sent, unless the panel file makes the log optional."""
        if self._widgets and not await self._read():
            self._reading = spawn_logged(self._read_later(), self._log, "recovering goals failed")

    async def stop(self) -> None:
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.gather(self._reading, return_exceptions=True)

    async def _read_later(self) -> None:
        read = False
        while not read:
            await asyncio.sleep(self._read_again_s)
            read = await self._read()

    async def _read(self) -> bool:
        since = round((time.time() - LOOK_BACK_S) * 1000)
        try:
            presses = await self._press_log.open_presses(self._widgets, since)
        except LogError as error:
            self._show_unreadable(error.text)
            return False
        self._show(IDLE)
        for open_press, pending in presses:
            if open_press.code not in FINAL and open_press.reason not in FINAL_SENTENCES:
                self._resume(open_press, pending)
        return True

    def _show_unreadable(self, why: TextLike) -> None:
        text = say("goal_recovery_failed", why=why)
        if text != self._unreadable_status.text:
            self._log.warning("%s", text)
        self._show(CommandStatus(busy=not self._press_log.is_bypassed, outcome="unknown", text=text))

    def _show(self, progress: CommandStatus) -> None:
        """Shows a status on widgets that show no other."""
        before, self._unreadable_status = self._unreadable_status, progress
        if before == progress:
            return
        for widget in self._widgets:
            if self._robot.command_status.get(widget, IDLE) in (IDLE, before):
                self._robot.command_status[widget] = progress
        self._changed()

    def _resume(self, open_press: OpenPress, pending: PendingEntry) -> None:
        press, widget = open_press.press, self._widgets[open_press.press.widget]
        if why := self._actions.full(widget.action):
            self._log.warning("press %s: its goal is not tracked again: %s", press.press, why)
            return

        cut = asyncio.get_running_loop().create_future()
        cut.set_result("")  # until its server is offered
        at = press.at / 1000
        pressed = format_time(at) if abs(time.time() - at) < TODAY_S else format_datetime(at)
        doubt = say("goal_from_before_restart", time=pressed)
        own = goal_id(press.hash)
        self._log.info("press %s: tracking goal %s again: %s", press.press, own, doubt)
        self._actions.resume(
            Goal(widget, press.press, own, cut, pending.correct, UNKNOWN, open_press.accepted, doubt)
        )
