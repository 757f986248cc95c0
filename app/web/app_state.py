"""What the routes share: the application's state, typed, and answers for errors."""

from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Path, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, Response
from jinja2 import Environment
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection

from app.audit import OperatorLog, Unlogged
from app.commands.press_limits import PressLimits
from app.concurrency import Owed
from app.errors import KioskError, TooMany, TooSlow
from app.permission.clients import Browsers
from app.printable import printable
from app.runtime.fleet import Fleet
from app.runtime.robot_session import Kiosk
from app.web.assets import Assets
from app.web.metrics import Metrics


@dataclass(slots=True)
class Site:
    """All that a request needs; in development `fleet` and `assets` are replaced together."""

    fleet: Fleet
    assets: Assets
    templates: Environment
    metrics: Metrics
    dev: bool
    log: OperatorLog | Unlogged
    limits: PressLimits
    browsers: Browsers = field(default_factory=Browsers)
    owed: Owed = field(default_factory=Owed)

    @property
    def banner(self) -> str:
        """What stands above a page of no robot: that one is simulated."""
        banners = (kiosk.board.view["notice"]["banner"] for kiosk in self.fleet.kiosks)
        return next(filter(None, banners), "")


def site_of(request: HTTPConnection) -> Site:
    site: Site = request.app.state.site
    return site


async def _current(request: HTTPConnection) -> Site:
    return site_of(request)  # not itself the dependency: plain functions run on a thread


CurrentSite = Annotated[Site, Depends(_current)]


async def _of_robot(request: HTTPConnection) -> Kiosk:
    return site_of(request).fleet.kiosk(request.path_params.get("robot"))


CurrentKiosk = Annotated[Kiosk, Depends(_of_robot)]


async def named_robot(robot: Annotated[str, Path(description="The id of a [[robot]]")]) -> None:
    """What every path of one of several robots has in it."""


def error_answer(request: Request, status: int, message: str) -> Response:
    """An error for whom it is: a page for who reads pages, JSON for programs."""
    site = site_of(request)
    if "text/html" not in request.headers.get("accept", ""):
        return JSONResponse({"error": message}, status_code=status)
    context = {"site": site, "panel": site.fleet.panel, "status": status, "message": message}
    html = site.templates.get_template("error.html").render(**context)
    return HTMLResponse(html, status_code=status, headers={"cache-control": "no-store"})


async def on_kiosk_error(request: Request, error: Exception) -> Response:
    status = error.status if isinstance(error, KioskError) else 500
    answer = error_answer(request, status, str(error))
    if isinstance(error, TooSlow):
        answer.headers["connection"] = "close"  # nobody waits for the rest
    if isinstance(error, TooMany):
        answer.headers["retry-after"] = str(error.again_s)
    return answer


async def on_invalid(request: Request, error: Exception) -> Response:
    """A path or a query that is not what the description says: the first fault, with its place."""
    if not isinstance(error, RequestValidationError):
        raise error
    first = error.errors()[0]
    where = ".".join(str(step) for step in first["loc"][1:])
    return error_answer(request, 422, f"{where}: {first['msg']}")


async def on_gone(request: Request, error: Exception) -> Response:
    """Of who dropped the connection before the request was whole: nobody reads this."""
    return Response(status_code=400)


async def on_http_error(request: Request, error: Exception) -> Response:
    """Starlette's own: no such path, wrong method, body too large."""
    if not isinstance(error, HTTPException):
        raise error
    message = printable(f"{error.detail}: {request.url.path}")
    answer = error_answer(request, error.status_code, message)
    answer.headers.update(error.headers or {})
    return answer
