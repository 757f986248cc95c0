"""All routes of the application but the gallery, which `main` adds in development."""

from typing import Final

from fastapi import Depends, FastAPI

from app.web.app_state import named_robot
from app.web.path_methods import PathMethods
from app.web.requests import errors
from app.web.route_needs import ROBOT
from app.web.routes import (
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
    holds,
    lock_help,
    pages,
    parameters,
    presses,
    recipes,
    recordings,
    sign_in,
    static,
    users,
    widget_data,
)
from app.web.routes import audit_log as log_routes

# With several robots, their paths stand below that of each.
ROBOT_ROUTES: Final = (
    pages,
    events,
    presses,
    confirm,
    control,
    holds,
    parameters,
    frames,
    widget_data,
    lock_help,
    recipes,
)
ALARM_ROUTES: Final = (alarms, alarm_history, alarm_report)
OTHER_ROUTES: Final = (
    diagnostics,
    recordings,
    help,
    sign_in,
    users,
    static,
    health,
    display,
    description,
)


def add_routes(app: FastAPI) -> None:
    """FastAPI builds a router's routes when the first request comes to it. Those of several robots are
    last: no page of a panel with one robot requests them. The others are built by the first health
    check, so that the first page does not wait for it."""
    methods = app.state.path_methods = PathMethods()
    for routes in (*ROBOT_ROUTES, *ALARM_ROUTES, *OTHER_ROUTES):
        app.include_router(routes.router)
        methods.add(routes.router.routes)
    app.include_router(log_routes.router, responses=errors(403, 404, 422, 503))
    methods.add(log_routes.router.routes)
    for routes in ROBOT_ROUTES:
        app.include_router(routes.router, prefix=ROBOT, dependencies=[Depends(named_robot)])
        methods.add(routes.router.routes, ROBOT)
