"""A raw event stream: the minimal cost of Zenoh, one hop between threads, and Chromium."""

import asyncio
import os
from collections.abc import AsyncIterator
from pathlib import Path

import zenoh
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Route

config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", f'["{os.environ["BENCH_ROUTER"]}"]')
config.insert_json5("transport/shared_memory/enabled", "false")  # it would leave files behind
session = zenoh.open(config)


async def events(request: Request) -> Response:
    loop, queue = asyncio.get_running_loop(), asyncio.Queue[bytes]()

    def came(sample: zenoh.Sample) -> None:
        event = b"data: %d\n\n" % sample.payload.to_bytes()[4]
        loop.call_soon_threadsafe(queue.put_nowait, event)

    async def stream() -> AsyncIterator[bytes]:
        on_zenohs_thread = zenoh.handlers.Callback(came, indirect=False)
        with session.declare_subscriber("operation_enabled", on_zenohs_thread):
            while True:
                yield await queue.get()

    return StreamingResponse(stream(), media_type="text/event-stream")


async def page(request: Request) -> Response:
    return FileResponse(Path(__file__).with_name("page.html"))


app = Starlette(routes=[Route("/", page), Route("/events", events)])
