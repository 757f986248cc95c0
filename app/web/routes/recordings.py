"""MCAP files for Foxglove and rosbag2: the last minute, downloaded or shared with Foxglove, and those
that are kept."""

import asyncio
from datetime import UTC, datetime
from typing import Annotated, Final

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import FileResponse, Response

from app.system.errors import NotFound
from app.system.texts import say
from app.web.app_state import CurrentState
from app.web.downloads import MCAP, SharedFile
from app.web.requests import errors

router = APIRouter()

FOXGLOVE: Final = "https://app.foxglove.dev"
CORS: Final = {
    "access-control-allow-origin": FOXGLOVE,
    "access-control-expose-headers": "Accept-Ranges, Content-Length, Content-Range, ETag",
    "cache-control": "no-store",
    "content-encoding": "identity",  # ranges are those of the file
    "referrer-policy": "no-referrer",
}
PREFLIGHT: Final = {
    "access-control-allow-methods": "GET, HEAD",
    "access-control-allow-headers": "Range, If-Range, Cache-Control",
    # A page of the internet asks for a file in the plant's network (Private Network Access).
    "access-control-allow-private-network": "true",
    "access-control-max-age": "600",
}
FILE: Final = {"schema": {"type": "string", "format": "binary"}}
# As `recording_name` has it.
NAME: Final = r"^[0-9]{8}T[0-9]{6}\.[0-9]{3}Z(-[A-Za-z0-9_-]{1,200})?(\.recovered)?$"
Name = Annotated[str, Path(max_length=240, pattern=NAME)]
Token = Annotated[str, Path(min_length=20, max_length=64, pattern=r"^[A-Za-z0-9_-]+$")]


@router.get(
    "/recordings/last.mcap",
    response_class=Response,
    summary="What was received in the last minute, as an MCAP file",
    responses=errors(403, 404, 422)
    | {200: {"content": {MCAP: {"schema": {"type": "string", "format": "binary"}}}}},
)
async def last_minute(
    request: Request, state: CurrentState, robot: Annotated[str, Query(max_length=64)] = ""
) -> Response:
    """404 on a panel without `[record]`."""
    session = state.fleet.of_robot(robot)
    recorder = session.commands.recorder
    if recorder is None:
        raise NotFound(say("recording_off"))
    content = await recorder.last_minute()
    parts = (datetime.now(UTC).strftime("%Y%m%dT%H%M%SZ"), robot, "last-minute")
    name = "-".join(filter(None, parts))
    headers = {
        "content-disposition": f'attachment; filename="{name}.mcap"',
        "cache-control": "no-store",
        "content-encoding": "identity",  # it is packed already
    }
    return Response(content, media_type=MCAP, headers=headers)


@router.get(
    "/recordings/{name}.mcap",
    response_class=Response,
    summary="A recording around a press or a stop",
    responses=errors(403, 404, 422)
    | {
        200: {"content": {MCAP: FILE}, "description": "the whole file"},
        206: {"content": {MCAP: FILE}, "description": "the ranges of `Range`"},
        416: {"description": "the file has nothing of the range"},
    },
)
async def kept_recording(state: CurrentState, name: Name) -> Response:
    """404 for one that is removed, or not finished yet."""
    folder = state.fleet.recordings_folder
    file = folder / f"{name}.mcap" if folder else None
    if file is None or not await asyncio.to_thread(lambda: file.is_file() and not file.is_symlink()):
        raise NotFound(say("recording_gone"))
    headers = {"cache-control": "no-store", "content-encoding": "identity"}
    return FileResponse(file, media_type=MCAP, filename=file.name, headers=headers)


@router.get(
    "/recordings/shared/{token}.mcap",
    response_class=Response,
    summary="A recording that was shared with Foxglove, until it ends",
    responses=errors(404)
    | {
        200: {"content": {MCAP: FILE}, "description": "the whole file"},
        206: {"content": {MCAP: FILE}, "description": "the ranges of `Range`"},
        400: {"description": "`Range` has none"},
        416: {"description": "the file has nothing of the range"},
    },
)
async def shared_recording(state: CurrentState, token: Token) -> Response:
    """The token in the path permits it: Foxglove has no cookie of this panel."""
    recording = state.shared.by_token(token)
    if recording is None:
        raise NotFound(say("shared_recording_ended"))
    return SharedFile(recording, CORS)


@router.options("/recordings/shared/{token}.mcap", include_in_schema=False)
async def shared_recording_preflight(token: Token) -> Response:
    """What a browser asks before Foxglove reads; it tells nothing of the token."""
    return Response(status_code=204, headers=CORS | PREFLIGHT)
