"""Owns the Zenoh session. Zenoh's threads put what they receive into the inbox. Errors of Zenoh are
raised as LinkError."""

import asyncio
import atexit
import time
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from typing import Any

import zenoh
from zenoh.handlers import Callback

from app.dialect.dialect import Dialect
from app.dialect.latched import caches, is_cache_of
from app.errors import LinkError
from app.transport.declarations import NOTHING, Declarations
from app.transport.inbox import Changes, Inbox
from app.transport.native_threads import attach
from app.transport.token_query import TokenQuery
from app.transport.zenoh_answers import ask_newest, collected, first_answer, own_payload
from app.transport.zenoh_config import endpoints_of, translated
from app.transport.zenoh_opening import in_own_thread, open_session, tokens_for_clients
from app.transport.zenoh_publishers import declare_publisher

ASK_TIMEOUT_S = 2.0
POLL_S = 0.02
OnPayload = Callable[[Any], None]


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
        self._inbox.set_topics(declared.immediate, declared.lossless, declared.recorded)
        self._declared = declared

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

    def _subscriptions(self, key: str, expression: str) -> Iterator[zenoh.Subscriber[None]]:
        """A subscriber to the topic, and one to the tokens of its publishers' caches. Zenoh's own
        subscriber with history drops samples with an older timestamp than the last: after a timestamp
        of a clock that is ahead it would drop all."""
        put = self._inbox.put
        yield self._session.declare_subscriber(
            expression,
            self._direct(lambda sample: put(key, own_payload(sample.payload), sample.timestamp)),
        )
        yield self._session.liveliness().declare_subscriber(
            caches(expression), self._direct(lambda sample: self._on_cache(key, sample)), history=True
        )

    def subscribe_on_demand(self, key: str, expression: str, on_payload: OnPayload) -> None:
        """Subscribes to a topic until `unsubscribe`, in this session and those after it. `on_payload`
        is called on Zenoh's threads, under the inbox's lock: it must not block."""
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
            expression, self._direct(lambda sample: on_payload(own_payload(sample.payload)))
        )

    def _ask_cache(self, key: str, token: str) -> None:
        """Puts the last message of a topic's cache into the inbox."""
        put = self._inbox.put_cached

        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                put(key, own_payload(reply.ok.payload), reply.ok.timestamp)

        ask_newest(self._session, token, self._direct(take))

    def _direct(self, function: Callable[[Any], None]) -> "Callback[Any]":
        """A handler that runs on Zenoh's receiving thread. It does nothing after `renew`."""
        take = self._inbox.guarded(function)

        def handle(event: Any) -> None:
            attach()
            take(event)

        return Callback(handle, indirect=False)

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
                )
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

    def drain(self) -> Changes:
        """Returns and removes everything received since the last call."""
        changes = self._inbox.drain()
        if not self._is_final:  # a peer that waited for something to be a client of
            changes.link_up, changes.reopen = False, changes.link_up
        for key, token in changes.caches:  # not in the callback, which must not query
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
        if sample.kind == zenoh.SampleKind.PUT and not is_cache_of(token, self.zid):
            self._inbox.cache(key, token)

    def _on_transport(self, event: zenoh.TransportEvent) -> None:
        self._inbox.transport(str(event.transport.zid), event.kind == zenoh.SampleKind.PUT)
