"""Opens a Zenoh session, as a peer or as a client."""

import asyncio
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from typing import TypeVar

import zenoh
from zenoh.handlers import Callback

from app.transport.zenoh_config import translated

Result = TypeVar("Result")

HISTORY_S = 0.15  # in which a router sends the tokens that it has
CLIENT_WITHIN_MS = 500  # to connect, of all endpoints together


def open_session(config: zenoh.Config, as_client: bool) -> tuple[zenoh.Session, bool]:
    """(session, whether it is as it was wished). LinkError if none can be opened.

    A client can only be opened where something answers. Else a peer waits for that: once it is
    connected, a client can be opened in its place.
    """
    with translated("the Zenoh session can't be opened"):
        if as_client:
            try:
                return zenoh.open(_client(config)), True
            except zenoh.ZError:
                return zenoh.open(config), False
        return zenoh.open(config), True


def _client(config: zenoh.Config) -> zenoh.Config:
    """It stamps what it sends, as rmw_zenoh's nodes do: the stamp says whose a message is."""
    client = zenoh.Config.from_json5(str(config))
    for place, value in {
        "mode": '"client"',
        "listen/endpoints": "[]",
        "connect/timeout_ms": str(CLIENT_WITHIN_MS),
        "connect/exit_on_failure": "true",
        "timestamping/enabled": "true",
    }.items():
        client.insert_json5(place, value)
    return client


def tokens_for_clients(config: zenoh.Config, expressions: Collection[str]) -> list[str]:
    """The liveliness tokens that a client of the same router sees now; none if it can't be opened.
    Blocks for `HISTORY_S` after it is open. Not by queries: a second one of a session may end early."""
    seen: set[str] = set()

    def see(sample: zenoh.Sample) -> None:
        seen.add(str(sample.key_expr))

    try:
        with zenoh.open(_client(config)) as session:
            declare = session.liveliness().declare_subscriber
            held = [declare(each, Callback(see, indirect=False), history=True) for each in expressions]
            Event().wait(HISTORY_S)  # which a clock that is set does not disturb
            del held
    except zenoh.ZError:
        return []
    return sorted(seen)


async def in_own_thread(work: Callable[[], Result]) -> Result:
    """What blocks, in a thread that nothing else waits for: those of the event loop may all be busy."""
    executor = ThreadPoolExecutor(1, "zenoh-look")
    try:
        return await asyncio.get_running_loop().run_in_executor(executor, work)
    finally:
        executor.shutdown(wait=False)
