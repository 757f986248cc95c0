"""Styles and scripts, under a path that changes with their content."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from app.system.errors import NotFound
from app.web.app_state import CurrentState

router = APIRouter()


@router.get("/static/{revision}/{name:path}", include_in_schema=False)
async def static(revision: str, name: str, request: Request, state: CurrentState) -> Response:
    asset = state.assets.files.get(name)
    if asset is None:
        raise NotFound(f'there is no file "{name}"')
    fits = revision == state.assets.revision
    caching = "public, max-age=31536000, immutable" if fits else "no-store"
    headers = {"cache-control": caching}
    if not asset.packed or "gzip" not in request.headers.get("accept-encoding", ""):
        return Response(asset.content, media_type=asset.media_type, headers=headers)
    headers |= {"content-encoding": "gzip", "vary": "Accept-Encoding"}
    return Response(asset.packed, media_type=asset.media_type, headers=headers)
