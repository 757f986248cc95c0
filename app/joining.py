"""Joining the ROS graph of a bridge: with liveliness tokens, after asking what is there already.

A token makes the bridge create the DDS reader or writer. Those of what the panel publishes are held
as soon as a bridge is there, so that a topic is known before its first message and none is lost.
Who creates a route first fixes its type and QoS for all: so a bridge that has just come gets time to
discover the robot's nodes, a topic whose type differs gets no token, and what the panel listens to
gets one when its publisher is first seen, with that publisher's durability. Held from the start, it
would make a VOLATILE reader, which misses what a TRANSIENT_LOCAL publisher said before they met.
Where the panel gives a durability, the token has it and is held from the start. It stays when the
publisher goes: a route that ends and begins again delivers each sample twice (#700).
"""

import asyncio
import json
import logging
import math
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from app import keys
from app.errors import LinkError
from app.graph import Route
from app.interfaces import Interfaces
from app.keys import Endpoint, Qos, TopicRole
from app.link import Link
from app.logs import RobotLog
from app.panel.model import Panel
from app.robot import Robot

log = logging.getLogger("kiosk.joining")

LOG_TYPE: Final = "rcl_interfaces/msg/Log"
FRESH_S: Final = 1.0  # waited for a bridge that came while the kiosk ran
FOUND_S: Final = 0.05  # waited for a bridge that was there when the kiosk started
FOUND_WITHIN_S: Final = 1.0
SETTLE_S: Final = 0.2  # from the tokens to routes that carry the first message
SETTLE_MOST_S: Final = 2.0  # where a listener is not reached by then, a press tells so
ASK_EVERY_S: Final = 5.0
ASK_AGAIN_S: Final = 0.5
MISSES_ALLOWED: Final = 1
UNHEARD_ALLOWED: Final = 3  # askings that find a topic without its reader


