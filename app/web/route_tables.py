"""All routes of the application but the gallery, which `main` adds in development.

Those of a first page are there from the start. The modules of the others are imported at their first
use, beside the event loop: a panel without users or recipes never imports theirs.
"""

import asyncio
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from typing import Any, Final

from fastapi import Depends, FastAPI
from starlette.types import ASGIApp, Receive, Scope, Send

from app.panel import Panel
from app.web.app_state import named_robot
from app.web.path_methods import PathMethods
from app.web.requests import errors
from app.web.root_path import path_of
from app.web.route_needs import ROBOT

# The modules of `app.web.routes`.
FIRST: Final = ("pages", "events", "static", "health")
# Those of a wall: no path of it reaches a robot.
FIRST_OF_WALL: Final = ("wall", "events", "static", "health")
LATE_OF_WALL: Final = frozenset(
    {"help", "session", "sessions", "signin", "users", "log", "log.csv", "display"}
)
# The others, by the first segment of their paths.
LATE: Final[Mapping[str, tuple[str, ...]]] = {
    "widgets": (
        *("presses", "confirm", "holds", "parameters", "frames", "maps", "places", "widget_data"),
        "lock_help",
    ),
    "presses": ("presses",),
    "control": ("control",),
    "alarms": ("alarms", "alarm_history", "alarm_report"),
    "stops": ("stops",),
    "oee": ("oee",),
    "recipes": ("recipes",),
    "places": ("saved_places",),
    "diagnostics": ("diagnostics",),
    "recordings": ("recordings",),
    "help": ("help",),
    "session": ("sign_in",),
    "sessions": ("users",),
    "signin": ("sign_in",),
    "users": ("users",),
    "log": ("audit_log",),
    "log.csv": ("audit_log",),
    "display": ("display",),
    "panel": ("panel_file",),
    "openapi.json": ("description",),
}
DESCRIPTION: Final = "openapi.json"  # it describes all
# With several robots, their paths stand below that of each too.
ROBOT_ROUTES: Final = frozenset(
    {
        *("pages", "events", "presses", "confirm", "control", "holds", "parameters", "frames"),
        *("maps", "places", "widget_data", "lock_help", "recipes", "saved_places"),
    }
)
PAGE: Final = ("widgets", "presses", "control", "display", "help")  # what a page itself requests


class Routes:
    """The routes of an application, added module by module. FastAPI builds those of a router when the
    first request comes to it."""

    def __init__(self, app: FastAPI, is_wall: bool = False) -> None:
        self.methods = PathMethods()
        self._app = app
        self._added: set[str] = set()
        self._late = {k: v for k, v in LATE.items() if not is_wall or k in LATE_OF_WALL}
        self._add(FIRST_OF_WALL if is_wall else FIRST)

    async def load(self, segment: str) -> None:
        """Adds the routes whose paths begin with this segment; all of them, if it describes them."""
        names = all_modules() if segment == DESCRIPTION in self._late else self._late.get(segment, ())
        for name in names:
            if name not in self._added:
                await asyncio.to_thread(_module, name)
        self._add(names)

    def _add(self, names: Iterable[str]) -> None:
        for name in names:
            if name in self._added:
                continue
            self._added.add(name)
            module = _module(name)
            router = module.router
            for prefix in ("", ROBOT) if hasattr(module, "direct_routes") else ():
                self._app.router.routes[:0] = module.direct_routes(prefix)
            described = errors(403, 404, 422, 503) if name == "audit_log" else None
            self._app.include_router(router, responses=described)
            self.methods.add(router.routes)
            if name in ROBOT_ROUTES:
                self._app.include_router(router, prefix=ROBOT, dependencies=[Depends(named_robot)])
                self.methods.add(router.routes, ROBOT)


def add_routes(app: FastAPI, is_wall: bool = False) -> None:
    """The routes of a first page; the others come by `LateRoutes`."""
    routes = app.state.routes = Routes(app, is_wall)
    app.state.path_methods = routes.methods


async def load_used(app: FastAPI, panel: Panel) -> None:
    """Adds the routes that the pages of this panel use, so that no request waits for them."""
    routes: Routes = app.state.routes
    for segment in _used(panel):
        await routes.load(segment)


def _used(panel: Panel) -> Iterator[str]:
    yield from PAGE
    if panel.may_raise:
        yield "alarms"
    if panel.recipes:
        yield "recipes"
    if any(widget.save for widget in panel.place_inputs):
        yield "places"
    if panel.access.oidc is not None:
        yield "signin"


class LateRoutes:
    """An ASGI layer that adds the routes of a path before its first request."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket"):
            routes: Routes = scope["app"].state.routes
            await routes.load(first_segment(path_of(scope)))
        await self._app(scope, receive, send)


def first_segment(path: str) -> str:
    """Of a path, or of what stands below one of several robots."""
    segments = path.split("/")
    if segments[1:2] == ["robots"]:
        segments = segments[2:]
    return segments[1] if len(segments) > 1 else ""


def all_modules() -> tuple[str, ...]:
    """The names of all modules with routes, each once."""
    return tuple(dict.fromkeys((*FIRST, *(name for names in LATE.values() for name in names))))


def _module(name: str) -> Any:
    return import_module(f"app.web.routes.{name}")
