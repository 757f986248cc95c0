"""When a robot's state is shown: permissions and the link at once, values as often as the panel says.

Whatever time alone changes (an age, a request for control) is shown when it is due.
"""

import asyncio
import logging
import math
import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Final, Protocol

from app.audit.press_record import Log
from app.i18n import TextLike, joined, say
from app.panel.model import Panel
from app.panel.widgets.families import DisplayWidget
from app.permission.control_authority import ControlAuthority
from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.view.link_status import Lamp, LinkTimes
from app.view.publisher import ViewPublisher
from app.view.view import ViewWithDeadlines, build_view, lock_all, update_displays

log = logging.getLogger("kiosk.view")

AGAIN_S: Final = 1.0  # after which a view that could not be built is built again


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


class Recorded(Protocol):
    """What is needed of the recordings."""

    @property
    def fault(self) -> TextLike:
        """Why they are not kept; "" where they are."""


@dataclass(frozen=True, slots=True)
class ViewSources:
    """What is shown beside the robot's state."""

    control: ControlAuthority
    operators_log: Log
    others: OtherRobots
    recordings: Recorded | None = None
    simulated: bool = False


class ViewRefresher:
    """The view of one robot, and when it is published; on the event loop only. What it shows decides
    nothing: a view that can't be built is logged, and built again."""

    def __init__(self, panel: Panel, robot: RobotState, revision: str, sources: ViewSources) -> None:
        self._panel = panel
        self._robot = robot
        self._sources = sources
        self._log = RobotLog(log, robot.name)
        self._link_times = LinkTimes()
        self._frame_s = 1 / panel.display_hz
        self._displays = [
            (frozenset(robot.key(source.topic) for source in w.sources()), w) for w in panel.displays
        ]
        self._current = self._build()
        self.lamp = self._current.robot
        self.publisher = ViewPublisher(
            self._current.view, revision, self._current.without_control, panel.widgets_by_page
        )
        self._shown_at = 0.0
        self._spoke: set[str] = set()  # keys of topics that said something since
        self._whole = False  # whether more than values is to be shown
        self._timer: asyncio.TimerHandle | None = None
        self._due = math.inf  # monotonic seconds; not every event loop's timers know theirs
        self._failed = False
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
        self._shown_at = time.monotonic()
        try:
            self._refresh()
            self.publisher.post(self._current.view, self._current.without_control)
        except Exception:
            if not self._failed:
                self._log.exception("the view could not be refreshed; it is tried again")
            self._failed = self._whole = True
            self._at(self._shown_at + AGAIN_S)
            locked = lock_all(self._current, say("view_failed"))
            self.publisher.post(locked.view, locked.without_control)
        else:
            self._failed = self._whole = False
            self._spoke = set()
            self._at(self._current.until)

    def _refresh(self) -> None:
        now = self._shown_at
        if self._whole or now >= self._current.rest:
            self._look()
        else:
            self._current = update_displays(self._current, self._stale(now), self._robot, now)

    def _stale(self, now: float) -> list[DisplayWidget]:
        """The displays that a topic or time has changed."""
        untils, spoke = self._current.displays, self._spoke
        return [w for keys, w in self._displays if not keys.isdisjoint(spoke) or untils[w.id] <= now]

    def _look(self) -> None:
        """Builds the whole view."""
        self._current = self._build()
        if self._current.robot != self.lamp:
            self.lamp = self._current.robot
            self._sources.others.show_but(self._robot)
            self._current = self._build()

    def _at(self, when: float) -> None:
        """Shows again at `when` (monotonic seconds), or sooner if that is planned already."""
        if self._timer is not None:
            if self._due <= when:
                return
            self._timer.cancel()
        self._due = when
        loop = asyncio.get_running_loop()
        self._timer = None if when == math.inf else loop.call_at(when, self._frame)

    def _build(self) -> ViewWithDeadlines:
        sources = self._sources
        unlogged = sources.operators_log.fault
        faults = (unlogged, sources.recordings.fault if sources.recordings else "")
        built = build_view(
            self._panel,
            self._robot,
            time.monotonic(),
            robots=sources.others.link_statuses(),
            simulated=sources.simulated,
            fault=joined(faults, "between_lines"),
            lock=sources.operators_log.lock if unlogged else "",
            control=sources.control.view(),
            control_lock=sources.control.lock,
            control_until=sources.control.until,
        )
        built.view["link"] = self._link_times.dated(built.view["link"])
        return built
