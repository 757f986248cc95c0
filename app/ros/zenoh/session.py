"""The Zenoh session: its subscribers, publishers, queries and threads."""

import asyncio
import atexit
import logging
import os
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from typing import Any, Final, Protocol

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.ros.dialects.dialect import Dialect, caches, is_cache_of, numbered_publisher
from app.ros.zenoh.answers import ask_newest, collected, direct, first_answer, own_payload
from app.ros.zenoh.config import (
    endpoints_of,
    in_own_thread,
    open_session,
    tokens_for_clients,
    translated,
)
from app.ros.zenoh.declarations import NOTHING, Declarations
from app.ros.zenoh.inbox import Changes, Inbox, Number
from app.system.errors import LinkError
from app.system.limits import Quota, TokenBuckets

# Publishers of the Zenoh session: plain ones, and latched ones, which keep their last message.

# BLOCK and RELIABLE: what is put reaches the peer, or the link is cut. REMOTE: not this session's own
# subscribers.
SETTINGS: Final[dict[str, Any]] = {
    "congestion_control": zenoh.CongestionControl.BLOCK,
    "express": True,
    "reliability": zenoh.Reliability.RELIABLE,
    "allowed_destination": zenoh.Locality.REMOTE,
}


class Publisher(Protocol):
    """A publisher on one key expression."""

    def put(self, payload: bytes, *, attachment: bytes | None = None) -> Any: ...

    @property
    def matching_status(self) -> Any:
        """An object of Zenoh's, whose `matching` tells whether there is a subscriber."""


def declare_publisher(session: zenoh.Session, expression: str, *, kept: int) -> Publisher:
    """A publisher. A subscriber that comes late gets its last `kept` messages, also if none was there
    when they were put. What it keeps ends with the session: nothing is sent again after the
    connection was lost."""
    plain: Publisher = session.declare_publisher(expression, **SETTINGS)
    return _Latched(session, expression, plain, kept) if kept else plain


class _Latched:
    """Zenoh's publisher with a cache does not tell who listens: a plain one does."""

    def __init__(self, session: zenoh.Session, expression: str, plain: Publisher, kept: int) -> None:
        self._plain = plain
        self._cached = declare_advanced_publisher(
            session,
            expression,
            cache=CacheConfig(max_samples=kept),
            publisher_detection=True,
            # Orders by number: timestamps of one's own would replace those of clocks that are ahead.
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None),
            **SETTINGS,
        )

    def put(self, payload: bytes, *, attachment: bytes | None = None) -> None:
        self._cached.put(payload, attachment=attachment)

    @property
    def matching_status(self) -> Any:
        return self._plain.matching_status


# Queries the liveliness tokens of a session's routers.
#
# With several routers Zenoh's query ends with the answer of the first. A subscriber with history
# receives the tokens of all, and from then on the query has what the session knows: so with several
# routers a subscriber is declared, and its history is waited for. With one the query has all of its
# tokens.

HISTORY_WITHIN_S: Final = 1.0
TOKEN_POLL_S: Final = 0.05


class TokenQuery:
    """The tokens of one session that match a key expression."""

    def __init__(self, session: zenoh.Session, expression: str) -> None:
        self._session = session
        self._expression = expression
        self._watched: zenoh.Subscriber[None] | None = None

    async def keys(self, timeout_s: float) -> list[str]:
        """All of them; LinkError if they do not arrive in time."""
        routers = len(self._session.info.routers_zid()) + len(self._session.info.peers_zid())
        if routers > 1 and self._watched is None:
            self._watched = self._session.liveliness().declare_subscriber(
                self._expression, direct(_ignore), history=True
            )
        tokens = await self._query(timeout_s)
        end = asyncio.get_running_loop().time() + HISTORY_WITHIN_S
        while self._watched is not None and asyncio.get_running_loop().time() < end:
            await asyncio.sleep(TOKEN_POLL_S)
            before, tokens = tokens, await self._query(timeout_s)
            if len(before) == len(tokens) and len({*map(_owner, tokens)}) >= routers:
                break
        return tokens

    async def _query(self, timeout_s: float) -> list[str]:
        get = self._session.liveliness().get
        replies, whole = await collected(
            lambda back: get(self._expression, back, timeout=timeout_s), timeout_s
        )
        if not whole:
            raise LinkError(f"the ROS graph did not come within {timeout_s:g} s")
        return [key for key, _ in replies]


def _owner(token: str) -> str:
    """The zid in a token."""
    return token.split("/")[1]


def _ignore(_: zenoh.Sample) -> None:
    """For samples that are not needed."""


