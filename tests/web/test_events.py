"""One event stream, with the server's ends of it in the hands of the test."""

import asyncio
import json
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from typing import Any

import pytest
from starlette.responses import Response
from starlette.types import Message, Receive, Scope, Send

from app.cell.robot.state import RobotState
from app.cell.view.publisher import ViewPublisher
from app.cell.view.view import View, build_view
from app.web.asgi import Application, KeepServerSend, server_send
from app.web.metrics import Open
from app.web.routes.events import EventStream
from tests.support.builders import NOW, permits, robot_there, says, small_panel
from tests.support.parts import events_in
from tests.support.words import english

pytestmark = pytest.mark.promise("reconnect")

PANEL = small_panel()
SCOPE: dict[str, Any] = {"type": "http"}


def view_of(robot: RobotState) -> View:
    return build_view(PANEL, robot, NOW).view


class Client:
    """The server's side of one browser: takes what is sent while it reads, and says when it goes."""

    def __init__(self) -> None:
        self.got: list[Message] = []
        self.sending = 0
        self._reads = asyncio.Event()
        self._reads.set()
        self._gone = asyncio.Event()

    def read(self, on: bool) -> None:
        (self._reads.set if on else self._reads.clear)()

    def go(self) -> None:
        self._gone.set()

    async def send(self, message: Message) -> None:
        self.sending += 1
        await self._reads.wait()
        self.got.append(message)
        if not message.get("more_body", True):
            self._gone.set()  # as servers do

    async def receive(self) -> Message:
        await self._gone.wait()
        return {"type": "http.disconnect"}

    def events(self, *names: str) -> list[Any]:
        """The data of the events that came under these names."""
        text = b"".join(message.get("body", b"") for message in self.got).decode()
        return [json.loads(data) for name, data, _ in events_in(text) if name in names]


class Bench:
    """A publisher with its streams."""

    def __init__(self) -> None:
        self.robot = robot_there(PANEL)
        self.publisher = ViewPublisher(view_of(self.robot), "r1")
        self.streams = Open()

    @property
    def open(self) -> int:
        return self.streams.count

    def says(self, text: str) -> None:
        says(self.robot, "/heard", text)
        self.publisher.post(view_of(self.robot))

    @asynccontextmanager
    async def stream(self) -> AsyncIterator[tuple[Client, "asyncio.Task[None]"]]:
        client = Client()
        answer = EventStream(self.publisher, b"", self.streams)
        task = asyncio.create_task(answer(SCOPE, client.receive, client.send))
        await turns()
        try:
            yield client, task
        finally:
            client.go()
            with suppress(ExceptionGroup):
                await task


async def turns() -> None:
    """All that can go on goes on."""
    for _ in range(10):
        await asyncio.sleep(0)


def run(work: Callable[[], Awaitable[None]]) -> None:
    async def whole() -> None:
        async with asyncio.timeout(20):
            await work()

    asyncio.run(whole())


def test_stream_begins_with_a_snapshot_and_a_heartbeat_then_changes() -> None:
    async def work() -> None:
        bench = Bench()
        async with bench.stream() as (client, _):
            start, first = client.got
            assert (start["status"], first["more_body"]) == (200, True)
            assert [name for name, _, _ in events_in(first["body"].decode())] == ["snapshot", "beat"]
            bench.says("one")
            await turns()
            assert client.events("update") == [
                {"heard": english(bench.publisher.view["widgets"]["heard"])}
            ]

    run(work)


def test_slow_reader_costs_one_event_and_then_gets_the_newest() -> None:
    async def work() -> None:
        bench = Bench()
        async with bench.stream() as (client, _), bench.stream() as (other, _):
            client.read(False)
            bench.says("first")
            await turns()
            sending, received = client.sending, len(other.got)
            for number in range(1000):
                bench.says(str(number))
                await asyncio.sleep(0)
            await turns()
            assert client.sending == sending
            assert len(other.got) > received  # no one else waits for it
            assert len(bench.publisher._prepared) <= 2
            client.read(True)
            await turns()
            texts = [update["heard"]["text"] for update in client.events("update")]
            assert texts == ["first", "999"]

    run(work)


def test_a_permission_is_sent_in_the_same_turn_to_all() -> None:
    async def work() -> None:
        bench = Bench()
        async with bench.stream() as (stream, _), bench.stream() as (other, _):
            permits(bench.robot)
            bench.publisher.post(view_of(bench.robot))
            await turns()
            for client in (stream, other):
                assert client.events("operation-enabled-updated") == [{"enabled": True, "reason": None}]
            assert stream.got[-1]["body"] is other.got[-1]["body"]

    run(work)


def test_a_browser_that_goes_leaves_nothing_behind() -> None:
    async def work() -> None:
        bench = Bench()
        async with bench.stream() as (client, task):
            assert bench.open == 1
            client.read(False)
            bench.says("no client reads this")
            await turns()
            client.go()
            await task
            assert bench.open == 0
            assert asyncio.all_tasks() == {asyncio.current_task()}
            assert bench.publisher.heartbeat._timer is None

    run(work)


def test_end_of_the_publisher_ends_the_stream() -> None:
    async def work() -> None:
        bench = Bench()
        async with bench.stream() as (client, task):
            bench.publisher.close()
            await task
            assert client.got[-1] == {"type": "http.response.body", "body": b"", "more_body": False}

    run(work)


def test_failed_stream_ends_and_is_logged(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> bytes:
        raise ValueError("no")

    async def work() -> None:
        bench = Bench()
        async with bench.stream() as (_, task):
            monkeypatch.setattr(bench.publisher, "events_since", fail)
            bench.says("one")
            with pytest.raises(ExceptionGroup, match="TaskGroup"):
                await task
            assert bench.open == 0

    run(work)


def test_streams_body_bypasses_the_middleware_and_its_head_passes_it() -> None:
    async def work() -> None:
        bench = Bench()
        client = Client()
        through: list[str] = []

        async def layer(scope: Scope, receive: Receive, send: Send) -> None:
            async def wrapped(message: Message) -> None:
                through.append(message["type"])
                await send(message)

            await EventStream(bench.publisher, b"", bench.streams)(scope, receive, wrapped)

        scope = dict(SCOPE)
        task = asyncio.create_task(KeepServerSend(layer)(scope, client.receive, client.send))
        await turns()
        bench.publisher.close()
        await task
        assert through == ["http.response.start"]
        assert len(client.events("snapshot")) == 1
        assert scope == SCOPE

    run(work)


def test_none_of_the_applications_own_layers_is_between_a_body_and_the_server() -> None:
    async def work() -> None:
        sends: list[Send] = []

        class Asking(Response):
            async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
                sends.extend((server_send(scope, send), send))
                await super().__call__(scope, receive, send)

        app = Application(max_body_size=1000)
        app.add_route("/", lambda _: Asking())
        client = Client()
        scope = {"type": "http", "method": "GET", "path": "/", "query_string": b"", "headers": []}
        server = client.send
        await app(scope, client.receive, server)
        own, wrapped = sends
        assert own is server
        assert wrapped is not server
        assert client.got[0]["status"] == 200

    run(work)
