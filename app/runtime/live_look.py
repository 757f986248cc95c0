"""A live look into topics of a robot, also into those that the panel does not use: read only.

Each topic has a Zenoh session to itself, which ends when no one has asked for it for `LINGER_S`. So
the panel's own session has neither a subscription nor a token more. The look declares a token only for
a topic that the panel does not use and that has a publisher, with the publisher's QoS: a bridge then
keeps its route, and each message arrives once.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Collection
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from app.concurrency import spawn_logged
from app.dialect.endpoint import OwnEndpoint
from app.errors import LinkError, TooMany
from app.i18n import TextLike, say
from app.interfaces.names import MESSAGE_TYPE, NO_TYPE, Qos
from app.robot.sample import Buffer
from app.ros_logging import RobotLog
from app.transport.declarations import Declarations
from app.transport.peer import RobotContext
from app.transport.zenoh_session import ZenohSession
from app.view.message_look import MessageLook, message_look

log = logging.getLogger("kiosk.look")

MOST_AT_ONCE: Final = 3  # topics of one robot
LINGER_S: Final = 6.0  # a page without scripts asks again after five seconds
EVERY_S: Final = 0.5
FIRST_EVERY_S: Final = 0.05  # until the first message
KEPT: Final = 10  # messages
FIRST_WITHIN_S: Final = 1.5
ANY_TYPE: Final = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LookedTopic:
    """A topic to look into: `types`, `hashes` and `qos` are those of its publishers. `held`: a token
    keeps its route."""

    name: str
    key: str
    types: tuple[str, ...]
    hashes: tuple[str, ...] = ()
    qos: Qos = field(default_factory=Qos)
    held: bool = False


@dataclass(frozen=True, slots=True)
class LookedMessage:
    """A message: `number` counts those that arrived, `wall` is in seconds since the epoch."""

    number: int
    wall: float
    shown: MessageLook


@dataclass(slots=True)
class Look:
    """One topic that is looked into: the newest messages, the newest first. `fault`: why nothing can be
    received. `until` is in the event loop's time."""

    topic: LookedTopic
    until: float
    messages: deque[LookedMessage] = field(default_factory=lambda: deque(maxlen=KEPT))
    received: int = 0
    fault: TextLike = ""
    task: "asyncio.Task[None] | None" = None
    arrived: asyncio.Event = field(default_factory=asyncio.Event)
    ended: asyncio.Event = field(default_factory=asyncio.Event)


class LiveLooks:
    """The looks into one robot's topics. Used on the event loop only."""

    def __init__(self, context: RobotContext) -> None:
        self._context = context
        self._log = RobotLog(log, context.robot.name)
        self._loop = asyncio.get_running_loop()
        self._looks: dict[str, Look] = {}
        self._closed = False

    @property
    def keys(self) -> Collection[str]:
        """The keys of the topics that are looked into."""
        return self._looks.keys()

    async def look(self, topic: LookedTopic, wait_s: float = FIRST_WITHIN_S) -> Look:
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
                    async with asyncio.timeout(EVERY_S if look.messages else FIRST_EVERY_S):
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

    def _subscribe(self, session: ZenohSession, topic: LookedTopic) -> None:
        dialect = self._context.robot.dialect
        type_name = topic.types[0] if topic.types else NO_TYPE
        session.start(Declarations(subscribe={topic.key: dialect.topic(topic.key, ANY_TYPE)}))
        if topic.held and len(topic.types) == 1 and MESSAGE_TYPE.fullmatch(type_name):
            type_hash = next(iter(topic.hashes), "")
            own = OwnEndpoint("MS", topic.key, type_name, topic.qos, type_hash)
            session.declare_tokens(dialect.own_tokens(session.zid, [own]))

    async def _receive(self, session: ZenohSession, look: Look) -> None:
        sample = session.drain().samples.get(look.topic.key)
        if sample is None:
            return
        look.received += sample.skipped + 1
        shown = await asyncio.to_thread(self._shown, look.topic, sample.payload)
        look.messages.appendleft(LookedMessage(look.received, sample.wall, shown))
        look.arrived.set()

    def _shown(self, topic: LookedTopic, payload: Buffer) -> MessageLook:
        return message_look(self._context.interfaces, topic.types, topic.hashes, bytes(payload))
