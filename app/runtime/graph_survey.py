"""The whole ROS graph of a robot, read from its peers while someone looks at it.

It is read by the panel's own session, which only queries: no subscription, no token. One reading at a
time, and not more often than each `EVERY_S`.
"""

import asyncio
import json
import logging
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final

from app.errors import LinkError
from app.printable import one_line
from app.survey.forwarding import lost_topics
from app.survey.model import GraphSnapshot
from app.transport.peer import Observe, RobotContext

log = logging.getLogger("kiosk.survey")

EVERY_S: Final = 5.0
WAIT_S: Final = 1.5  # for a reading that was begun: then the one before is shown
ROUTERS_WITHIN_S: Final = 1.0
# In Zenoh's admin space: JSON with `version`.
ROUTERS: Final = ("@/*/router", "@/*/peer")
MOST_VERSION: Final = 40


@dataclass(frozen=True, slots=True)
class Survey:
    """A reading: `wall` is when it was made, in seconds since the epoch. `zenoh` are the versions of
    Zenoh on the other side. `lost` are the keys of topics that the bridge had lost in this and in the
    last reading: it announces them late. `fault`: why there is none newer."""

    graph: GraphSnapshot = field(default_factory=GraphSnapshot)
    wall: float = 0.0
    zenoh: Sequence[str] = ()
    lost: frozenset[str] = frozenset()
    fault: str = ""


class GraphSurvey:
    """The graph of one robot. Used on the event loop only."""

    def __init__(self, context: RobotContext, observe: Observe) -> None:
        self._context = context
        self._observe = observe
        self._last = Survey()
        self._lost: set[str] = set()  # in the last reading
        self._began = -EVERY_S
        self._reading: asyncio.Task[None] | None = None

    async def read(self, wait_s: float = WAIT_S) -> Survey:
        """The graph as of `EVERY_S` ago at most; an older one if the peers take longer than
        `wait_s`."""
        now = asyncio.get_running_loop().time()
        if self._reading is None and now - self._began >= EVERY_S:
            self._began = now
            self._reading = asyncio.create_task(self._read())
        if self._reading is not None:
            await asyncio.wait({self._reading}, timeout=wait_s)
        return self._last

    async def stop(self) -> None:
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.gather(self._reading, return_exceptions=True)

    async def _read(self) -> None:
        link = self._context.link
        try:
            graph, zenoh = await asyncio.gather(self._observe(link, link.zid), self._versions())
            lost = {topic.key for robot in graph.robots for topic in lost_topics(robot)}
            self._last = Survey(graph, time.time(), zenoh, frozenset(lost & self._lost))
            self._lost = lost
        except LinkError as error:
            self._last = replace(self._last, fault=str(error))
        except Exception:
            log.exception("the ROS graph can't be read")
        finally:
            self._reading = None

    async def _versions(self) -> tuple[str, ...]:
        link, versions = self._context.link, set[str]()
        answers = await asyncio.gather(*(link.query_all(s, ROUTERS_WITHIN_S) for s in ROUTERS))
        for _, answer in (answer for several in answers for answer in several):
            with suppress(ValueError, RecursionError, TypeError, KeyError):
                said = json.loads(answer)
                if any(link.zid == peer["peer"] for peer in said["sessions"]):  # else further away
                    versions.add(one_line(str(said["version"]).split("-")[0].lstrip("v"), MOST_VERSION))
        return tuple(sorted(versions))
