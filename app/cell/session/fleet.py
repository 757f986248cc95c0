"""The robots of one panel. Each has its own session, with its own link, state and presses.

Sessions are isolated: a lost peer, a renewed session or a flood affects only one robot. Each page
shows the link status of the other robots.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from app.cell.alarms.shown import AlarmRow
from app.cell.commands.diagnostic_acts import Doctor, NoDoctor
from app.cell.commands.receipts import Receipt
from app.cell.link.robot_access import ROBOT_ACCESS
from app.cell.permission.conditions import fresh_since
from app.cell.permission.interlocks import link_verdict, state_of
from app.cell.permission.roles import ConfirmLocks
from app.cell.robot.clocks import Skew
from app.cell.robot.state import RobotState
from app.cell.robot.topics import Slices
from app.cell.session.alarms import Alarms
from app.cell.session.group_stops import GroupStops
from app.cell.session.recipes import Recipes
from app.cell.session.session import RobotSession, ServerParts, wire_session
from app.cell.view.group_stops import StopOfRobot, group_stop
from app.cell.view.kinds import Attributes
from app.cell.view.link_status import Lamp
from app.cell.view.map_robots import RobotOnMap, has_only_moved, other_robots, robot_on_map
from app.cell.view.overview import TileFigure, Tiles, figure_now, most_urgent
from app.cell.view.publisher import ViewPublisher, difference
from app.cell.view.view import NO_SHARED, SharedWidgets, View, ViewWithDeadlines
from app.panel.condition import NamedCondition
from app.panel.frame_keys import stops_of_several
from app.panel.keys import SUMS
from app.panel.model import Panel, RobotEntry
from app.panel.robot_panels import widget_robots
from app.records.press_record import Log
from app.ros.zenoh.config import Config
from app.ros.zenoh.session import ZenohSession
from app.system.errors import InputError, NotFound
from app.system.texts import TextLike, joined, say

if TYPE_CHECKING:
    from app.cell.history.recording import Recordings
    from app.cell.session.forward_process import ForwardProcess
    from app.cell.session.machine_watch import MachineWatch
    from app.cell.session.maps import MapPictures
    from app.cell.session.place_file import SavedPlaceFile
    from app.cell.stops.changes import ChangeJournal

log = logging.getLogger("kiosk.fleet")

MOVES_S: Final = 0.2  # between two positions of other robots on a map


# Interlocks and conditions of one robot that widgets of another robot name.
#
# A widget is judged in the session of its own robot. An interlock of another robot is judged there too,
# by that robot's state: before a press its inbox is emptied, and a change of its verdict runs a turn,
# which ends holds and shows the lock.


def connect_robots(sessions: Mapping[str | None, RobotSession]) -> None:
    """Connects the sessions of a panel's robots; call it before they are started."""
    fleet = {name: session.robot for name, session in sessions.items() if name is not None}
    for session in sessions.values():
        session.robot.fleet = fleet
    for name, session in sessions.items():
        by_others = [
            (other, condition)
            for other in sessions.values()
            for condition in other.panel.of_others
            if condition.robot == name
        ]
        if by_others:
            _Watch(session, by_others).connect()


class _Watch:
    """The verdicts of a robot's conditions that widgets of other robots name."""

    def __init__(
        self, session: RobotSession, by_others: list[tuple[RobotSession, NamedCondition]]
    ) -> None:
        self._session = session
        self._by_others = by_others
        self._known = [self._condition_state(condition) for _, condition in by_others]

    def connect(self) -> None:
        signals = self._session.context.signals
        signals.ran.connect(self.update)
        for other in {id(other): other for other, _ in self._by_others}.values():
            other.context.signals.judging.connect(self._session.turn.run)
            other.context.awaited.append(self._session.link)

    def update(self) -> None:
        """Runs a turn of each robot whose widgets a change concerns."""
        now = [self._condition_state(condition) for _, condition in self._by_others]
        known, self._known = self._known, now
        pairs = zip(self._by_others, known, now, strict=True)
        changed = {id(other): other for (other, _), before, after in pairs if before != after}
        for other in changed.values():
            other.turn.changed()

    def _condition_state(self, condition: NamedCondition) -> object:
        """What others show of a condition, but for its deadline."""
        robot, now = self._session.robot, time.monotonic()
        state = state_of(condition, robot, now, link_verdict(robot, now))
        verdict = state.verdict
        return state.value, verdict.permitted, verdict.code, verdict.reason


