"""For who watches the kiosk: is it up, can commands reach the robot, how much of what."""

import asyncio
from collections.abc import Callable

from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response

from app.metrics import Metrics
from app.routes.site import CurrentSite

router = APIRouter()


@router.get("/healthz", summary="200 while the process serves")
async def healthz() -> dict[str, str]:
    return {"status": "ok"}


@router.get("/readyz", summary="200 while commands can reach every robot, else 503 with the reason")
async def readyz(site: CurrentSite) -> Response:
    kiosks = site.fleet.kiosks
    ways = await asyncio.gather(*(kiosk.way_asked() for kiosk in kiosks))
    way = next((way for way in ways if not way.permitted), None)
    if way is None:
        return JSONResponse({"status": "ready"})
    body: dict[str, object] = {"status": "not ready", "code": way.code, "reason": way.reason}
    robots = {k.entry.id: w.code for k, w in zip(kiosks, ways, strict=True) if k.entry}
    return JSONResponse(body | ({"robots": robots} if robots else {}), status_code=503)


@router.get("/metrics", summary="Prometheus text format")
async def metrics(site: CurrentSite) -> Response:
    exposition = await asyncio.to_thread(_exposition)
    text, media_type = exposition(site.metrics)
    return Response(text, media_type=media_type)


def _exposition() -> Callable[[Metrics], tuple[bytes, str]]:
    """Read when it is first asked for, on a thread: it takes a while, and most kiosks never need it."""
    from app.exposition import exposition

    return exposition
