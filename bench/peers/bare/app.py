"""A page by FastAPI and Jinja, a press by a POST and a put, subscribers whose callback does nothing."""

import json
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import zenoh
from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse
from jinja2 import Environment, FileSystemLoader
from pydantic import BaseModel

TOPICS = json.loads(os.environ.get("BENCH_TOPICS", "[]"))
VALUES: dict[str, Any] = {"Speed": 0.0, "Ready": False}
pages = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True)


class Press(BaseModel):
    id: str = ""
    inputs: dict[str, Any] = {}


@asynccontextmanager
async def lifespan(app: FastAPI) -> AsyncIterator[None]:
    config = zenoh.Config.from_file(os.environ["KIOSK_ZENOH"])
    config.insert_json5("transport/shared_memory/enabled", "false")  # it would leave files behind
    with zenoh.open(config) as session:
        app.state.start = session.declare_publisher("operation1")
        receive: Any = zenoh.handlers.Callback(lambda sample: None, indirect=False)
        kept = [session.declare_subscriber(topic, receive) for topic in TOPICS]
        yield
        del kept


app = FastAPI(lifespan=lifespan)


@app.get("/", response_class=HTMLResponse)
async def page(request: Request) -> HTMLResponse:
    return HTMLResponse(pages.get_template("page.html").render(title="Robot cell 1", values=VALUES))


@app.post("/press")
async def press(press: Press, request: Request) -> dict[str, str]:
    request.app.state.start.put(b"\x00\x01\x00\x00\x03\x00\x00\x00go\x00")
    return {"id": press.id, "outcome": "published"}
