"""The last minute as an MCAP file, for Foxglove and rosbag2."""

from datetime import UTC, datetime
from typing import Annotated, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import Response

from app.errors import NotFound
from app.i18n import say
from app.web.app_state import CurrentState
from app.web.openapi_parts import errors

router = APIRouter()

MCAP: Final = "application/octet-stream"  # it has no media type of its own


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
