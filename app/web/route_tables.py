"""All routes of the application."""

import logging
from importlib.util import find_spec
from typing import Final

from fastapi import Depends, FastAPI

from app.web.app_state import named_robot
from app.web.openapi_parts import errors
from app.web.routes import (
    alarm_confirm,
    alarm_history,
    alarm_report,
    alarms,
    confirm,
    control,
    description,
    diagnostics,
    display,
    events,
    frames,
    health,
    help,
    hold_socket,
    lock_help,
    log_lines,
    oidc,
    pages,
    parameters,
    press_socket,
    presses,
    recipe_confirm,
    recipes,
    recordings,
    session,
    signin,
    static,
    trends,
    users,
)
from app.web.routes import audit_log as log_routes

log = logging.getLogger("kiosk")

# With several robots, their paths stand below that of each.
ROBOT_ROUTES: Final = (
    pages,
    events,
    presses,
    press_socket,
    confirm,
    control,
    hold_socket,
    parameters,
    frames,
    log_lines,
    lock_help,
    trends,
    recipe_confirm,
    recipes,
)
ALARM_ROUTES: Final = (alarms, alarm_confirm, alarm_history, alarm_report)
OTHER_ROUTES: Final = (
    diagnostics,
    recordings,
    help,
    session,
    signin,
    oidc,
    users,
    static,
    health,
    display,
    description,
)


def add_routes(app: FastAPI, dev: bool) -> None:
    """FastAPI builds a router's routes when the first request comes to it. Those of several robots are
    last: no page of a panel with one robot requests them. The others are built by the first health
    check, so that the first page does not wait for it."""
    for routes in (*ROBOT_ROUTES, *ALARM_ROUTES, *OTHER_ROUTES):
        app.include_router(routes.router)
    if dev:
        _add_gallery(app)
    app.include_router(log_routes.router, responses=errors(403, 404, 422, 503))
    for routes in ROBOT_ROUTES:
        app.include_router(routes.router, prefix="/robots/{robot}", dependencies=[Depends(named_robot)])


def _add_gallery(app: FastAPI) -> None:
    """The gallery is a part of the checkout only, not of the installed package."""
    if find_spec("app.web.routes.gallery") is None:
        log.info("/gallery is not in the installed package: `make dev` in a checkout has it")
        return
    from app.web.routes import gallery

    app.include_router(gallery.router)
