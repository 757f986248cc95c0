"""What the page of diagnostics reads of a robot while someone looks at it: topics, the ROS graph, round
trips."""

import asyncio
import json
import logging
import time
from collections import deque
from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final, Literal, NamedTuple

from app.cell.link.peer import Observe, RobotContext
from app.cell.permission.verdict import parameters_offered
from app.cell.robot.traffic import RoundTrips, RoundTripSummary
from app.cell.view.messages import MessageLook, message_look
from app.panel.widgets.parameter import GET
from app.ros.dialects.dialect import PanelEndpoint
from app.ros.graph.model import CYCLONE_DDS, GraphSnapshot, RobotGraph, Server, lost_topics
from app.ros.messages.names import MESSAGE_TYPE, NO_TYPE, Qos
from app.ros.zenoh.declarations import Declarations
from app.ros.zenoh.sample import Buffer
from app.ros.zenoh.session import ZenohSession
from app.system.concurrency import end_tasks, spawn_logged
from app.system.errors import LinkError, TooMany
from app.system.log import RobotLog
from app.system.printable import one_line
from app.system.texts import TextLike, say

# A live look into topics of a robot, also into those that the panel does not use: read only.
#
# Each topic has a Zenoh session to itself, which ends when no one has asked for it for `LINGER_S`. So
# the panel's own session has neither a subscription nor a token more. The look declares a token only
# for a topic that the panel does not use and that has a publisher, with the publisher's QoS: a bridge
# then keeps its route, and each message arrives once.

look_log = logging.getLogger("kiosk.look")

MOST_AT_ONCE: Final = 3  # topics of one robot
LINGER_S: Final = 6.0  # a page without scripts asks again after five seconds
LOOK_EVERY_S: Final = 0.5
FIRST_EVERY_S: Final = 0.05  # until the first message
MAX_MESSAGES: Final = 10  # messages
FIRST_WITHIN_S: Final = 1.5
ANY_TYPE: Final = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicPreview:
    """A topic to look into: `types`, `hashes` and `qos` are those of its publishers. `keeps_route`: a
    token of the panel keeps its route."""

    name: str
    key: str
    types: tuple[str, ...]
    hashes: tuple[str, ...] = ()
    qos: Qos = field(default_factory=Qos)
    keeps_route: bool = False


@dataclass(frozen=True, slots=True)
class PreviewMessage:
    """A message: `number` counts those that arrived, `wall` is in seconds since the epoch."""

    number: int
    wall: float
    content: MessageLook


@dataclass(slots=True)
class Look:
    """One topic that is looked into: the newest messages, the newest first. `fault`: why nothing can be
    received. `until` is in the event loop's time."""

    topic: TopicPreview
    until: float
    messages: deque[PreviewMessage] = field(default_factory=lambda: deque(maxlen=MAX_MESSAGES))
    received: int = 0
    fault: TextLike = ""
    task: "asyncio.Task[None] | None" = None
    arrived: asyncio.Event = field(default_factory=asyncio.Event)
    ended: asyncio.Event = field(default_factory=asyncio.Event)


