"""The robots of one panel: each has a kiosk of its own, with its own link, state and presses.

They share nothing that can fail: a lost bridge, a renewed session or a flood is one robot's. Each
page shows how the others are.
"""

import asyncio
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING

from app.audit.press_record import Log
from app.errors import NotFound
from app.i18n import say
from app.panel.model import Panel, RobotEntry
from app.robot.slices import Slices
from app.robot.state import Robot
from app.runtime.robot_session import Kiosk
from app.transport.zenoh_session import Config
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
    ) -> None:
        """One robot without a name, or the panel's `[[robot]]` entries."""
        self.panel = panel
        self._kiosks: dict[str | None, Kiosk] = {}
        slices = Slices()
        for entry in panel.robots or (None,):
            self._kiosks[entry.id if entry else None] = Kiosk(
                panel,
                config_of(entry),
                revision,
                operators_log,
                entry=entry,
                others=self,
                recordings=recordings,
                slices=slices,
                simulated=simulated,
            )

    async def start(self) -> None:
        """Opens every link; whether anybody is there shows later."""
        for kiosk in self.kiosks:
            await kiosk.start()

    async def stop(self) -> None:
        """Ends the streams and the sessions of all."""
        self.close()
        await asyncio.gather(*(kiosk.stop() for kiosk in self.kiosks))

    def close(self) -> None:
        """Ends holds and streams: what would keep the process from its end, or go on after it."""
        for kiosk in self.kiosks:
            kiosk.close()

    def give_up(self) -> None:
        """Ends the waiting of what was pressed."""
        for kiosk in self.kiosks:
            kiosk.presses.give_up()

    @property
    def kiosks(self) -> list[Kiosk]:
        return list(self._kiosks.values())

    @property
    def state(self) -> str:
        """How the way to each robot is, in words."""
        states = [(kiosk.robot.name, kiosk.way.reason or say("ready")) for kiosk in self.kiosks]
        return " ".join(say("ready_of", name=n, state=s) if n else s for n, s in states)

    @property
    def first(self) -> Kiosk:
        return self.kiosks[0]

    def kiosk(self, robot: str | None) -> Kiosk:
        """The kiosk of a robot; None is the one without a name. NotFound says which there are."""
        if robot in self._kiosks:
            return self._kiosks[robot]
        if robot is None:
            raise NotFound(f"this panel has several robots: begin with {self.first.base}/")
        known = ", ".join(str(name) for name in self._kiosks if name) or "one robot without a name"
        raise NotFound(f'there is no robot "{robot:.64}" on this panel; there is {known}')

    # What each robot's kiosk needs of the others (`showing.Others`).

    def lamps(self) -> Mapping[str, Lamp]:
        return {entry: k.showing.lamp for entry, k in self._kiosks.items() if entry is not None}

    def boots(self) -> Collection[str]:
        return {kiosk.board.boot for kiosk in self.kiosks}

    def show_but(self, robot: Robot) -> None:
        for kiosk in self.kiosks:
            if kiosk.robot is not robot:
                kiosk.show()
