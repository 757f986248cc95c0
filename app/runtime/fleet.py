"""The robots of one panel. Each has its own session, with its own link, state and presses.

Sessions are isolated: a lost peer, a renewed session or a flood affects only one robot. Each page
shows the link status of the other robots.
"""

import asyncio
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from app.audit.press_record import Log
from app.commands.diagnostic_acts import Doctor, NoDoctor
from app.errors import NotFound
from app.i18n import TextLike, joined, say
from app.panel.model import Panel, RobotEntry
from app.robot.slices import Slices
from app.robot.state import RobotState
from app.runtime.alarms import Alarms
from app.runtime.recipes import Recipes
from app.runtime.robot_access import ROBOT_ACCESS
from app.runtime.robot_session import RobotSession
from app.runtime.wiring import ServerParts, wire_session
from app.transport.zenoh_config import Config
from app.view.link_status import Lamp

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
        self.root_path = root_path
        self._sessions: dict[str | None, RobotSession] = {}
        self.alarms = Alarms(panel)
        self.recipes = Recipes(panel)
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
        )
        for entry in panel.robots or (None,):
            access = ROBOT_ACCESS[(entry or panel).dialect]
            self._sessions[entry.id if entry else None] = wire_session(
                server, config_of(entry), access, entry=entry, others=self
            )

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

    # The protocol `refresh.OtherRobots`, for each robot's session.

    def link_statuses(self) -> Mapping[str, Lamp]:
        return {entry: k.refresher.lamp for entry, k in self._sessions.items() if entry is not None}

    def instance_ids(self) -> Collection[str]:
        return {session.publisher.instance_id for session in self.sessions}

    def show_but(self, robot: RobotState) -> None:
        for session in self.sessions:
            if session.robot is not robot:
                session.show()
