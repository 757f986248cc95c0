"""The round trip to a robot's nodes: how long one of them takes to answer, measured while someone looks
at the page of diagnostics.

A node is asked for the values of no parameter, which it answers at once and which changes nothing.
Through a bridge only nodes that surely answer are asked, those on Cyclone DDS and those that the panel
has parameters of: a request without an answer stays in the bridge. One that did not answer is left
alone for `AGAIN_S`, and a new one until it has settled.
"""

import asyncio
import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Final, Literal, NamedTuple

from app.concurrency import end_tasks, spawn_logged
from app.errors import LinkError
from app.panel.widgets.parameter import GET
from app.permission.servers import parameters_offered
from app.robot.round_trips import RoundTrips, RoundTripSummary
from app.ros_logging import RobotLog
from app.survey.model import CYCLONE_DDS, RobotGraph, Server
from app.transport.peer import RobotContext

log = logging.getLogger("kiosk.survey")

EVERY_S: Final = 2.0
ANSWER_S: Final = 2.0
AGAIN_S: Final = 300.0
SERVICE, TYPE = GET

TripState = Literal["trip_measured", "trip_measuring", "trip_no_node", "trip_silent"]


class Asked(NamedTuple):
    """A node that can be asked, and the key of its service; `is_other`: the panel has no parameter of
    it. Sorted, the best is the first."""

    is_other: bool
    node: str
    key: str


class NodeRoundTrips:
    """The round trips to the nodes of one robot. Used on the event loop only. `node` is the one that
    was asked last, "" before the first; `state` is what is known of the last minutes."""

    def __init__(self, context: RobotContext) -> None:
        self._context = context
        self._log = RobotLog(log, context.robot.name)
        self._trips = RoundTrips()
        nodes = dict.fromkeys(widget.node for widget in context.panel.parameters())
        self._own = {context.robot.key(f"{node}/{SERVICE}"): node for node in nodes}
        self._seen: dict[str, float] = {}  # key → since when it is in the graph
        self._silent: dict[str, float] = {}  # key → when it did not answer
        self._began = -EVERY_S
        self._asking: asyncio.Task[None] | None = None
        self.node = ""
        self.state: TripState = "trip_measuring"

    def summary(self, now: float) -> RoundTripSummary | None:
        """That of the last five minutes; None without an answer in them."""
        return self._trips.summary(now)

    def measure(self, behind: Sequence[RobotGraph]) -> None:
        """Asks a node of these graphs, unless one was asked a moment ago. Does not wait for the
        answer."""
        now = time.monotonic()
        if self._asking is not None or now - self._began < EVERY_S or not behind:
            return
        self._began = now
        self._silent = {key: at for key, at in self._silent.items() if now - at < AGAIN_S}
        offered = sorted(self._offered(behind))
        self._seen = {asked.key: self._seen.get(asked.key, now) for asked in offered}
        settled = now - self._context.robot.traits.server_settle_s
        ready = (a for a in offered if self._seen[a.key] <= settled and a.key not in self._silent)
        asked = next(ready, None)
        if asked is None:
            waiting: TripState = "trip_measuring" if offered else "trip_no_node"
            self.state = "trip_silent" if self._silent else waiting
            return
        if asked.node != self.node:
            self.node, self._trips = asked.node, RoundTrips()
        self._asking = spawn_logged(self._ask(asked), self._log, "measuring a round trip failed")

    async def stop(self) -> None:
        await end_tasks((self._asking,))

    async def _ask(self, asked: Asked) -> None:
        context = self._context
        request, _ = context.interfaces.service_types(TYPE)
        payload = context.interfaces.encode(request, {"names": []})
        expression = context.robot.dialect.service(asked.key, TYPE)
        try:
            with suppress(LinkError):
                began = time.monotonic()
                answer = await context.link.query_at(expression, payload, ANSWER_S)
                ended = time.monotonic()
                if answer is not None:
                    self._trips.record(ended - began, ended)
                    self.state = "trip_measured"
                elif context.robot.link_up and context.robot.is_responding:
                    self._silent[asked.key], self.state = ended, "trip_silent"
        finally:
            self._asking = None

    def _offered(self, behind: Sequence[RobotGraph]) -> Iterator[Asked]:
        """The nodes that can be asked."""
        for robot in behind:
            for server in robot.services:
                node, _, service = server.name.rpartition("/")
                if (service, server.type) == GET and self._answers(robot, server):
                    yield Asked(server.key not in self._own, node, server.key)

    def _answers(self, robot: RobotGraph, server: Server) -> bool:
        """Whether a server surely answers, as far as the graph shows."""
        if server.key in self._own:
            return parameters_offered(self._own[server.key], self._context.robot) is None
        return server.dds == CYCLONE_DDS or not robot.bridges
