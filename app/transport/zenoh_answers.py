"""Receives the answers to a Zenoh query on the event loop, and payloads that are kept."""

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress

import zenoh
from zenoh.handlers import Callback

from app.dialect.latched import newest

COPIED_MOST = 16_384  # bytes of a sample
CACHE_TIMEOUT_S = 10.0
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

    ask(Callback(on_reply, on_end, indirect=False))
    with suppress(TimeoutError):
        # Not `wait_for`: that of Python 3.11 loses a cancel that comes with the end.
        async with asyncio.timeout(timeout_s + 1):
            await done
    return answers, time.monotonic() < end


def first_answer(ask: Ask) -> "asyncio.Future[bytes | None]":
    """The payload of the first answer, None if there is none."""
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
            hand_over(reply.ok.payload.to_bytes())

    ask(Callback(on_reply, lambda: hand_over(None), indirect=False))
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