class TopicPreviews:
    """The looks into one robot's topics. Used on the event loop only."""

    def __init__(self, context: RobotContext) -> None:
        self._context = context
        self._log = RobotLog(look_log, context.robot.name)
        self._loop = asyncio.get_running_loop()
        self._looks: dict[str, Look] = {}
        self._closed = False

    @property
    def keys(self) -> Collection[str]:
        """The keys of the topics that are looked into."""
        return self._looks.keys()

    async def look(self, topic: TopicPreview, wait_s: float = FIRST_WITHIN_S) -> Look:
        """The look into a topic, which goes on for `LINGER_S`. A new one waits for the first message,
        `wait_s` at most. TooMany if so many others are looked into."""
        look = self._looks.get(topic.key)
        if look is None:
            if len(self._looks) >= MOST_AT_ONCE or self._closed:
                raise TooMany(say("look_too_many", most=MOST_AT_ONCE), round(LINGER_S))
            look = self._looks[topic.key] = Look(topic, self._loop.time() + LINGER_S)
            look.task = spawn_logged(self._run(look), self._log, "a look into a topic failed")
        look.until = self._loop.time() + LINGER_S
        if not look.messages:
            with suppress(TimeoutError):
                async with asyncio.timeout(wait_s):
                    await look.arrived.wait()
        return look

    async def stop(self) -> None:
        """Ends all looks and their sessions."""
        self._closed = True
        tasks = [look.task for look in self._looks.values() if look.task is not None]
        for look in self._looks.values():
            look.ended.set()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _run(self, look: Look) -> None:
        """Looks until no one asks any more. The session is opened and closed on a thread: both take
        some tenths of a second."""
        session: ZenohSession | None = None
        try:
            session = await asyncio.to_thread(self._context.another_session)
            await asyncio.to_thread(self._subscribe, session, look.topic)
            while self._loop.time() < look.until and not look.ended.is_set():
                with suppress(TimeoutError):
                    async with asyncio.timeout(LOOK_EVERY_S if look.messages else FIRST_EVERY_S):
                        await look.ended.wait()
                await self._receive(session, look)
        except LinkError as error:
            look.fault = say("look_failed", why=str(error))
            look.arrived.set()
            await asyncio.wait({asyncio.ensure_future(look.ended.wait())}, timeout=LINGER_S)
        finally:
            if self._looks.get(look.topic.key) is look:
                del self._looks[look.topic.key]
            if session is not None:
                with suppress(LinkError):
                    await asyncio.to_thread(session.close)

    def _subscribe(self, session: ZenohSession, topic: TopicPreview) -> None:
        dialect = self._context.robot.dialect
        type_name = topic.types[0] if topic.types else NO_TYPE
        session.start(Declarations(subscribe={topic.key: dialect.topic(topic.key, ANY_TYPE)}))
        if topic.keeps_route and len(topic.types) == 1 and MESSAGE_TYPE.fullmatch(type_name):
            type_hash = next(iter(topic.hashes), "")
            own = PanelEndpoint("MS", topic.key, type_name, topic.qos, type_hash)
            session.declare_tokens(dialect.own_tokens(session.zid, [own]))

    async def _receive(self, session: ZenohSession, look: Look) -> None:
        sample = session.drain().samples.get(look.topic.key)
        if sample is None:
            return
        look.received += sample.skipped + 1
        content = await asyncio.to_thread(self._decode, look.topic, sample.payload)
        look.messages.appendleft(PreviewMessage(look.received, sample.wall, content))
        look.arrived.set()

    def _decode(self, topic: TopicPreview, payload: Buffer) -> MessageLook:
        return message_look(self._context.interfaces, topic.types, topic.hashes, bytes(payload))


# The whole ROS graph of a robot, read from its peers while someone looks at it.
#
# It is read by the panel's own session, which only queries: no subscription, no token. One reading at a
# time, and not more often than each `SURVEY_EVERY_S`.

log = logging.getLogger("kiosk.survey")

SURVEY_EVERY_S: Final = 5.0
WAIT_S: Final = 1.5  # for a reading that was begun: then the one before is shown
ROUTERS_WITHIN_S: Final = 1.0
# In Zenoh's admin space: JSON with `version`.
ROUTERS: Final = ("@/*/router", "@/*/peer")
MOST_VERSION: Final = 40


@dataclass(frozen=True, slots=True)
class Survey:
    """A reading: `wall` is when it was made, in seconds since the epoch. `zenoh` are the versions of
    Zenoh on the other side. `lost_topics` are the keys of topics that the bridge had lost in this and
    in the last reading: it announces them late. `fault`: why there is none newer."""

    graph: GraphSnapshot = field(default_factory=GraphSnapshot)
    wall: float = 0.0
    zenoh: Sequence[str] = ()
    lost_topics: frozenset[str] = frozenset()
    fault: str = ""


