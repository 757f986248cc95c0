"""Callbacks on Zenoh's threads, answers to Zenoh queries on the event loop, and the protocols of a link
by which the admin space and the ROS graph are queried."""

import asyncio
import ctypes
import json
import logging
import threading
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from typing import Any, Final, Protocol, TypeVar

import zenoh
from zenoh.handlers import Callback

from app.ros.dialects.dialect import newest

# Callbacks on Zenoh's threads, which Python did not start. `attach` keeps their thread state: without
# it, Python creates one at each callback and deletes it afterwards.

log = logging.getLogger("kiosk.zenoh")

Event = TypeVar("Event")
FAILED: Final = "a callback on a thread of Zenoh failed: its message or answer is lost"
_attached: Final = threading.local()  # not their ids: one that has ended leaves its id to another


class CallbackErrors:
    """How many callbacks have failed since the start of the process."""

    count = 0


callback_errors: Final = CallbackErrors()


def attach() -> None:
    """Call it in every callback on such a thread. Only the first call in a thread has an effect."""
    if not hasattr(_attached, "is_done"):
        _attached.is_done, me = True, threading.get_ident()
        if all(thread.ident != me for thread in threading.enumerate()):  # those have theirs
            ctypes.pythonapi.PyGILState_Ensure()


def direct(
    function: Callable[[Event], None], on_end: Callable[[], None] | None = None
) -> "Callback[Event]":
    """A handler that runs on Zenoh's receiving thread. What `function` raises is counted and logged,
    and the next event arrives."""

    def handle(event: Event) -> None:
        attach()
        try:
            function(event)
        except Exception:
            callback_errors.count += 1
            log.exception(FAILED)

    return Callback(handle, on_end, indirect=False)


# Receives the answers to a Zenoh query on the event loop, and payloads that are kept.

COPIED_MOST = 16_384  # bytes of a sample
CACHE_TIMEOUT_S = 10.0
Read = Callable[[zenoh.Sample], "bytes | zenoh.ZBytes"]  # the payload of a sample
Ask = Callable[["Callback[zenoh.Reply]"], None]  # queries with this handler of its replies


async def collected(ask: Ask, timeout_s: float) -> tuple[list[tuple[str, bytes]], bool]:
    """(key, payload) of each answer that arrives within `timeout_s`, and whether these are all."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()
    answers: list[tuple[str, bytes]] = []
    end = time.monotonic() + timeout_s

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            answers.append((str(reply.ok.key_expr), reply.ok.payload.to_bytes()))

    def finish() -> None:
        if not done.done():
            done.set_result(None)

    def on_end() -> None:
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(finish)

    ask(direct(on_reply, on_end))
    late = loop.call_later(timeout_s + 1, finish)
    try:
        await done
    finally:
        late.cancel()
    return answers, time.monotonic() < end


def first_answer(ask: Ask, read: Read) -> "asyncio.Future[bytes | None]":
    """What `read` returns of the first answer, None if there is none."""
    loop = asyncio.get_running_loop()
    answered: asyncio.Future[bytes | None] = loop.create_future()

    def finish(answer: bytes | None) -> None:
        if not answered.done():
            answered.set_result(answer)

    def hand_over(answer: bytes | None) -> None:
        with suppress(RuntimeError):  # the loop is closed
            loop.call_soon_threadsafe(finish, answer)

    def on_reply(reply: zenoh.Reply) -> None:
        if reply.ok is not None:
            hand_over(bytes(read(reply.ok)))

    ask(direct(on_reply, lambda: hand_over(None)))
    return answered


def own_payload(payload: zenoh.ZBytes) -> bytes | zenoh.ZBytes:
    """A payload that may be kept for long. A small one is copied: it is a part of the buffer that the
    network was read into, and would keep all of it, so that the next message needs another."""
    return payload if len(payload) > COPIED_MOST else payload.to_bytes()


def ask_newest(session: zenoh.Session, token: str, take: "Callback[zenoh.Reply]") -> None:
    """Asks the cache of this token for its last message."""
    with suppress(zenoh.ZError):  # the session is closed: the next one finds the cache again
        session.get(
            newest(token),
            take,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
            accept_replies=zenoh.ReplyKeyExpr.ANY,
            timeout=CACHE_TIMEOUT_S,
        )


# The protocols of a link by which the admin space and the ROS graph are queried.


class AdminSpace(Protocol):
    """The part of the Zenoh session that queries of the admin space need."""

    async def query_all(self, selector: str, timeout_s: float = ...) -> list[tuple[str, bytes]]:
        """(key, payload) of each answer that arrives in time. LinkError without a link."""


class GraphLink(AdminSpace, Protocol):
    """The part of the Zenoh session that reading the ROS graph needs."""

    async def tokens(self, timeout_s: float = ...) -> list[str]:
        """The liveliness tokens. LinkError without a link, or if not all arrive in time."""


def neighbour_queries(routers: Collection[str], peers: Collection[str]) -> frozenset[str]:
    """The queries that the connected routers answer, or without a router the connected peers, if their
    admin space is on."""
    kind, zids = ("router", routers) if routers else ("peer", peers)
    return frozenset(f"@/{zid}/{kind}" for zid in zids)


async def ask_json(link: AdminSpace, selector: str) -> list[tuple[str, Any]]:
    """(key, answer) of each answer that is JSON; others are ignored. LinkError without a link."""
    answers = []
    for key, answer in await link.query_all(selector):
        with suppress(ValueError, RecursionError):
            answers.append((key, json.loads(answer)))
    return answers
