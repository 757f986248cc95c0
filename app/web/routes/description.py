"""`/openapi.json`, which is made once, at the first request, beside the event loop: it takes long."""

import gzip
import json
from typing import Final

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import Response

from app.system.concurrency import BuiltOnce
from app.web.app_state import CurrentState

router = APIRouter()

PACKING: Final = 6  # of gzip


@router.get("/openapi.json", include_in_schema=False)
async def description(request: Request, state: CurrentState) -> Response:
    """The description of all paths, with the path below which a proxy shows them."""
    if state.description is None:
        state.description = BuiltOnce(lambda: _describe(request.app, state.root))
    plain, packed = await state.description.value()
    headers = {"vary": "accept-encoding"}
    if "gzip" not in request.headers.get("accept-encoding", ""):
        return Response(plain, media_type="application/json", headers=headers)
    headers["content-encoding"] = "gzip"
    return Response(packed, media_type="application/json", headers=headers)


def _describe(app: FastAPI, root: str) -> tuple[bytes, bytes]:
    """As JSON, and packed by gzip."""
    servers = {"servers": [{"url": root}]} if root else {}
    content = json.dumps(servers | app.openapi(), ensure_ascii=False, separators=(",", ":")).encode()
    return content, gzip.compress(content, PACKING)
