"""The robots of one panel. Each has its own session, with its own link, state and presses.

Sessions are isolated: a lost peer, a renewed session or a flood affects only one robot. Each page
shows the link status of the other robots.
"""

import asyncio
import time
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from app.alarms.rows import AlarmRow
from app.audit.press_record import Log
from app.commands.diagnostic_acts import Doctor, NoDoctor
from app.commands.receipts import Receipt
from app.errors import NotFound
from app.i18n import TextLike, joined, say
from app.panel.model import Panel, RobotEntry
from app.panel.robot_entry import SUMS
from app.panel.robot_panels import widget_robots
from app.permission.confirmations import ConfirmLocks
from app.robot.slices import Slices
from app.robot.state import RobotState
from app.runtime.alarms import Alarms
from app.runtime.recipes import Recipes
from app.runtime.robot_access import ROBOT_ACCESS
from app.runtime.robot_interlocks import connect_robots
from app.runtime.robot_session import RobotSession
from app.runtime.wiring import ServerParts, wire_session
from app.transport.zenoh_config import Config
from app.view.kinds import Attributes
from app.view.link_status import Lamp
from app.view.overview import Figure, figure_now, most_urgent, sums, tile
from app.view.publisher import ViewPublisher
from app.view.shared_widgets import NO_SHARED, SharedWidgets

if TYPE_CHECKING:
    from app.recording import Recordings

ConfigOf = Callable[[RobotEntry | None], Config]


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
    ) -> None:
        """One robot without a name, or the panel's `[[robot]]` entries."""
        self.panel = panel
        self._widget_robots = widget_robots(panel)
        self._has_overview = any(page.overview for page in panel.pages)
        self._has_total = any(page.total for page in panel.pages)
        self._alarm_rows: Mapping[str, AlarmRow] = {}
        self._most_urgent: Mapping[str, AlarmRow] = {}
        self.root_path = root_path
        self._sessions: dict[str | None, RobotSession] = {}
        self.alarms = Alarms(panel)
        self.recipes = Recipes(panel)
        self.confirm_locks = ConfirmLocks()  # locked until the users are known
        self.states: Path | None = None  # the file of the machine's states
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
        )
        for entry in panel.robots or (None,):
            access = ROBOT_ACCESS[(entry or panel).dialect]
            self._sessions[entry.id if entry else None] = wire_session(
                server, config_of(entry), access, entry=entry, others=self
            )
        connect_robots(self._sessions)
        for session in self.sessions if self._widget_robots or self._has_overview else ():
            session.refresher.show_shared()

    async def start(self) -> None:
        """Starts all sessions. Does not wait for the robots."""
        for session in self.sessions:
            await session.start()

    async def stop(self) -> None:
        """Ends all streams and sessions."""
        self.close()
        await asyncio.gather(*(session.stop() for session in self.sessions))

    def close(self) -> None:
        """Ends holds and streams, which would delay the shutdown."""
        for session in self.sessions:
            session.close()

    def cancel_all(self) -> None:
        """Ends all waiting presses; their outcome is unknown."""
        for session in self.sessions:
            session.presses.cancel_all()

    @property
    def sessions(self) -> list[RobotSession]:
        return list(self._sessions.values())

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
        return next((receipt for receipt in receipts if receipt), None)

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

    def share(self, robot: RobotState) -> None:
        if not (self._has_overview or robot.id in self._widget_robots.values()):
            return
        for session in self.sessions:
            if session.robot is not robot:
                session.refresher.show_shared()

    def _tiles(self) -> Mapping[str, Attributes]:
        """The attributes of the tile of each robot and of the line of sums, by their ids."""
        figures: list[Figure] = []
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
            tiles[entry.tile_id] = tile(view, session.refresher.lamp, figure, alarm)
        words = [state.text for state in self.panel.state.states] if self.panel.state else []
        readout = next((entry.figure for entry in self.panel.robots if entry.figure), None)
        return tiles | {SUMS: sums(tiles.values(), words, figures, readout)}

    def show_but(self, robot: RobotState) -> None:
        for session in self.sessions:
            if session.robot is not robot:
                session.show()