ConfigOf = Callable[[RobotEntry | None], Config]


def _place_file(panel: Panel) -> "SavedPlaceFile | None":
    """The file of saved places; None for a panel on which none can be saved."""
    if not any(widget.save for widget in panel.place_inputs):
        return None
    from app.cell.session.place_file import SavedPlaceFile

    return SavedPlaceFile()


def _journal(panel: Panel) -> "ChangeJournal | None":
    """The journal of changes, for a panel that can say that the machine has stopped."""
    if panel.state is None and not panel.alarms:
        return None
    from app.cell.stops.changes import ChangeJournal

    return ChangeJournal()


def _has_received(robot: RobotState, other: RobotState | None) -> bool:
    own, wanted = robot.received(), other.received() if other else {}
    aged = {robot.key(c.topic) for c in robot.conditions.values() if c.max_age_s is not None}
    return all(
        key in own and (key not in aged or own[key] >= fresh_since(robot, key))
        for key in wanted.keys() & robot.topic_keys
    )


class KeptViews(Protocol):
    """Keeps what the pages of each robot show at its stops."""

    async def now(self, session: RobotSession) -> bytes:
        """What the pages of a robot show now, as it is kept; LogError if it is too large."""

    async def stop(self) -> None:
        """Waits for what is being written."""


def _nothing() -> None:
    """For a fleet that is only shown."""