class Joining:
    """Holds the panel's tokens while a bridge is there, and asks the bridges how they are."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        robot: Robot,
        link: Link,
        show: Callable[[], None],
        renew: Callable[[], None],
    ) -> None:
        """`show` is called when what is known has changed; `renew` opens a new session."""
        self._panel = panel
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._link = link
        self._show = show
        self._renew = renew
        self._missed = 0
        self._unheard = 0
        self._started_at = time.monotonic()
        self._joining: asyncio.Task[None] | None = None
        self._asking: asyncio.Task[None] | None = None
        self._changed = asyncio.Event()
        self._wrongly_held: set[str] = set()
        self._told: set[tuple[str, str]] = set()
        self._listened: set[str] = set()  # keys of subscriptions whose token was held
        self._held_as: dict[str, bool] = {}  # key → whether its token is TRANSIENT_LOCAL

    def start(self) -> None:
        self._asking = self._task(self._ask_regularly())

    async def stop(self) -> None:
        """Ends its tasks; the tokens go with the session."""
        tasks = [task for task in (self._joining, self._asking) if task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def answered(self, within_s: float) -> bool:
        """Asks this robot's bridges whether they run; where one does not answer, all that is known
        of them is asked for again soon."""
        answers = await self._link.ask(keys.VERSION, within_s)
        if self._robot.graph.bridges <= {keys.zid_of(key) for key, _ in answers}:
            return True
        self._changed.set()
        return False

    def follow(self, came: bool) -> None:
        """After every change of the graph; `came`: there is a bridge where there was none."""
        if came or not self._robot.graph.bridges:
            self._leave()
        if came:
            self._joining = self._task(self._join())
        if self._joined:
            self._hold()
            self._changed.set()

    @property
    def _joined(self) -> bool:
        return self._robot.settled_at < math.inf

    def _hold(self) -> None:
        try:
            self._link.hold(self._tokens())
        except LinkError as error:
            self._log.warning("%s", error)

    def _leave(self) -> None:
        self._held_as.clear()
        self._listened.clear()
        self._robot.settled_at = math.inf
        if self._joining is not None:
            self._joining.cancel()
            self._joining = None
        try:
            self._link.hold(())
        except LinkError as error:
            self._log.warning("%s", error)

    async def _join(self) -> None:
        found = time.monotonic() - self._started_at < FOUND_WITHIN_S
        await asyncio.sleep(FOUND_S if found else FRESH_S)
        await self._ask_until_answered()
        if not self._robot.graph.bridges:
            return  # those that answered are other robots'
        self._hold()
        await self._settle()
        await self._ask_until_answered()
        self._robot.settled_at = time.monotonic()
        self._log.info("joined the robot's topics")
        self._show()

    async def _settle(self) -> None:
        """Until the routes carry the first message: whom the graph shows as a listener is heard of."""
        graph = self._robot.graph
        listened = [
            key for key in map(self._robot.key, self._panel.publications()) if graph.on_robot("MS", key)
        ]
        end = time.monotonic() + SETTLE_MOST_S
        await asyncio.sleep(SETTLE_S)
        while time.monotonic() < end and not all(map(self._heard, listened)):
            await asyncio.sleep(SETTLE_S)

    def _heard(self, key: str) -> bool:
        try:
            return self._link.heard(key)
        except LinkError:
            return False

    async def _ask_until_answered(self) -> None:
        """What the bridges do not tell is a doubt: nothing is joined on it."""
        while True:
            try:
                await self._ask()
                if self._missed == 0:
                    return
            except LinkError as error:
                self._log.warning("%s", error)
            self._show()
            await asyncio.sleep(ASK_AGAIN_S)

    def _tokens(self) -> list[str]:
        """The tokens of all topics, but for those whose type is another one on the robot."""
        wanted: list[tuple[TopicRole, str, str, Qos]] = [
            *(("MP", t, n, self._qos(t)) for t, n in self._panel.publications().items()),
            *(
                ("MS", topic, name, qos)
                for topic, name in self._panel.subscriptions().items()
                if (qos := self._listening(topic)) is not None
            ),
            ("MP", "/rosout", LOG_TYPE, keys.ROSOUT),
        ]
        tokens = []
        for role, topic, type_name, qos in wanted:
            key = self._robot.key(topic)
            if found := self._robot.graph.wrong_type(role, key, type_name):
                if (topic, found) not in self._told:
                    self._told.add((topic, found))
                    self._log.error("%s is %s on the robot, %s in the panel", topic, found, type_name)
                continue
            type_hash = self._interfaces.type_hash(type_name)
            tokens.append(keys.token(self._link.zid, role, key, type_name, qos, type_hash))
        for action, type_name in self._panel.actions().items():
            key = self._robot.key(action)
            tokens.append(keys.action_client_token(self._link.zid, key, type_name))
        return tokens

    def _qos(self, topic: str) -> Qos:
        return self._panel.qos(topic).on_wire

    def _listening(self, topic: str) -> Qos | None:
        """The QoS of a subscription's token: the panel's, with the publisher's durability where the
        panel gives none; None for no token yet.

        A route that a publisher made with a QoS that is not the panel's ends with that publisher, if
        no token keeps it: so one that is not held yet waits for that.
        """
        key, qos = self._robot.key(topic), self._qos(topic)
        if self._panel.qos(topic).durability is None:
            latched = self._latched(key)
            if latched is None:
                return None
            qos = replace(qos, transient_local=latched)
        if key not in self._listened and self._robot.graph.wrong_qos("MS", key, qos):
            return None
        self._listened.add(key)
        return qos

    def _latched(self, key: str) -> bool | None:
        """The durability that the token of a subscription is to have; None for no token yet.

        If a publisher came with another one, its route is the wrong one for as long as that
        publisher lives: the token goes with it, and the next publisher decides.
        """
        now = self._robot.graph.latched(key)
        if now is None and key in self._wrongly_held:
            self._wrongly_held.discard(key)
            self._held_as.pop(key, None)
        elif now is not None and self._held_as.setdefault(key, now) != now:
            self._wrongly_held.add(key)
        return self._held_as.get(key)

    async def _ask_regularly(self) -> None:
        """Asks as long as it runs: whatever an answer is, the next one is asked for."""
        while True:
            await self._pause(ASK_AGAIN_S if self._missed or self._unheard else ASK_EVERY_S)
            if self._joined:
                try:
                    await self._ask()
                    if not self._robot.graph.bridges:
                        self._leave()
                    elif self._joined:  # still
                        self._hold()
                        self._heal()
                except LinkError as error:
                    self._log.warning("%s", error)
                self._show()

    async def _ask(self) -> None:
        """Asks the bridges how they are, and of their routes and nodes."""
        graph = self._robot.graph
        answers, namespaces = await asyncio.gather(self._link.ask(keys.VERSION), self._namespaces())
        versions = {keys.zid_of(key): told.decode(errors="replace") for key, told in answers}
        graph.configured(namespaces)
        self._missed = 0 if graph.bridges <= versions.keys() else self._missed + 1
        if self._missed == 0 or self._missed > MISSES_ALLOWED:
            graph.answered(versions)
        if self._missed:
            return  # it would answer nothing else either, and each question takes its time
        routes = [r for key, told in await self._ask_json(keys.ROUTES) if (r := _route(key, told))]
        nodes: set[Endpoint] = set()
        for key, told in await self._ask_json(keys.NODES):
            with suppress(KeyError, TypeError):  # an answer that is no node's
                namespace = namespaces.get(keys.zid_of(key), self._robot.namespace)
                nodes.update(keys.endpoints_of(key, told, namespace))
        graph.learn(routes, nodes)

    async def _namespaces(self) -> dict[str, str]:
        """The namespace of each bridge that says it, "" for none."""
        return {
            keys.zid_of(key): told["namespace"].rstrip("/")
            for key, told in await self._ask_json(keys.CONFIG)
            if isinstance(told, dict) and isinstance(told.get("namespace"), str)
        }

    def _heal(self) -> None:
        """A bridge that does not read a topic for this session does so for a new one."""
        listened = (self._robot.key(topic) for topic in self._panel.subscriptions())
        lost = [key for key in listened if self._robot.graph.unheard(key)]
        self._unheard = self._unheard + 1 if lost else 0
        if self._unheard >= UNHEARD_ALLOWED:
            self._unheard = 0
            self._log.error("the bridge does not pass on %s: a new session", ", ".join(lost))
            self._renew()

    async def _pause(self, longest_s: float) -> None:
        """Until it is time to ask, or a moment after the graph has changed."""
        with suppress(TimeoutError):
            async with asyncio.timeout(longest_s):
                await self._changed.wait()
                await asyncio.sleep(ASK_AGAIN_S)
        self._changed.clear()

    async def _ask_json(self, selector: str) -> list[tuple[str, Any]]:
        """(key, answer) of each answer that is JSON; others are passed over."""
        found = []
        for key, told in await self._link.ask(selector):
            with suppress(ValueError):
                found.append((key, json.loads(told)))
        return found

    def _task(self, work: Coroutine[Any, Any, None]) -> asyncio.Task[None]:
        """A task whose failure is logged, not lost."""
        task = asyncio.get_running_loop().create_task(work)
        task.add_done_callback(self._tell)
        return task

    def _tell(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()):
            self._log.error("joining the robot's topics failed", exc_info=error)


def _route(key: str, told: Any) -> Route | None:
    """What a bridge says of a route; None for what is none."""
    place = keys.route_of(key)
    if place is None or not isinstance(told, dict) or not isinstance(told.get("ros2_type"), str):
        return None
    zid, direction, topic_key = place
    whole = direction == "sub" or told.get("dds_reader") != ""
    return Route(zid, direction, topic_key, told["ros2_type"], whole)
