"""In development: the faults of a panel file as a page, in place of the panel.

The server starts again when a file is saved (`uvicorn --reload`); the page requests itself until the
panel is there.
"""

import html
import logging
from collections.abc import Iterable
from typing import Final

from fastapi import FastAPI
from fastapi.responses import HTMLResponse, Response

from app.i18n import say
from app.printable import printable
from app.web.error_pages import TRY_AGAIN
from app.web.security import Doors

log = logging.getLogger("kiosk.development")

# An open page of the panel loads again when a snapshot has another revision than its own.
NO_PANEL: Final = 'event: snapshot\ndata: {"revision": ""}\n\n'


def fault_page(fault: str, hosts: Iterable[str]) -> FastAPI:
    """An application that answers every page with `fault`, whose first line is its heading."""
    log.error("%s", fault)
    title, *lines = map(printable, fault.splitlines())
    page = _page(title, lines)
    app = FastAPI(openapi_url=None)

    @app.get("/healthz")
    async def healthz() -> dict[str, str]:
        return {"status": "ok"}

    @app.get("/events")
    @app.get("/robots/{robot}/events")
    async def events() -> Response:
        return Response(NO_PANEL, media_type="text/event-stream", headers={"cache-control": "no-store"})

    @app.get("/{path:path}")
    async def every_page() -> Response:
        headers = {"cache-control": "no-store", **TRY_AGAIN}
        return HTMLResponse(page, status_code=503, headers=headers)

    app.add_middleware(Doors, hosts=hosts)
    return app


def _page(title: str, lines: Iterable[str]) -> str:
    items = "".join(f"<li>{html.escape(line.strip())}</li>" for line in lines)
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{say('fault_page')}</title>"
        f"<h1>{html.escape(title)}</h1><ul>{items}</ul><p>{say('fault_page_waits')}</p>"
    )
