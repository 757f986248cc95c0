"""When a robot's state is shown: permissions and the link at once, values so many times a second.

Whatever time alone changes (an age, a request for control) is shown when it is due.
"""

import asyncio
import math
import time
from collections.abc import Callable, Collection, Mapping
from typing import Final, Protocol

from app.board import Board
from app.control import Control
from app.lamps import Lamp
from app.logbook import Log
from app.panel.model import Panel
from app.robot import Robot
from app.since import Since
from app.views import Sight, sight

FRAMES_PER_S: Final = 20.0


class Others(Protocol):
    """What is needed of all robots of a panel, where there are several."""

    def lamps(self) -> Mapping[str, Lamp]:
        """The lamp of each, by its id."""

    def boots(self) -> Collection[str]:
        """The boots of their boards."""

    def show_but(self, robot: Robot) -> None:
        """One robot's lamp has changed: the others' pages show it."""


class Alone:
    """A robot without others."""

    def lamps(self) -> Mapping[str, Lamp]:
        return {}

    def boots(self) -> Collection[str]:
        return ()

    def show_but(self, robot: Robot) -> None: ...


class Showing:
    """The board of one robot, and what is posted there; on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: Robot,
        revision: str,
        control: Control,
        operators_log: Log,
        others: Others,
        *,
        before: Callable[[], None],
        recordings_fault: Callable[[], str],
        simulated: bool,
        fault: str,
    ) -> None:
        """`before` is called first, whenever it is shown; `fault` stands above the page until
        there is none."""
        self._panel = panel
        self._robot = robot
        self._control = control
        self._operators_log = operators_log
        self._others = others
        self._before = before
        self._recordings_fault = recordings_fault
        self._simulated = simulated
        self.fault = fault
        self._since = Since()
        first = self._sight()
        self.lamp = first.robot
        self.board = Board(first.view, revision)
        self._shown_at = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._due = math.inf  # monotonic seconds; not every event loop's timers know theirs
        self._stopped = False

    def stop(self) -> None:
        """Shows nothing any more."""
        self._stopped = True
        if self._timer is not None:
            self._timer.cancel()

    def now(self) -> None:
        """Posts the state as of now to the board."""
        if self._stopped:
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._shown_at = time.monotonic()
        self._before()
        seen = self._sight()
        if seen.robot != self.lamp:
            self.lamp = seen.robot
            self._others.show_but(self._robot)
            seen = self._sight()
        self.board.post(seen.view)
        self._at(min(seen.until, self._control.until))

    def soon(self) -> None:
        """Shows again when the next frame is due."""
        self._at(self._shown_at + 1 / FRAMES_PER_S)

    def _at(self, when: float) -> None:
        """Shows again at `when` (monotonic seconds), or sooner if that is planned already."""
        if self._timer is not None:
            if self._due <= when:
                return
            self._timer.cancel()
        self._due = when
        loop = asyncio.get_running_loop()
        self._timer = None if when == math.inf else loop.call_at(when, self.now)

    def _sight(self) -> Sight:
        faults = (self.fault, self._operators_log.fault, self._recordings_fault())
        seen = sight(
            self._panel,
            self._robot,
            time.monotonic(),
            robots=self._others.lamps(),
            simulated=self._simulated,
            fault="\n".join(filter(None, faults)),
            lock=self._operators_log.lock,
            control=self._control.view(),
        )
        return self._since.dated(seen)
