"""When a view is published: permissions and the link at once, values at the panel's `display_hz`.

What time alone changes (an age, a request for control) is published when it is due.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Final, Protocol

from app.cell.alarms.shown import NO_ALARMS, AlarmsView
from app.cell.permission.control import ControlAuthority
from app.cell.permission.roles import UNKNOWN_USERS, ConfirmLocks
from app.cell.permission.verdict import Verdict
from app.cell.robot.state import RobotState
from app.cell.view.link_status import Lamp, LinkTimes
from app.cell.view.publisher import ViewPublisher
from app.cell.view.view import (
    NO_SHARED,
    SharedWidgets,
    View,
    ViewContext,
    ViewWithDeadlines,
    build_view,
    lock_all,
    update_commands,
    update_displays,
)
from app.panel.model import Panel
from app.panel.needs import NO_NEEDS, PanelNeeds
from app.panel.rules import STATE_ID
from app.panel.widgets.families import Command, DisplayWidget
from app.panel.widgets.place import MapInput
from app.records.press_record import Log
from app.system.log import RobotLog
from app.system.texts import TextLike, joined, say

log = logging.getLogger("kiosk.view")

NOTHING: Final[frozenset[str]] = frozenset()
AGAIN_S: Final = 1.0  # after which a view that could not be built is built again


class OtherRobots(Protocol):
    """The other robots of the panel, as one robot's view needs them."""

    def link_statuses(self) -> Mapping[str, Lamp]:
        """The lamp of each robot, by the robot's id."""

    def instance_ids(self) -> Collection[str]:
        """The `instance_id` of each robot's publisher."""

    def show_but(self, robot: RobotState) -> None:
        """Refreshes the views of the other robots: the lamp of `robot` has changed."""

    def shared_with(self, robot: RobotState) -> SharedWidgets:
        """The widgets of other robots that are on pages of `robot`."""

    def share(self, robot: RobotState) -> None:
        """Shows the widgets of `robot` on the pages of the others."""

    def watched(self, robot: RobotState, widgets: Collection[str]) -> frozenset[str]:
        """Those of these widgets of `robot` that clients see on pages of other robots."""

    def publisher(self, instance_id: str) -> ViewPublisher | None:
        """The publisher with this `instance_id`, of any robot."""


class NoOtherRobots:
    """A robot without others."""

    def link_statuses(self) -> Mapping[str, Lamp]:
        return {}

    def instance_ids(self) -> Collection[str]:
        return ()

    def show_but(self, robot: RobotState) -> None: ...

    def shared_with(self, robot: RobotState) -> SharedWidgets:
        return NO_SHARED

    def share(self, robot: RobotState) -> None: ...

    def watched(self, robot: RobotState, widgets: Collection[str]) -> frozenset[str]:
        return NOTHING

    def publisher(self, instance_id: str) -> None: ...


def no_alarms() -> AlarmsView:
    return NO_ALARMS


class Recorded(Protocol):
    """The part of the recorder that a view needs."""

    @property
    def fault(self) -> TextLike:
        """Why they are not kept; "" where they are."""


@dataclass(frozen=True, slots=True)
class ViewSources:
    """Where a view takes from what is not the robot's state."""

    control: ControlAuthority
    operators_log: Log
    others: OtherRobots
    recordings: Recorded | None = None
    simulated: bool = False
    alarms: Callable[[], AlarmsView] = no_alarms
    inhibited: Callable[[], Mapping[str, Verdict]] = dict
    recipes: Callable[[], Mapping[str, int]] = dict
    pages: Mapping[str, Collection[str]] | None = None  # of all robots
    needs: PanelNeeds = NO_NEEDS  # of all robots
    confirm_locks: ConfirmLocks = UNKNOWN_USERS
    names: Mapping[str, str] | None = None  # of the widgets that have another id on pages

    def context(self) -> ViewContext:
        """The context of a view that is built now."""
        unlogged = self.operators_log.fault
        faults = (unlogged, self.recordings.fault if self.recordings else "")
        return ViewContext(
            robots=self.others.link_statuses(),
            simulated=self.simulated,
            fault=joined(faults, "between_lines"),
            log_lock=self.operators_log.lock if unlogged else "",
            control=self.control.view(),
            control_lock=self.control.lock,
            control_until=self.control.until,
            alarms=self.alarms(),
            inhibited=self.inhibited(),
            recipes=self.recipes(),
            confirm_locks=self.confirm_locks,
        )