class GraphSurvey:
    """The graph of one robot. Used on the event loop only."""

    def __init__(self, context: RobotContext, observe: Observe) -> None:
        self._context = context
        self._observe = observe
        self._last = Survey()
        self._lost: set[str] = set()  # in the last reading
        self._began = -SURVEY_EVERY_S
        self._reading: asyncio.Task[None] | None = None

    async def read(self, wait_s: float = WAIT_S) -> Survey:
        """The graph as of `SURVEY_EVERY_S` ago at most; an older one if the peers take longer than
        `wait_s`."""
        now = asyncio.get_running_loop().time()
        if self._reading is None and now - self._began >= SURVEY_EVERY_S:
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


# The round trip to a robot's nodes: how long one of them takes to answer, measured while someone looks
# at the page of diagnostics.
#
# A node is asked for the values of no parameter, which it answers at once and which changes nothing.
# Through a bridge only nodes that surely answer are asked, those on Cyclone DDS and those that the
# panel has parameters of: a request without an answer stays in the bridge. One that did not answer is
# left alone for `AGAIN_S`, and a new one until it has settled.

ROUND_TRIP_EVERY_S: Final = 2.0
ANSWER_S: Final = 2.0
AGAIN_S: Final = 300.0
SERVICE, TYPE = GET

TripState = Literal["trip_measured", "trip_measuring", "trip_no_node", "trip_silent"]


class NodeQuery(NamedTuple):
    """A node that can be queried, and the key of its service; `is_other`: the panel has no parameter of
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
        self._began = -ROUND_TRIP_EVERY_S
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
        if self._asking is not None or now - self._began < ROUND_TRIP_EVERY_S or not behind:
            return
        self._began = now
        self._silent = {key: at for key, at in self._silent.items() if now - at < AGAIN_S}
        offered = sorted(self._offered(behind))
        self._seen = {query.key: self._seen.get(query.key, now) for query in offered}
        settled = now - self._context.robot.traits.server_settle_s
        ready = (a for a in offered if self._seen[a.key] <= settled and a.key not in self._silent)
        query = next(ready, None)
        if query is None:
            waiting: TripState = "trip_measuring" if offered else "trip_no_node"
            self.state = "trip_silent" if self._silent else waiting
            return
        if query.node != self.node:
            self.node, self._trips = query.node, RoundTrips()
        self._asking = spawn_logged(self._ask(query), self._log, "measuring a round trip failed")

    async def stop(self) -> None:
        await end_tasks((self._asking,))

    async def _ask(self, query: NodeQuery) -> None:
        context = self._context
        request, _ = context.interfaces.service_types(TYPE)
        payload = context.interfaces.encode(request, {"names": []})
        expression = context.robot.dialect.service(query.key, TYPE)
        try:
            with suppress(LinkError):
                began = time.monotonic()
                answer = await context.link.query_at(expression, payload, ANSWER_S)
                ended = time.monotonic()
                if answer is not None:
                    self._trips.record(ended - began, ended)
                    self.state = "trip_measured"
                elif context.robot.link_up and context.robot.is_responding:
                    self._silent[query.key], self.state = ended, "trip_silent"
        finally:
            self._asking = None

    def _offered(self, behind: Sequence[RobotGraph]) -> Iterator[NodeQuery]:
        """The nodes that can be asked."""
        for robot in behind:
            for server in robot.services:
                node, _, service = server.name.rpartition("/")
                if (service, server.type) == GET and self._answers(robot, server):
                    yield NodeQuery(server.key not in self._own, node, server.key)

    def _answers(self, robot: RobotGraph, server: Server) -> bool:
        """Whether a server surely answers, as far as the graph shows."""
        if server.key in self._own:
            return parameters_offered(self._own[server.key], self._context.robot) is None
        return server.dds == CYCLONE_DDS or not robot.bridges