# Zenoh's own setting of its threads, read when its first session opens. By default the thread that
# waits for the network wakes another one for each message; one thread for both costs half.
RUNTIME: Final = "(rx: (handover: net))"
os.environ.setdefault("ZENOH_RUNTIME", RUNTIME)


# Owns the Zenoh session. Zenoh's threads put what they receive into the inbox. Errors of Zenoh are
# raised as LinkError.

log = logging.getLogger("kiosk.link")

ASK_TIMEOUT_S = 2.0
POLL_S = 0.02
LOSSES: Final = Quota(1, per_s=1 / 60)  # of a topic that are in the log
NUMBER_BYTES: Final = 4  # of the number of a publisher's last message
NOT_READ = b""  # in place of a payload: it is of no type, so what needs it locks
OnPayload = Callable[[Any], None]


def number_of(sample: zenoh.Sample) -> Number | None:
    """The number of a message, if its publisher numbers them."""
    if (info := sample.source_info) is None:
        return None
    source = info.source_id
    return Number(f"{source.zid}/{source.eid}", info.source_sn)


class ZenohSession:
    """A session with its subscribers, publishers and tokens."""

    def __init__(self, config: zenoh.Config, wake: Callable[[bool], None], dialect: Dialect) -> None:
        """Opens the session, with or without a peer; `wake` is the inbox's."""
        self._config = config
        self._dialect = dialect
        self._inbox = Inbox(wake)
        self._declared: Declarations = NOTHING
        self._sent: Counter[str] = Counter()  # messages and queries, by key expression
        self._on_demand: dict[str, tuple[str, OnPayload]] = {}  # key → key expression, callback
        self._demanded: dict[str, zenoh.Subscriber[None]] = {}
        self._numbered: dict[str, zenoh.Subscriber[None]] = {}  # by key: to the numbers of its messages
        self._losses = TokenBuckets(LOSSES)
        self._held: dict[str, zenoh.LivelinessToken] | None = {}  # None: between two sessions
        self._open()

    @property
    def endpoints(self) -> tuple[str, ...]:
        """The endpoints it connects to, as configured; empty if it only scouts."""
        return endpoints_of(self._config)

    def _open(self) -> None:
        self._session, self._is_final = open_session(self._config, self._dialect.as_client)
        self.zid = str(self._session.zid())
        self._tokens = [TokenQuery(self._session, each) for each in self._dialect.tokens]
        atexit.register(self._leave)

    def start(self, declared: Declarations) -> None:
        """Declares everything, once in a session."""
        self.expect(declared)
        self._declare()

    def expect(self, declared: Declarations) -> None:
        """What the next session declares."""
        self._inbox.set_topics(
            declared.immediate, declared.lossless, declared.recorded, declared.changing
        )
        self._declared = declared

    def forget(self) -> None:
        """Drops all that this session has received and receives yet."""
        self._inbox.renew()

    def renew(self) -> None:
        """Opens a new session and declares everything; blocks for up to some tenths of a second.

        Zenoh would reconnect the old one by itself. But a bridge that notices late that the old
        connection is lost ends the routes that it has just made again for this session: it would show
        the panel server as a subscriber and read nothing for it. And a subscriber drops a sample that
        it has received before, although the loss of the link has invalidated it.
        """
        held, self._held = self._held, None
        self._inbox.renew()
        with suppress(LinkError):
            self.close()
        del held  # a token ends with its object: never under the lock, where Zenoh may call back
        self._open()
        self._declare()
        self._held = {}

    def _declare(self) -> None:
        with translated("the Zenoh session can't be used"):
            self._listeners = (
                self._session.info.declare_transport_events_listener(
                    self._direct(self._on_transport), history=True
                ),
                *(
                    self._session.liveliness().declare_subscriber(
                        expression, self._direct(self._on_token), history=True
                    )
                    for expression in self._dialect.tokens
                ),
            )
            self._publishers = {
                key: declare_publisher(
                    self._session, publication, kept=self._declared.latched.get(key, 0)
                )
                for key, publication in self._declared.publish.items()
            }
            self._subscribers = [
                declared
                for key, expression in self._declared.subscribe.items()
                for declared in self._subscriptions(key, expression)
            ]
            self._demanded = {
                key: self._subscriber(*subscription)
                for key, subscription in dict(self._on_demand).items()
            }
            self._numbered = {}

    def _subscriptions(self, key: str, expression: str) -> Iterator[zenoh.Subscriber[None]]:
        """A subscriber to the topic, and one to the tokens of its publishers' caches. Zenoh's own
        subscriber with history drops samples with an older timestamp than the last: after a timestamp
        of a clock that is ahead it would drop all."""
        put = self._inbox.put
        yield self._session.declare_subscriber(
            expression,
            self._direct(
                lambda sample: put(key, self._read(sample), sample.timestamp, number_of(sample))
            ),
        )
        yield self._session.liveliness().declare_subscriber(
            caches(expression), self._direct(lambda sample: self._on_cache(key, sample)), history=True
        )

    def subscribe_on_demand(self, key: str, expression: str, on_payload: OnPayload) -> None:
        """Subscribes to a stream until `unsubscribe`, in this session and those after it: pictures of a
        camera, `/clock`. Neither a latched message nor a lost one is asked for: the next of the stream
        takes its place, and a stream that stops is old. `on_payload` is called on Zenoh's threads,
        under the inbox's lock: it must not block."""
        self._on_demand[key] = expression, on_payload
        if self._held is None:
            return  # the new session subscribes
        with translated(f"can't subscribe to {key}"):
            self._demanded[key] = self._subscriber(expression, on_payload)

    def unsubscribe(self, key: str) -> None:
        """Ends a subscription of `subscribe_on_demand`."""
        self._on_demand.pop(key, None)
        if (declared := self._demanded.pop(key, None)) is not None:
            with translated(f"can't unsubscribe from {key}"):
                declared.undeclare()

    def _subscriber(self, expression: str, on_payload: OnPayload) -> "zenoh.Subscriber[None]":
        return self._session.declare_subscriber(
            expression, self._direct(lambda sample: on_payload(self._read(sample)))
        )

    def _ask_cache(self, key: str, token: str) -> None:
        """Puts the last message of a topic's cache into the inbox."""
        put = self._inbox.put_cached

        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                put(key, self._read(reply.ok), reply.ok.timestamp, number_of(reply.ok))

        ask_newest(self._session, token, self._direct(take))

    def _hear_numbers(self, key: str) -> None:
        """Subscribes to what the publishers of a topic say of the numbers of their messages. A node on
        rmw_zenoh drops messages where a connection is slow, also the last one of a latched topic."""
        if key not in self._numbered:
            with suppress(zenoh.ZError):  # the session is closed
                self._numbered[key] = self._session.declare_subscriber(
                    caches(self._declared.subscribe[key]),
                    self._direct(lambda sample: self._on_number(key, sample)),
                )

    def _direct(self, function: Callable[[Any], None]) -> "Callback[Any]":
        """A handler that runs on Zenoh's receiving thread. It does nothing after `renew`."""
        return direct(self._inbox.guarded(function))

    def declare_tokens(self, tokens: Iterable[str]) -> None:
        """Holds exactly these liveliness tokens from now on."""
        wanted, held = set(tokens), self._held
        if held is None:
            return  # the new session is not joined yet
        with translated("can't join the ROS graph"):
            for token in held.keys() - wanted:
                held.pop(token).undeclare()
            for token in wanted - held.keys():
                held[token] = self._session.liveliness().declare_token(token)

    def put(self, key: str, payload: bytes) -> None:
        """Sends at once or not at all: nothing is kept for later. LinkError if Zenoh refuses."""
        attachment = self._attachment(self._declared.publish[key], payload)
        with translated(f"can't send on {key}"):
            self._publishers[key].put(payload, attachment=attachment)

    def _attachment(self, expression: str, payload: bytes) -> bytes | None:
        """The attachment of the next message or query on a key expression: all that leaves comes by
        here. LinkError for a payload that is not whole: a node of the robot could end by it."""
        if not self._dialect.is_whole(payload):
            raise LinkError(f"can't send on {expression}: {len(payload)} bytes are no message")
        self._sent[expression] += 1
        return self._dialect.attachment(self.zid, expression, self._sent[expression], time.time_ns())

    def _read(self, sample: zenoh.Sample) -> bytes | zenoh.ZBytes:
        """The payload of a message or response; NOT_READ for one that the dialect does not accept: all
        that arrives comes by here. On Zenoh's threads."""
        attachment = sample.attachment
        if self._dialect.accepts(None if attachment is None else attachment.to_bytes()):
            return own_payload(sample.payload)
        return NOT_READ

    def has_reader(self, key: str) -> bool:
        """Whether the publisher has a matching subscriber."""
        with translated(f"can't ask who listens on {key}"):
            return bool(self._publishers[key].matching_status.matching)

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        """Queries a declared service once. The future gets the first answer, None if there is none."""
        return self.query_at(self._declared.query[key], payload, timeout_s)

    def query_at(
        self, expression: str, payload: bytes, timeout_s: float
    ) -> "asyncio.Future[bytes | None]":
        """The same, for any service by its key expression."""
        attachment = self._attachment(expression, payload)
        with translated(f"can't ask {expression}"):
            return first_answer(
                lambda callback: self._session.get(
                    expression,
                    callback,
                    payload=payload,
                    attachment=attachment,
                    timeout=timeout_s,
                    consolidation=zenoh.ConsolidationMode.NONE,
                ),
                self._read,
            )

    async def query_all(
        self, selector: str, timeout_s: float = ASK_TIMEOUT_S
    ) -> list[tuple[str, bytes]]:
        """(key, payload) of each answer to a query that arrives within `timeout_s`."""
        get = self._session.get
        with translated(f"can't ask {selector}"):
            answers, _ = await collected(lambda back: get(selector, back, timeout=timeout_s), timeout_s)
        return answers

    async def tokens(self, timeout_s: float = ASK_TIMEOUT_S) -> list[str]:
        """The liveliness tokens of the ROS graph; LinkError if not all of them arrive in time."""
        with translated("can't ask for the ROS graph"):
            return [key for query in self._tokens for key in await query.keys(timeout_s)]

    async def tokens_for_clients(self, expressions: Collection[str]) -> list[str]:
        """The tokens that a client of the router sees: a peer does not see those of other peers."""
        return await in_own_thread(lambda: tokens_for_clients(self._config, expressions))

    async def connected(self, within_s: float) -> bool:
        """Whether it has a connection to any other peer or router, or gets one in time."""
        end = time.monotonic() + within_s
        while not self.is_connected:
            if time.monotonic() > end:
                return False
            await asyncio.sleep(POLL_S)
        return True

    @property
    def is_connected(self) -> bool:
        """Whether it has a connection to any other peer or router."""
        return any(self.neighbours())

    def neighbours(self) -> tuple[frozenset[str], frozenset[str]]:
        """The zids of the routers and of the peers that it has a connection to."""
        with translated("the Zenoh session can't be used"):
            info = self._session.info
            return frozenset(map(str, info.routers_zid())), frozenset(map(str, info.peers_zid()))

    def probe(self) -> None:
        """Returns when both the inbox and the session respond; blocks until then."""
        self._inbox.probe()
        with suppress(LinkError):  # one that is being renewed has responded too
            self.neighbours()

    def set_idle(self, keys: Collection[str]) -> None:
        """See `Inbox.set_idle`."""
        self._inbox.set_idle(keys)

    @property
    def has_idle(self) -> bool:
        """See `Inbox.has_idle`."""
        return self._inbox.has_idle

    def drain(self, whole: bool = True) -> Changes:
        """Returns and removes what has been received since the last call, as `Inbox.drain`."""
        changes = self._inbox.drain(whole)
        if not self._is_final:  # a peer that waited for something to be a client of
            changes.link_up, changes.reopen = False, changes.link_up
        # Not in the callbacks, which must not query.
        for key, token, lost in changes.caches:
            if numbered_publisher(token):
                self._hear_numbers(key)
            if lost and self._losses.has_token(key):
                self._losses.take_token(key)
                log.warning(
                    "more was published on %s than has arrived: the last message is asked for", key
                )
            self._ask_cache(key, token)
        return changes

    @property
    def has_immediate(self) -> bool:
        """Whether data that may change a permission has been received since the last drain."""
        return self._inbox.has_immediate

    def close(self) -> None:
        """Closes the session; blocks for up to some tenths of a second."""
        atexit.unregister(self._leave)
        with translated("the Zenoh session did not close cleanly"):
            self._session.close()

    def _leave(self) -> None:
        """At exit without a close: Zenoh must not call into an interpreter that ends."""
        with suppress(LinkError):
            self.close()

    # Below: on Zenoh's threads, under the inbox's lock. No work here, and nothing may raise.

    def _on_token(self, sample: zenoh.Sample) -> None:
        self._inbox.token(str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT)

    def _on_cache(self, key: str, sample: zenoh.Sample) -> None:
        token = str(sample.key_expr)
        if is_cache_of(token, self.zid):
            return
        if sample.kind == zenoh.SampleKind.PUT:
            self._inbox.cache(key, token)
        else:
            self._inbox.publisher_lost(key, numbered_publisher(token))

    def _on_number(self, key: str, sample: zenoh.Sample) -> None:
        token, number = str(sample.key_expr), sample.payload.to_bytes()
        publisher = numbered_publisher(token)
        if publisher and len(number) == NUMBER_BYTES:
            last = Number(publisher, int.from_bytes(number, "little"))
            self._inbox.last_number(key, token, last)

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        self._inbox.transport(str(event.transport.zid), event.kind == zenoh.SampleKind.PUT)


class Unconnected(ZenohSession):
    """A session that is never opened: of a panel that is only drawn, and of a wall, which has no
    robot."""

    def _open(self) -> None:
        self.zid, self._is_final = "", True
        self._tokens = []
