"""When a robot's state is shown: permissions and the link at once, values as often as the panel says.

Whatever time alone changes (an age, a request for control) is shown when it is due.
"""

import asyncio
import math
import time
from collections.abc import Callable, Collection, Mapping
from typing import Protocol

from app.audit.press_record import Log
from app.i18n import TextLike, joined
from app.panel.model import Panel
from app.panel.widgets.families import Display
from app.permission.control_authority import ControlAuthority
from app.robot.state import RobotState
from app.view.link_status import Lamp, Since
from app.view.publisher import ViewPublisher
from app.view.view import ViewWithDeadlines, build_view, update_displays


class OtherRobots(Protocol):
    """What is needed of all robots of a panel, where there are several."""

    def link_statuses(self) -> Mapping[str, Lamp]:
        """The lamp of each, by its id."""

    def boots(self) -> Collection[str]:
        """The boots of their boards."""

    def show_but(self, robot: RobotState) -> None:
        """One robot's lamp has changed: the others' pages show it."""


class NoOtherRobots:
    """A robot without others."""

    def link_statuses(self) -> Mapping[str, Lamp]:
        return {}

    def boots(self) -> Collection[str]:
        return ()

    def show_but(self, robot: RobotState) -> None: ...


class ViewRefresher:
    """The board of one robot, and what is posted there; on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        revision: str,
        control: ControlAuthority,
        operators_log: Log,
        others: OtherRobots,
        *,
        before: Callable[[], None],
        recordings_fault: Callable[[], TextLike],
        simulated: bool,
    ) -> None:
        """`before` is called first, whenever it is shown."""
        self._panel = panel
        self._robot = robot
        self._control = control
        self._operators_log = operators_log
        self._others = others
        self._before = before
        self._recordings_fault = recordings_fault
        self._simulated = simulated
        self._since = Since()
        self._frame_s = 1 / panel.display_hz
        self._displays = [(robot.key(w.topic), w) for w in panel.displays]
        self._seen = self._sight()
        self.lamp = self._seen.robot
        self.publisher = ViewPublisher(self._seen.view, revision, self._seen.without_control)
        self._shown_at = 0.0
        self._spoke: set[str] = set()  # keys of topics that said something since
        self._whole = False  # whether more than values is to be shown
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
        self._whole = True
        self._frame()

    def soon(self) -> None:
        """The same when the next frame is due."""
        self._whole = True
        self._at(self.due)

    def values(self, keys: Collection[str]) -> None:
        """Shows what these topics (their keys) said, when the next frame is due."""
        self._spoke.update(keys)
        self._at(self.due)

    @property
    def due(self) -> float:
        """When (monotonic seconds) the next frame may be shown."""
        return self._shown_at + self._frame_s

    def _frame(self) -> None:
        if self._stopped:
            return
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        now = self._shown_at = time.monotonic()
        whole = self._whole
        self._before()
        if whole or self._whole or now >= self._seen.rest:
            self._look()
        else:
            self._seen = update_displays(self._seen, self._stale(now), self._robot, now)
        self._whole, self._spoke = False, set()
        self.publisher.post(self._seen.view, self._seen.without_control)
        self._at(self._seen.until)

    def _stale(self, now: float) -> list[Display]:
        """The displays that a topic or time has changed."""
        untils, spoke = self._seen.displays, self._spoke
        return [w for key, w in self._displays if key in spoke or untils[w.id] <= now]

    def _look(self) -> None:
        """Looks at everything anew."""
        self._seen = self._sight()
        if self._seen.robot != self.lamp:
            self.lamp = self._seen.robot
            self._others.show_but(self._robot)
            self._seen = self._sight()

    def _at(self, when: float) -> None:
        """Shows again at `when` (monotonic seconds), or sooner if that is planned already."""
        if self._timer is not None:
            if self._due <= when:
                return
            self._timer.cancel()
        self._due = when
        loop = asyncio.get_running_loop()
        self._timer = None if when == math.inf else loop.call_at(when, self._frame)

    def _sight(self) -> ViewWithDeadlines:
        unlogged = self._operators_log.fault
        fault = joined((unlogged, self._recordings_fault()), "between_lines")
        seen = build_view(
            self._panel,
            self._robot,
            time.monotonic(),
            robots=self._others.link_statuses(),
            simulated=self._simulated,
            fault=fault,
            lock=self._operators_log.lock if unlogged else "",
            control=self._control.view(),
            control_lock=self._control.lock,
            control_until=self._control.until,
        )
        seen.view["link"] = self._since.dated(seen.view["link"])
        return seen
