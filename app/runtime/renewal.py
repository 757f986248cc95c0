"""A new Zenoh session in place of one that was lost, tried until there is one."""

import asyncio
import logging
from typing import Final

from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.transport.zenoh_session import ZenohSession

log = logging.getLogger("kiosk")

RENEW_AGAIN_S: Final = 1.0


class Renewal:
    """Of one robot's session; on the event loop only."""

    def __init__(self, link: ZenohSession, robot: RobotState) -> None:
        self._link = link
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._renewing: asyncio.Task[None] | None = None
        self._lost = False
        self._stopped = False

    def begin(self) -> None:
        """Opens a new session, in a thread; once more where one is being opened already."""
        self._lost = True
        if self._renewing is None:
            self._renewing = asyncio.get_running_loop().create_task(self._renew())

    async def stop(self) -> None:
        """Waits for the session that is being opened."""
        self._stopped = True
        if self._renewing is not None:
            await asyncio.gather(self._renewing, return_exceptions=True)

    async def _renew(self) -> None:
        """Until there is a session that was not lost while it was opened."""
        while self._lost and not self._stopped:
            self._lost = False
            try:
                await asyncio.to_thread(self._link.renew)
            except Exception as error:  # whatever Zenoh makes of it: without a session all is locked
                self._log.error("%s", error)
                self._lost = True
                await asyncio.sleep(RENEW_AGAIN_S)
        self._robot.graph.own_zid = self._link.zid
        self._renewing = None
