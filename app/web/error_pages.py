"""Answers for errors: a page for a browser, JSON for a program."""

import logging
import traceback
from collections.abc import Callable
from typing import Any, Final

from fastapi import Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, PlainTextResponse, Response
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from app.system.errors import KioskError, RoleNeeded, TooMany, TooSlow
from app.system.printable import printable
from app.system.texts import TextLike, render, say
from app.web.app_state import site_of
from app.web.caller import caller_of
from app.web.pages.context import FramedPage, framed_page
from app.web.path_methods import methods_of
from app.web.security import SECURITY_HEADERS

log = logging.getLogger("kiosk.web")

TRY_AGAIN: Final = {"refresh": "1"}  # seconds


def error_answer(request: Request, status: int, message: TextLike, sign_in: bool = False) -> Response:
    """An error for whom it is: a page for who reads pages, in the frame with Stop, JSON for programs.
    `sign_in`: the page leads to the sign-in."""
    site, language = site_of(request), caller_of(request).language
    if not caller_of(request).accepts_html:
        return JSONResponse({"error": render(message, language)}, status_code=status)
    context = {"message": message, "status": status}
    context["sign_in"] = say("signin_sign_in") if sign_in else ""
    robot = request.path_params.get("robot", "")
    page = FramedPage(
        "error.html",
        say("page_failed_title"),
        "/",
        robot=robot if robot in {entry.id for entry in site.fleet.panel.robots} else "",
        status=status,
    )
    try:
        return framed_page(request, site, page, context)
    except Exception:
        log.exception("the page of an error can't be shown")
        return PlainTextResponse(render(message, language), status)


async def on_unexpected(request: Request, error: Exception) -> Response:
    """A fault of this program, which the server's log has. No other layer sees this answer."""
    answer = error_answer(request, 500, say("page_failed"))
    for name, value in SECURITY_HEADERS.items():
        answer.headers.setdefault(name, value)
    return answer


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
    if error.status_code == 405 and (methods := methods_of(request)):
        answer.headers["allow"] = ", ".join(sorted(methods))  # the router names the first route's only
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
    Exception: on_unexpected,
}
