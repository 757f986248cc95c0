"""The simulated time of one robot: `/clock`, while a node publishes it."""

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from app.cell.link.peer import RobotContext
from app.cell.robot.clocks import CLOCK, CLOCK_TYPE, SimulatedTime
from app.ros.zenoh.sample import Buffer
from app.system.errors import LinkError

LOOK_EVERY_S: Final = 0.25  # at whether the time goes on, or went back


class ClockListener:
    """Subscribes to `/clock` while the robot has a publisher of it. Used on the event loop only.

    A simulation publishes its time up to a thousand times a second: on the link's thread only the
    newest is kept, and nothing wakes the event loop.
    """

    def __init__(self, context: RobotContext, update_tokens: Callable[[], None]) -> None:
        """`update_tokens` is called when the topic is subscribed to or no longer."""
        self._robot = context.robot
        self._link = context.link
        self._key = context.robot.key(CLOCK)
        self._changed = context.signals.changed.emit
        self._update_tokens = update_tokens
        self._timer: asyncio.TimerHandle | None = None
        self._shown: tuple[str, int] = ("", 0)  # the state and the jumps that were acted upon

    def update(self) -> None:
        """Call it after a change of the graph."""
        clock, is_published = self._robot.clock, self._robot.graph.has_endpoint("MP", self._key)
        if is_published == (clock.simulated is not None):
            return
        self._unsubscribe()
        if is_published:
            self._subscribe(clock.begin_simulated())
        else:
            clock.end_simulated()
        self._update_tokens()
        self._changed()

    def stop(self) -> None:
        self._unsubscribe()

    def _subscribe(self, simulated: SimulatedTime) -> None:
        def put(payload: Buffer) -> None:
            """On the link's thread."""
            simulated.put(bytes(payload), time.monotonic())

        expression = self._robot.dialect.topic(self._key, CLOCK_TYPE)
        with suppress(LinkError):  # the next session subscribes
            self._link.subscribe_on_demand(self._key, expression, put)
        self._shown = "unknown", 0
        self._look(simulated)

    def _unsubscribe(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
            with suppress(LinkError):
                self._link.unsubscribe(self._key)

    def _look(self, simulated: SimulatedTime) -> None:
        self._timer = asyncio.get_running_loop().call_later(LOOK_EVERY_S, self._look, simulated)
        shown = simulated.state(time.monotonic()), simulated.jumps
        if shown == self._shown:
            return
        if shown[1] != self._shown[1]:
            self._robot.restart_time()
        self._shown = shown
        self._changed()
