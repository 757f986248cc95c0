"""The panel server's own log on a robot's /rosout, so that ROS tools show it."""

import asyncio
import logging
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, Final, Protocol

from app.cell.robot.state import RobotState
from app.ros.messages import Interfaces
from app.ros.messages.names import ROSOUT_TOPIC
from app.system.errors import LinkError
from app.system.log import RosoutHandler

LOG_TYPE: Final = "rcl_interfaces/msg/Log"
OWN: Final = logging.getLogger("kiosk")


class Putter(Protocol):
    """The part of the Zenoh session that publishing needs."""

    def put(self, key: str, payload: bytes) -> None: ...


class Rosout:
    """Publishes each log record of the panel server between `start` and `stop`; not those of its
    libraries, such as uvicorn's of connections."""

    def __init__(
        self,
        robot: RobotState,
        interfaces: Interfaces,
        link: Putter,
        loop: asyncio.AbstractEventLoop,
        own: Callable[[bytes], None] = lambda _: None,
    ) -> None:
        """`own` is called with each line too."""
        self._robot = robot
        self._interfaces = interfaces
        self._link = link
        self._loop = loop
        self._own = own
        self._handler = RosoutHandler(self._publish, robot.name)
        self._stopped = False

    def start(self) -> None:
        OWN.addHandler(self._handler)

    def stop(self) -> None:
        self._stopped = True
        OWN.removeHandler(self._handler)

    def _publish(self, fields: Mapping[str, Any]) -> None:
        """Called on the thread that wrote the record."""
        if self._robot.link_up and not self._stopped:
            payload = self._interfaces.encode(LOG_TYPE, fields)
            self._loop.call_soon_threadsafe(self._put, payload)

    def _put(self, payload: bytes) -> None:
        with suppress(LinkError):  # a record that can't be sent must not cause another one
            if not self._stopped:
                self._own(payload)
                self._link.put(self._robot.key(ROSOUT_TOPIC), payload)
