"""Replaces a lost Zenoh session, with retries."""

import asyncio
import logging
from typing import Final

from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.transport.zenoh_session import ZenohSession

log = logging.getLogger("kiosk")

RENEW_AGAIN_S: Final = 1.0


class Renewal:
    """Renews one robot's Zenoh session. Used on the event loop only."""

    def __init__(self, link: ZenohSession, robot: RobotState) -> None:
        self._link = link
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._renewing: asyncio.Task[None] | None = None
        self._lost = False
        self._stopped = False

    def begin(self) -> None:
        """Opens a new session in a thread; another one afterwards if one is being opened already."""
        self._lost = True
        if self._renewing is None:
            self._renewing = asyncio.get_running_loop().create_task(self._renew())

    async def stop(self) -> None:
        """Waits for a session that is being opened."""
        self._stopped = True
        if self._renewing is not None:
            await asyncio.gather(self._renewing, return_exceptions=True)

    async def _renew(self) -> None:
        """Retries until a session is open that was not lost in the meantime."""
        while self._lost and not self._stopped:
            self._lost = False
            try:
                await asyncio.to_thread(self._link.renew)
            except Exception as error:  # any error of Zenoh: without a session everything stays locked
                self._log.error("%s", error)
                self._lost = True
                await asyncio.sleep(RENEW_AGAIN_S)
        self._robot.graph.own_zid = self._link.zid
        self._renewing = None