class ViewRefresher:
    """Builds the view of one robot and posts it to its publisher; on the event loop only. A view that
    can't be built is logged and built again: no command depends on it."""

    def __init__(self, panel: Panel, robot: RobotState, revision: str, sources: ViewSources) -> None:
        self._panel = panel
        self._robot = robot
        self._sources = sources
        self._log = RobotLog(log, robot.name)
        self._link_times = LinkTimes()
        self._frame_s = 1 / panel.display_hz
        self._displays = {str(widget.id): widget for widget in panel.displays}
        self._by_key: dict[str, set[str]] = {}  # the ids of the displays of each topic
        for name, widget in self._displays.items():
            for key in _shown_keys(widget, panel, robot):
                self._by_key.setdefault(key, set()).add(name)
        self._of_alarms = {name for name, widget in self._displays.items() if widget.shows_alarms}
        self._watched = frozenset(self._displays)  # those that are kept up to date
        self._outdated: set[str] = set()  # of the others
        self._current = self._build()
        self.lamp = self._current.robot
        pages = panel.widgets_by_page if sources.pages is None else sources.pages
        self._on_pages = frozenset(self._displays.keys() & {*chain.from_iterable(pages.values())})
        self._on_pages -= {STATE_ID}  # is recorded, too
        self.own = self._current  # the newest view without the widgets of other robots
        current = self._current
        self.publisher = ViewPublisher(
            current.view,
            revision,
            current.without_control,
            pages,
            sources.needs,
            sources.names or {},
            [[str(button.id) for button in alike] for alike in panel.uniform_buttons.values()],
        )
        self._shown_at = 0.0
        self._updated_keys: set[str] = set()  # of topics with a sample since the last frame
        self._commands = {str(widget.id): widget for widget in panel.commands}
        self._set: dict[str, Command] = {}  # commands of which the status was set since the last frame
        self._whole = False  # whether the next frame builds the whole view
        self._alarms_changed = False
        self._timer: asyncio.TimerHandle | None = None
        self._due = math.inf  # monotonic seconds; not every event loop's timers know theirs
        self._failed = False
        self._failing: frozenset[str] = frozenset()  # ids of the widgets that can't be shown
        self._stopped = False

    def stop(self) -> None:
        """Publishes no further view."""
        self._stopped = True
        if self._timer is not None:
            self._timer.cancel()

    def refresh_now(self) -> None:
        """Builds the whole view now and posts it to the publisher."""
        self._whole = True
        self._frame()

    def refresh_next_frame(self) -> None:
        """Builds the whole view when the next frame is due."""
        self._whole = True
        self._schedule(self.due)

    def refresh_values(self, keys: Collection[str]) -> None:
        """Updates the displays of the topics with these keys when the next frame is due."""
        self._updated_keys.update(keys)
        names = (self._by_key.get(key, NOTHING) for key in keys)
        if any(not shown.isdisjoint(self._watched) for shown in names):
            self._schedule(self.due)

    def watch(self) -> bool:
        """Keeps up to date only what clients see from now on, and what is on no page. Returns whether
        they see more than before: then call `refresh_seen`."""
        others = self._sources.others.watched(self._robot, self._on_pages)
        shown = self.publisher.watched(self._on_pages) | others
        before = self._watched
        self._watched = shown.union(self._displays.keys() - self._on_pages)
        return not self._watched <= before

    def refresh_seen(self) -> None:
        """Brings what clients see up to date now."""
        self._frame()

    @property
    def unseen_keys(self) -> frozenset[str]:
        """The keys of the topics that only unseen displays show."""
        by_key = self._by_key.items()
        return frozenset(key for key, names in by_key if names.isdisjoint(self._watched))

    def refresh_commands(self, commands: Collection[str]) -> None:
        """Shows the status of these commands now."""
        for name in commands:
            widget = self._commands.get(name)
            if widget is None:
                self._whole = True
            else:
                self._set[name] = widget
        self._frame()

    def refresh_alarms(self) -> None:
        """Shows the alarms now: they do not wait for a frame."""
        self._alarms_changed = True
        self._frame()

    def whole_view(self) -> View:
        """What the pages of the robot show at this moment, also those that no one looks at. Nothing of
        it is published."""
        built = build_view(self._panel, self._robot, time.monotonic(), self._sources.context())
        shared = self._sources.others.shared_with(self._robot).widgets
        view = built.view
        view["link"] = self._link_times.dated(view["link"])
        return {**view, "widgets": {**view["widgets"], **shared}} if shared else view

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
            self._log_failures()
            self._post(self._current)
        except Exception:
            if not self._failed:
                self._log.exception("the view could not be refreshed; it is tried again")
            self._failed = self._whole = True
            self._schedule(self._shown_at + AGAIN_S)
            self._post(lock_all(self._panel, self._current, say("view_failed")))
        else:
            self._failed = self._whole = self._alarms_changed = False
            self._updated_keys, self._set = set(), {}
            self._schedule(self._until)

    @property
    def _until(self) -> float:
        """When time alone changes what clients see."""
        untils = self._current.displays
        if len(self._watched) < len(untils):
            return min((self._current.rest, *(untils[name] for name in self._watched)))
        return self._current.until

    def _post(self, own: ViewWithDeadlines) -> None:
        self.own = own
        self._sources.others.share(self._robot)
        self.show_shared()

    def show_shared(self) -> None:
        """Publishes the newest view with the widgets of other robots as they are now."""
        shared = self._sources.others.shared_with(self._robot)
        self.publisher.post(self.own.view, self.own.without_control, shared)

    def _log_failures(self) -> None:
        """Logs each widget that can't be shown, once until it is shown again."""
        for name, error in self._current.failures.items():
            if name not in self._failing:
                self._log.error('widget "%s" can not be shown', name, exc_info=error)
        self._failing = frozenset(self._current.failures)

    def _refresh(self) -> None:
        now = self._shown_at
        if self._whole or now >= self._current.rest:
            self._rebuild()
        else:
            self._current = update_displays(self._current, self._stale(now), self._robot, now)
            if self._set:
                context = self._sources.context()
                self._current = update_commands(
                    self._current, self._set.values(), self._panel, self._robot, now, context
                )
            self._current.view["alarms"] = self._sources.alarms()

    def _stale(self, now: float) -> list[DisplayWidget]:
        """The watched displays that a sample, an alarm or time has changed."""
        untils = self._current.displays
        stale = set(self._outdated).union(
            *(self._by_key.get(key, NOTHING) for key in self._updated_keys)
        )
        if self._alarms_changed:
            stale |= self._of_alarms
        stale |= {name for name in self._watched if untils[name] <= now}
        self._outdated = stale.difference(self._watched)
        return [self._displays[name] for name in stale - self._outdated]

    def _rebuild(self) -> None:
        """Builds the whole view; twice if the robot's lamp changed, since the view shows it."""
        self._current = self._build()
        if self._current.robot != self.lamp:
            self.lamp = self._current.robot
            self._sources.others.show_but(self._robot)
            self._current = self._build()

    def _schedule(self, when: float) -> None:
        """Plans the next frame at `when` (monotonic seconds), or earlier if one is planned earlier."""
        if self._timer is not None:
            if self._due <= when:
                return
            self._timer.cancel()
        self._due = when
        loop = asyncio.get_running_loop()
        self._timer = None if when == math.inf else loop.call_at(when, self._frame)

    def _build(self) -> ViewWithDeadlines:
        unseen = self._displays.keys() - self._watched
        kept = {name: self._current.attributes(name) for name in unseen}
        self._outdated = set(unseen)
        context = self._sources.context()
        built = build_view(self._panel, self._robot, time.monotonic(), context, kept)
        built.view["link"] = self._link_times.dated(built.view["link"])
        return built


def _shown_keys(widget: DisplayWidget, panel: Panel, robot: RobotState) -> frozenset[str]:
    """The keys of the topics that a display shows, also of the conditions that it names."""
    topics = {source.topic for source in widget.sources()}
    if isinstance(widget, MapInput):
        view = panel.map_views[widget.map]
        sources = view.sources()
        topics |= {source.topic for source in sources if not source.place.startswith("layer")}
        topics |= {layer.topic for layer in view.keep_out} | view.deciding_topics
    topics |= {c.topic for c in panel.named_conditions if c.id in widget.named_conditions}
    return frozenset(key for topic in topics for key in robot.possible_keys(topic))
