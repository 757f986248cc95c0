"""The plain way: Zenoh's callback, `call_soon_threadsafe`, an event stream. Presses arrive by fetch or
by WebSocket and are put."""

import asyncio
import json
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import zenoh
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

CDR = b"\x00\x01\x00\x00"
last: dict[str, str] = {}
streams: set[asyncio.Queue[str]] = set()


@asynccontextmanager
async def zenoh_session(app: Starlette) -> AsyncIterator[None]:
    loop = asyncio.get_running_loop()

    def came(sample: zenoh.Sample) -> None:
        loop.call_soon_threadsafe(show, str(sample.key_expr), sample.payload.to_bytes())

    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([os.environ["BENCH_ROUTER"]]))
    config.insert_json5("transport/shared_memory/enabled", "false")  # it would leave files behind
    with zenoh.open(config) as session:
        for topic in ("/operation_enabled", *os.environ["BENCH_TOPICS"].split()):
            session.declare_subscriber(topic.removeprefix("/"), came)
        app.state.publisher = session.declare_publisher("operation1")
        yield


def show(key: str, cdr: bytes) -> None:
    value = bool(cdr[4]) if key == "operation_enabled" else text_of(cdr)
    last[key] = f"data: {json.dumps({'topic': '/' + key, 'value': value})}\n\n"
    for queue in streams:
        queue.put_nowait(last[key])


def text_of(cdr: bytes) -> str:
    length = int.from_bytes(cdr[4:8], "little")  # with the NUL at its end
    return cdr[8 : 7 + length].decode()


def publish(text: str) -> None:
    data = text.encode() + b"\0"
    app.state.publisher.put(CDR + len(data).to_bytes(4, "little") + data)


async def events(request: Request) -> Response:
    async def stream() -> AsyncIterator[str]:
        queue = asyncio.Queue[str]()
        for event in last.values():
            queue.put_nowait(event)
        streams.add(queue)
        try:
            while True:
                yield await queue.get()
        finally:
            streams.discard(queue)

    return StreamingResponse(stream(), media_type="text/event-stream")


async def press(request: Request) -> Response:
    publish((await request.json())["text"])
    return Response(status_code=204)


async def presses(socket: WebSocket) -> None:
    await socket.accept()
    async for text in socket.iter_text():
        publish(text)


async def page(request: Request) -> Response:
    return FileResponse(os.environ["BENCH_PAGE"])


async def script(request: Request) -> Response:
    return FileResponse(Path(__file__).with_name("page.js"))


routes = [
    Route("/", page),
    Route("/page.js", script),
    Route("/events", events),
    Route("/press", press, methods=["POST"]),
    WebSocketRoute("/presses", presses),
]
app = Starlette(routes=routes, lifespan=zenoh_session)
