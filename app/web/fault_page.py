"""In development: the faults of a panel file as a page, in place of the panel.

The server starts again when a file is saved (`uvicorn --reload`); the page requests itself until the
panel is there.
"""

import html
import logging
from collections.abc import Iterable
from typing import Final

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse, JSONResponse, Response

from app.system.printable import printable
from app.web.error_pages import TRY_AGAIN
from app.web.security import RequestGuard

log = logging.getLogger("kiosk.development")

# An open page of the panel loads again when a snapshot has another revision than its own.
NO_PANEL: Final = 'event: snapshot\ndata: {"revision": ""}\n\n'
NOT_KEPT: Final = {"cache-control": "no-store"}


def fault_page(fault: str, hosts: Iterable[str]) -> FastAPI:
    """An application that answers every page with `fault`, whose first line is its heading."""
    log.error("%s", fault)
    title, *lines = map(printable, fault.splitlines())
    page = _page(title, lines)

    async def answer(request: Request) -> Response:
        path = request.url.path
        if path == "/healthz":
            return JSONResponse({"status": "ok"})
        if path.endswith("/events"):
            return Response(NO_PANEL, media_type="text/event-stream", headers=NOT_KEPT)
        return HTMLResponse(page, status_code=503, headers=NOT_KEPT | TRY_AGAIN)

    app = FastAPI(openapi_url=None)
    app.add_route("/{path:path}", answer)
    app.add_middleware(RequestGuard, hosts=hosts)
    return app


def _page(title: str, lines: Iterable[str]) -> str:
    items = "".join(f"<li>{html.escape(line.strip())}</li>" for line in lines)
    return (
        "<!doctype html><html lang=en><meta charset=utf-8><title>Panel file</title>"
        f"<h1>{html.escape(title)}</h1><ul>{items}</ul>"
        "<p>The panel is loaded as soon as the file is saved without a fault.</p>"
    )