class Fleet:
    """Opened by `start`, closed by `stop`."""

    def __init__(
        self,
        panel: Panel,
        config_of: ConfigOf,
        revision: str,
        operators_log: Log,
        *,
        recordings: "Recordings | None" = None,
        simulated: bool = False,
        root_path: str = "",
        doctor: Doctor | None = None,
        link: type[ZenohSession] = ZenohSession,
    ) -> None:
        """One robot without a name, or the panel's `[[robot]]` entries."""
        self.panel = panel
        self._widget_robots = widget_robots(panel)
        self._has_overview = any(page.overview for page in panel.pages)
        self._group_stops = {entry.id: stops_of_several(panel, entry.id) for entry in panel.robots}
        self._shown_stops: dict[str, Sequence[Attributes]] = {}  # by the robot's id
        self._maps_of_all = frozenset(
            name for name, each in panel.map_views.items() if panel.robots and each.robots == "all"
        )
        self._on_maps: dict[str, Mapping[str, RobotOnMap]] = {}  # as shown, by the robot's id
        self._moves: asyncio.TimerHandle | None = None  # when robots that have moved are shown
        self._has_total = any(page.total for page in panel.pages)
        words = [state.text for state in panel.state.states] if panel.state else []
        readout = next((entry.figure for entry in panel.robots if entry.figure), None)
        self._overview_tiles = Tiles(words, readout)
        self._tiles_now: Mapping[str, Attributes] | None = None  # until a robot changes
        self._sharing = False
        self._alarm_rows: Mapping[str, AlarmRow] = {}
        self._most_urgent: Mapping[str, AlarmRow] = {}
        self.root_path = root_path
        self._sessions: dict[str | None, RobotSession] = {}
        self._shared_views: dict[str | None, ViewWithDeadlines] = {}  # by the robot's id
        self.alarms = Alarms(panel)
        self.recipes = Recipes(panel)
        self.place_file = _place_file(panel)
        self.journal = _journal(panel)
        self.group_stops = GroupStops()
        self.confirm_locks = ConfirmLocks()  # locked until the users are known
        self.states: Path | None = None  # the file of the machine's states
        self.forward: ForwardProcess | None = None  # to the plant's central database
        self.machine: MachineWatch | None = None  # of a server that reaches robots
        self.stop_views: KeptViews | None = None  # of such a server, from some time after its start
        server = ServerParts(
            panel,
            revision,
            operators_log,
            recordings,
            Slices(),
            simulated,
            root_path,
            self.alarms,
            doctor or NoDoctor(),
            self.recipes,
            self.confirm_locks,
            self.place_file,
            self.journal,
            link,
        )
        for entry in panel.robots or (None,):
            access = ROBOT_ACCESS[(entry or panel).dialect]
            self._sessions[entry.id if entry else None] = wire_session(
                server, config_of(entry), access, entry=entry, others=self
            )
        connect_robots(self._sessions)
        for session in self.sessions:
            session.publisher.on_watched = partial(self._watch, session)
        for session in self.sessions:
            session.refresher.show_shared()

    @cached_property
    def map_pictures(self) -> "MapPictures":
        """Those of all robots: one is made at a time."""
        from app.cell.session.maps import MapPictures

        return MapPictures()

    @property
    def recordings_folder(self) -> Path | None:
        """That of a panel that records."""
        if self.panel.record is None or self.states is None:
            return None
        from app.cell.history.recording import FOLDER

        return self.states.with_name(FOLDER)

    async def start(self) -> None:
        """Starts all sessions. Does not wait for the robots."""
        for session in self.sessions:
            await session.start()
            session.watch()

    async def stop(self) -> None:
        """Ends all streams and sessions."""
        self.close()
        await asyncio.gather(*(session.stop() for session in self.sessions))

    def close(self) -> None:
        """Ends holds and streams, which would delay the shutdown."""
        if self._moves is not None:
            self._moves.cancel()
        for session in self.sessions:
            session.close()

    def cancel_all(self) -> None:
        """Ends all waiting presses; their outcome is unknown."""
        for session in self.sessions:
            session.presses.cancel_all()

    @property
    def sessions(self) -> list[RobotSession]:
        return list(self._sessions.values())

    def skews(self) -> Mapping[str, Skew | None]:
        """How far the clock of each robot is from the panel's, by the robot's id."""
        return {s.entry.id if s.entry else "": s.robot.clock.skew for s in self.sessions}

    @property
    def state(self) -> TextLike:
        """The state of the link to each robot, as text."""
        states = [
            (session.robot.name, session.link_verdict.reason or say("ready"))
            for session in self.sessions
        ]
        return joined(say("ready_robot", name=n, state=s) if n else s for n, s in states)

    @property
    def first(self) -> RobotSession:
        return self.sessions[0]

    def session(self, robot: str | None) -> RobotSession:
        """The session of a robot; None for the robot without a name. NotFound lists the robots."""
        if robot in self._sessions:
            return self._sessions[robot]
        if robot is None:
            has = "several robots" if len(self.sessions) > 1 else "a robot with a path of its own"
            raise NotFound(f"this panel has {has}: begin with {self.first.base}/")
        known = ", ".join(str(name) for name in self._sessions if name) or "one robot without a name"
        raise NotFound(f'there is no robot "{robot:.64}" on this panel; there is {known}')

    def of_robot(self, robot_id: str) -> RobotSession:
        """The session of the robot with this id; the first for another id, and for a robot without."""
        return self._sessions.get(robot_id, self.first)

    def chosen(self, robot: str) -> list[RobotSession]:
        """The sessions that a table is about, by `robot` in the query of its page, print, CSV and JSON:
        of the robot with this id, or of all for "". NotFound for another id."""
        if not robot:
            return [*self.sessions]
        return [self.session(robot)]

    def session_for(self, session: RobotSession, widget: str) -> RobotSession:
        """The session of a widget on a page of `session`: that of the widget's own robot if it has
        one."""
        return self._sessions[robot] if (robot := self._widget_robots.get(widget)) else session

    def sharing(self, session: RobotSession) -> list[RobotSession]:
        """The sessions of other robots with widgets on the pages of `session`."""
        names = dict.fromkeys(self._widget_robots.values())
        return [other for name in names if (other := self._sessions[name]) is not session]

    def receipt(self, session: RobotSession, press_id: str) -> Receipt | None:
        """The receipt of a press on a page of `session`; None for unknown ids."""
        receipts = (each.presses.receipt(press_id) for each in (session, *self.sharing(session)))
        own = next((receipt for receipt in receipts if receipt), None)
        return own or self.group_stops.receipt(press_id)

    def stopped(self, widget: str, robots: str) -> list[RobotSession]:
        """The sessions of the robots that a stop button of the frame is pressed for; `robots` are their
        ids, by commas. InputError if the button is not for several robots."""
        keys = {key.widget.id for keys in self._group_stops.values() for key in keys.values()}
        if widget not in keys:
            raise InputError(f'robots: "{widget:.64}" is not a stop button of several robots')
        return [self.session(robot) for robot in dict.fromkeys(robots.split(","))]

    def show_as(self, other: "Fleet | None") -> None:
        """Shows what the sessions of another panel with the same robots have received, for good: this
        fleet is never started."""
        known = {session.robot.id: session for session in other.sessions} if other else {}
        for session in self.sessions:
            session.publisher.on_watched = _nothing
            if (same := known.get(session.robot.id)) is not None:
                session.robot.copy_readings(same.robot)
                session.refresher.lamp = same.refresher.lamp
        for session in self.sessions:
            session.refresher.refresh_now()
            session.refresher.stop()

    def has_joined(self, other: "Fleet") -> bool:
        """Whether commands reach all robots, and what another fleet has received has arrived here too,
        new enough for what is judged by it."""
        known = {session.robot.id: session.robot for session in other.sessions}
        return all(
            session.link_verdict.permitted and _has_received(session.robot, known.get(session.robot.id))
            for session in self.sessions
        )

    # The protocol `refresh.OtherRobots`, for each robot's session.

    def link_statuses(self) -> Mapping[str, Lamp]:
        return {entry: k.refresher.lamp for entry, k in self._sessions.items() if entry is not None}

    def instance_ids(self) -> Collection[str]:
        return {session.publisher.instance_id for session in self.sessions}

    def publisher(self, instance_id: str) -> ViewPublisher | None:
        publishers = (session.publisher for session in self.sessions)
        return next((each for each in publishers if each.instance_id == instance_id), None)

    def shared_with(self, robot: RobotState) -> SharedWidgets:
        others = [name for name in dict.fromkeys(self._widget_robots.values()) if name != robot.id]
        sessions = {name: self._sessions[name] for name in others if name in self._sessions}
        widgets = {**self._tiles()} if self._has_overview else {}
        widgets |= self._stops_of_several(robot)
        widgets |= self._maps_with_others(robot)
        if not (sessions or widgets):
            return NO_SHARED
        without: dict[str, Mapping[str, Attributes]] = {}
        for name, session in sessions.items():
            own = session.refresher.own
            ids = [widget for widget, robot_id in self._widget_robots.items() if robot_id == name]
            widgets |= {widget: own.view["widgets"][widget] for widget in ids}
            locks = own.without_control
            without[name] = {widget: locks[widget] for widget in ids if widget in locks}
        controls = {name: each.refresher.own.view["control"] for name, each in sessions.items()}
        return SharedWidgets(widgets, without, controls)

    def whole_view(self, session: RobotSession) -> View:
        """What the pages of `session` show at this moment, also those that no one looks at."""
        view = session.refresher.whole_view()
        for other in self.sharing(session):
            own = other.refresher.whole_view()["widgets"]
            name = other.robot.id
            ids = [widget for widget, robot in self._widget_robots.items() if robot == name]
            view["widgets"] |= {widget: own[widget] for widget in ids}
        return view

    def share(self, robot: RobotState) -> None:
        has_moved = self._has_moved(robot)
        if not (
            has_moved
            or self._has_overview
            or robot.id in self._widget_robots.values()
            or self._stops_differ(robot)
        ):
            return
        # Sums get old by time alone.
        if not (self._has_total or has_moved or self._differs(robot)):
            return
        self._tiles_now = None
        if not self._sharing:
            self._sharing = True
            asyncio.get_running_loop().call_soon(self._share)

    def _differs(self, robot: RobotState) -> bool:
        """Whether what other robots show of this one has changed since this was asked the last time."""
        session = self._sessions.get(robot.id)
        if session is None:  # not wired yet
            return True
        own = session.refresher.own
        before, self._shared_views[robot.id] = self._shared_views.get(robot.id), own
        return (
            before is None
            or before.robot != own.robot
            or before.without_control != own.without_control
            or bool(difference(before.view, own.view))
        )

    def _share(self) -> None:
        """Once for all robots that have changed: each change is on the pages of each robot."""
        self._sharing = False
        for session in self.sessions:
            try:
                session.refresher.show_shared()
            except Exception:  # its own next frame locks its page, or shows it
                log.exception("a view of several robots was not built")
                session.refresher.refresh_next_frame()

    def watched(self, robot: RobotState, widgets: Collection[str]) -> frozenset[str]:
        own = {widget for widget, name in self._widget_robots.items() if name == robot.id}
        own |= self._maps_of_all
        if not own:
            return frozenset()
        own = own.intersection(widgets)
        others = (session.publisher for session in self.sessions if session.robot is not robot)
        return frozenset().union(*(publisher.watched(own) for publisher in others))

    def _watch(self, session: RobotSession) -> None:
        """Clients see other pages of the session than before."""
        shared = self.sessions if self._maps_of_all else (session, *self.sharing(session))
        for other in shared:
            other.watch()

    def _maps_with_others(self, robot: RobotState) -> Mapping[str, Attributes]:
        """The attributes of the maps of several robots on pages of `robot`, by their ids."""
        name = robot.id or ""
        if not self._maps_of_all or name not in self._sessions:  # else not wired yet
            return {}
        own = self._sessions[name].refresher.own.view["widgets"]
        others = [session for session in self.sessions if session.robot is not robot]
        shown: dict[str, Attributes] = {}
        for map_id in self._maps_of_all:
            rows = [
                (str(each.robot.id), each.robot.title, self._positions(each)[map_id]) for each in others
            ]
            shown[map_id] = {**own[map_id], **other_robots(own[map_id], rows)}
        return shown

    def _positions(self, session: RobotSession) -> Mapping[str, RobotOnMap]:
        """Where a robot is on the maps of several, by their ids, as pages show it."""
        return self._on_maps.get(str(session.robot.id)) or self._positions_now(session)

    def _positions_now(self, session: RobotSession) -> Mapping[str, RobotOnMap]:
        widgets = session.refresher.own.view["widgets"]
        return {map_id: robot_on_map(widgets[map_id]) for map_id in self._maps_of_all}

    def _has_moved(self, robot: RobotState) -> bool:
        """Whether pages are to show now that the robot is elsewhere on maps of several. If it has only
        moved, they show it with the others that have, five times a second."""
        name = robot.id or ""
        if not self._maps_of_all or name not in self._sessions:
            return False
        now, before = self._positions_now(self._sessions[name]), self._on_maps.get(name)
        if now == before:
            return False
        if before and all(has_only_moved(before[map_id], now[map_id]) for map_id in now):
            if self._moves is None:
                loop = asyncio.get_running_loop()
                self._moves = loop.call_later(MOVES_S, self._show_moves)
            return False
        self._on_maps[name] = now
        return True

    def _show_moves(self) -> None:
        self._moves = None
        self._on_maps = {str(each.robot.id): self._positions_now(each) for each in self.sessions}
        self._share()

    def _stops_of_several(self, robot: RobotState) -> Mapping[str, Attributes]:
        """The attributes of the stop buttons of several robots on pages of `robot`, by their ids."""
        return {
            shown_id: group_stop([self._stop_of(name, key.widget.id) for name in key.robots])
            for shown_id, key in self._group_stops.get(robot.id or "", {}).items()
            if all(name in self._sessions for name in key.robots)  # else not wired yet
        }

    def _stop_of(self, robot: str, widget: str) -> StopOfRobot:
        session = self._sessions[robot]
        return StopOfRobot(session.robot.title, session.refresher.own.view["widgets"][widget])

    def _stops_differ(self, robot: RobotState) -> bool:
        """Whether a stop button of the robot has changed since this was asked the last time."""
        name = robot.id or ""
        keys = self._group_stops.get(name, {}).values()
        if not keys or name not in self._sessions:
            return False
        shown = [self._stop_of(name, key.widget.id).attributes for key in keys]
        before, self._shown_stops[name] = self._shown_stops.get(name), shown
        return shown != before

    def _tiles(self) -> Mapping[str, Attributes]:
        """The attributes of the tile of each robot and of the line of sums, by their ids."""
        if self._tiles_now is not None:
            return self._tiles_now
        made = self._overview_tiles
        figures: list[TileFigure] = []
        tiles: dict[str, Attributes] = {}
        for entry in self.panel.robots:
            session = self._sessions.get(entry.id)
            if session is None:  # not wired yet
                continue
            if entry.figure and self._has_total:
                figures.append(figure_now(entry.figure, session.robot, time.monotonic()))
            view = session.refresher.own.view
            if view["alarms"]["rows"] is not self._alarm_rows:
                self._alarm_rows = view["alarms"]["rows"]
                self._most_urgent = most_urgent(self._alarm_rows)
            figure = str(entry.figure.id) if entry.figure else ""
            alarm = self._most_urgent.get(entry.id)
            tiles[entry.tile_id] = made.tile(entry.tile_id, view, session.refresher.lamp, figure, alarm)
        tiles[SUMS] = made.sums(tiles.values(), figures)
        if not self._has_total:  # a figure gets old by time alone
            self._tiles_now = tiles
        return tiles

    def show_but(self, robot: RobotState) -> None:
        for session in self.sessions:
            if session.robot is not robot:
                session.refresher.refresh_next_frame()
