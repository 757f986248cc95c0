"""Joining the ROS graph of a bridge: with liveliness tokens, after asking what is there already.

A token makes the bridge create the DDS reader or writer, so that a topic is known before its first
message and no first message is lost. Who creates a route first fixes its type and QoS for all: so
a bridge that has just come gets time to discover the robot's nodes, and a topic whose type differs
gets no token.
"""

import asyncio
import json
import logging
import math
import time
from collections.abc import Callable, Coroutine
from typing import Any, Final

from app import keys
from app.errors import LinkError
from app.interfaces import Interfaces
from app.keys import Direction, Qos, Role
from app.link import Link
from app.panel.model import Panel
from app.robot import Robot

log = logging.getLogger("kiosk.joining")

LOG_TYPE: Final = "rcl_interfaces/msg/Log"
FRESH_S: Final = 1.0  # waited for a bridge that came while the kiosk ran
FOUND_S: Final = 0.05  # waited for a bridge that was there when the kiosk started
FOUND_WITHIN_S: Final = 1.0
SETTLE_S: Final = 0.2  # from the tokens to routes that carry the first message
ASK_EVERY_S: Final = 5.0
ASK_AGAIN_S: Final = 0.5
MISSES_ALLOWED: Final = 1


class Joining:
    """Holds the panel's tokens while a bridge is there, and asks the bridges how they are."""

    def __init__(
        self, panel: Panel, interfaces: Interfaces, robot: Robot, link: Link, show: Callable[[], None]
    ) -> None:
        self._panel = panel
        self._interfaces = interfaces
        self._robot = robot
        self._link = link
        self._show = show
        self._started_at = time.monotonic()
        self._joining: asyncio.Task[None] | None = None
        self._asking: asyncio.Task[None] | None = None

    def start(self) -> None:
        self._asking = self._task(self._ask_regularly())

    async def stop(self) -> None:
        """Ends its tasks; the tokens go with the session."""
        tasks = [task for task in (self._joining, self._asking) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def follow(self, came: bool) -> None:
        """After every change of the graph; `came`: there is a bridge where there was none."""
        if came or not self._robot.graph.bridges:
            self._leave()
        if came:
            self._joining = self._task(self._join())

    def _leave(self) -> None:
        self._robot.settled_at = math.inf
        if self._joining is not None:
            self._joining.cancel()
            self._joining = None
        try:
            self._link.hold(())
        except LinkError as error:
            log.warning("%s", error)

    async def _join(self) -> None:
        found = time.monotonic() - self._started_at < FOUND_WITHIN_S
        await asyncio.sleep(FOUND_S if found else FRESH_S)
        if versions := await self._ask_versions():
            self._robot.graph.answered(versions)
        await self._ask_routes()
        if not found:
            self._link.resubscribe()
        self._link.hold(self._tokens())
        await asyncio.sleep(SETTLE_S)
        self._robot.settled_at = time.monotonic()
        log.info("joined the robot's topics")
        self._show()

    def _tokens(self) -> list[str]:
        """The tokens of all topics, but for those whose type is another one on the robot."""
        wanted: list[tuple[Role, str, str, Qos]] = [
            *(("MP", t, n, Qos()) for t, n in self._panel.publications().items()),
            *(("MS", t, n, Qos()) for t, n in self._panel.subscriptions().items()),
            ("MP", "/rosout", LOG_TYPE, keys.ROSOUT),
        ]
        tokens = []
        for role, topic, type_name, qos in wanted:
            key = self._robot.key(topic)
            if found := self._robot.graph.wrong_type(role, key, type_name):
                log.error("%s is %s on the robot, %s in the panel", topic, found, type_name)
                continue
            type_hash = self._interfaces.type_hash(type_name)
            tokens.append(keys.token(self._link.zid, role, key, type_name, qos, type_hash))
        return tokens

    async def _ask_regularly(self) -> None:
        missed = 0
        while True:
            await asyncio.sleep(ASK_AGAIN_S if missed else ASK_EVERY_S)
            if not self._robot.graph.bridges:
                missed = 0
                continue
            versions = await self._ask_versions()
            missed = 0 if versions.keys() & self._robot.graph.bridges else missed + 1
            if missed in range(1, MISSES_ALLOWED + 1):
                continue
            self._robot.graph.answered(versions)
            await self._ask_routes()
            if self._robot.settled_at < math.inf:
                self._link.hold(self._tokens())
            self._show()

    async def _ask_versions(self) -> dict[str, str]:
        answers = await self._link.ask(keys.VERSION)
        return {keys.zid_of(key): payload.decode(errors="replace") for key, payload in answers}

    async def _ask_routes(self) -> None:
        routes: dict[tuple[str, Direction, str], str] = {}
        for key, payload in await self._link.ask(keys.ROUTES):
            if route := keys.route_of(key):
                try:
                    routes[route] = json.loads(payload)["ros2_type"]
                except (ValueError, KeyError, TypeError):
                    log.warning("%s: the bridge tells of it in a way this kiosk does not know", key)
        self._robot.graph.learn(routes)

    def _task(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """A task whose failure is logged, not lost."""
        task = asyncio.get_running_loop().create_task(work)
        task.add_done_callback(_told)
        return task


def _told(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and (error := task.exception()):
        log.error("joining the robot's topics failed", exc_info=error)
