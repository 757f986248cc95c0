"""`/openapi.json`, which is made at the first request, beside the event loop: it takes long."""

import asyncio

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response

from app.web.app_state import CurrentState

router = APIRouter()


@router.get("/openapi.json", include_in_schema=False)
async def description(request: Request, state: CurrentState) -> Response:
    """The description of all paths, with the path below which a proxy shows them."""
    described = await asyncio.to_thread(request.app.openapi)
    servers = {"servers": [{"url": state.root}]} if state.root else {}
    return JSONResponse(servers | described)
