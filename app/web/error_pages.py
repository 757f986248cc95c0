"""Answers for errors: a page for a browser, JSON for a program."""

import traceback
from collections.abc import Callable
from typing import Any, Final

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from app.errors import KioskError, RoleNeeded, TooMany, TooSlow
from app.i18n import TextLike, render, say
from app.printable import printable
from app.web.app_state import site_of
from app.web.language import language_of
from app.web.rendering.display_choice import display_of

TRY_AGAIN: Final = {"refresh": "1"}  # seconds


def error_answer(request: Request, status: int, message: TextLike, sign_in: bool = False) -> Response:
    """An error for whom it is: a page for who reads pages, JSON for programs. `sign_in`: the page leads
    to the sign-in."""
    site, language = site_of(request), language_of(request)
    if "text/html" not in request.headers.get("accept", ""):
        return JSONResponse({"error": render(message, language)}, status_code=status)
    panel = site.fleet.panel
    display = display_of(request, panel)
    context = {"site": site, "panel": panel, "display": display, "status": status, "message": message}
    context["sign_in"] = say("signin_sign_in") if sign_in else ""
    html = site.templates.render("error.html", language, **context)
    return HTMLResponse(html, status_code=status, headers={"cache-control": "no-store"})


async def on_kiosk_error(request: Request, error: Exception) -> Response:
    status = error.status if isinstance(error, KioskError) else 500
    message = error.text if isinstance(error, KioskError) else str(error)
    answer = error_answer(request, status, message, isinstance(error, RoleNeeded))
    if isinstance(error, TooSlow):
        answer.headers["connection"] = "close"  # no client waits for the rest
    if isinstance(error, TooMany):
        answer.headers["retry-after"] = str(error.retry_after_s)
    return answer


async def on_invalid(request: Request, error: Exception) -> Response:
    """A path or a query that is not what the description says: the first fault, with its place."""
    if not isinstance(error, RequestValidationError):
        raise error
    first = error.errors()[0]
    where = ".".join(str(step) for step in first["loc"][1:])
    return error_answer(request, 422, f"{where}: {first['msg']}")


async def on_gone(request: Request, error: Exception) -> Response:
    """For a client that dropped the connection before its request was complete: no one reads this."""
    return Response(status_code=400)


async def on_http_error(request: Request, error: Exception) -> Response:
    """Starlette's own: no such path, wrong method, body too large."""
    if not isinstance(error, HTTPException):
        raise error
    code = "path_missing" if error.status_code == 404 else "path_method_not_allowed"
    message = say(code, path=printable(request.url.path)[:200])
    answer = error_answer(request, error.status_code, message)
    answer.headers.update(error.headers or {})
    if answer.headers.get("allow") == "GET":
        answer.headers["allow"] = "GET, HEAD"
    return answer


async def on_error_in_development(request: Request, error: Exception) -> Response:
    """The traceback; the browser requests the page again until the fault is mended."""
    text = "".join(traceback.format_exception(error))
    return PlainTextResponse(text, 500, headers=TRY_AGAIN if request.method == "GET" else None)


HANDLERS: Final[dict[int | type[Exception], Callable[..., Any]]] = {
    KioskError: on_kiosk_error,
    HTTPException: on_http_error,
    ClientDisconnect: on_gone,
    RequestValidationError: on_invalid,
}
