"""Requests begin in turn, and no request that goes away keeps the others from theirs."""

import asyncio

from starlette.types import Message, Receive, Scope, Send

from app.web.turns import Turns

KIOSK = "127.0.0.1"


def scope_of(path: str, client: str = KIOSK, method: str = "GET") -> Scope:
    return {"type": "http", "method": method, "path": path, "headers": [], "client": (client, 1)}


async def nothing() -> Message:
    return {"type": "http.request"}


async def unsent(_: Message) -> None:
    raise AssertionError("nothing is answered")


class Handled:
    """An application that notes the requests that begin."""

    def __init__(self) -> None:
        self.paths: list[str] = []
        self.turns = Turns(self)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self.paths.append(scope["path"])

    def ask(self, scope: Scope) -> "asyncio.Task[None]":
        return asyncio.ensure_future(self.turns(scope, nothing, unsent))


def test_presses_and_the_kiosk_are_served_before_other_readers() -> None:
    async def serve() -> list[str]:
        handled = Handled()
        other = "192.0.2.1"
        requests = [
            handled.ask(scope_of("/first", other)),
            handled.ask(scope_of("/page", other)),
            handled.ask(scope_of("/kiosk")),
            handled.ask(scope_of("/press", other, "POST")),
        ]
        await asyncio.wait_for(asyncio.gather(*requests), 10)
        return handled.paths

    assert asyncio.run(serve()) == ["/first", "/press", "/kiosk", "/page"]


def test_a_request_that_was_cancelled_keeps_no_other_from_its_turn() -> None:
    async def serve() -> list[str]:
        handled = Handled()
        requests = [handled.ask(scope_of(f"/{number}")) for number in range(4)]
        await asyncio.sleep(0)
        requests[1].cancel()
        await asyncio.wait_for(asyncio.gather(*requests, return_exceptions=True), 10)
        await asyncio.wait_for(handled.ask(scope_of("/later")), 10)
        return handled.paths

    assert asyncio.run(serve()) == ["/0", "/2", "/3", "/later"]
