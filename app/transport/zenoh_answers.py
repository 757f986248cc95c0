"""The answers to a Zenoh query, collected on the event loop."""

import asyncio
from collections.abc import Callable
from contextlib import suppress

import zenoh
from zenoh.handlers import Callback


async def collected(
    ask: Callable[["Callback[zenoh.Reply]"], None], timeout_s: float
) -> list[tuple[str, bytes]]:
    """(key, payload) of each answer that comes within `timeout_s`."""
    loop = asyncio.get_running_loop()
    done: asyncio.Future[None] = loop.create_future()
    answers: list[tuple[str, bytes]] = []

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
        await asyncio.wait_for(done, timeout_s + 1)
    return answers
