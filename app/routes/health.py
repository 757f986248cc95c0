"""For who watches the kiosk: is it up, can commands reach the robot, how much of what."""

import asyncio

from fastapi import APIRouter
from fastapi.responses import JSONResponse, Response
from prometheus_client import CONTENT_TYPE_LATEST

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
    return Response(site.metrics.text(), media_type=CONTENT_TYPE_LATEST)
