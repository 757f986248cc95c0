"""The application that serves a panel: its layers, its routes and the files of its pages. `app.main`
runs it as a server; the editor previews pages with it."""

import secrets
from collections.abc import Callable, Collection
from contextlib import AbstractAsyncContextManager
from typing import TYPE_CHECKING, Final

from fastapi import Depends, FastAPI
from starlette.middleware.gzip import GZipMiddleware

from app.cell.commands.judge import PressLimits
from app.cell.people.access import Access
from app.cell.session.doctor_process import DoctorProcess
from app.cell.session.fleet import Fleet
from app.panel import Panel
from app.panel.checks.look import page_parts
from app.panel.rules import EmbedRules
from app.panel.widgets.kinds import KINDS
from app.records import NullLog, OperatorLog
from app.system.settings import Settings, shipped_path
from app.web.app_state import AppState
from app.web.asgi import Application, ReadableStartupErrors
from app.web.assets import Assets, load_assets, require_files
from app.web.caller import LanguageHeaders
from app.web.error_pages import HANDLERS, on_error_in_development
from app.web.metrics import Metrics
from app.web.pages.compiled_templates import COMPILED
from app.web.pages.page_templates import PageTemplates
from app.web.path_methods import method_guard
from app.web.requests import LONGEST
from app.web.root_path import RootPath
from app.web.route_needs import route_guard
from app.web.route_tables import LateRoutes, add_routes, load_used
from app.web.routes import pages
from app.web.security import BearerGuard, RequestGuard
from app.web.server import Proxies
from app.web.session_end import follow_users
from app.web.turns import Turns

if TYPE_CHECKING:
    from app.cell.site.wall import Wall

PACKED_FROM: Final = 500  # bytes of a response

Lifespan = Callable[[FastAPI], AbstractAsyncContextManager[None]]


def new_application(
    settings: Settings, embed: EmbedRules, lifespan: Lifespan | None = None
) -> Application:
    """An application without its state: set `state.app_state` before the first request."""
    app = Application(
        title="Operator panel",
        summary="The HTTP interface of a robot cell's touch panel.",
        lifespan=lifespan,
        docs_url=None,  # these pages load scripts from other servers
        redoc_url=None,
        openapi_url=None,  # routes.description has it
        max_body_size=LONGEST,
        exception_handlers=HANDLERS,
        dependencies=[Depends(method_guard), Depends(route_guard)],
    )
    _add_middleware(app, settings, embed)
    add_routes(app, settings.wall is not None)
    return app


def _add_middleware(app: FastAPI, settings: Settings, embed: EmbedRules) -> None:
    """The last that is added sees a request first."""
    if settings.dev:
        app.add_exception_handler(Exception, on_error_in_development)
    app.add_middleware(LateRoutes)
    app.add_middleware(LanguageHeaders)
    app.add_middleware(GZipMiddleware, minimum_size=PACKED_FROM)
    app.add_middleware(RequestGuard, hosts=settings.hosts, embed=embed)
    app.add_middleware(BearerGuard)
    app.add_middleware(Turns)
    if settings.proxies:
        app.add_middleware(Proxies, named=settings.proxies)
    app.add_middleware(RootPath, root=settings.root_path)
    app.add_middleware(ReadableStartupErrors)


def page_assets(panel: Panel, kinds: Collection[str] = ()) -> Assets:
    """The files of a panel's pages, and of further kinds of widgets; KindError if a kind lacks one."""
    used = {widget.kind for widget in panel.widgets()} & KINDS.keys()  # the state has no row
    static_files, templates = shipped_path("static"), shipped_path("templates")
    require_files(static_files, templates)
    own = (panel.shown_pictures, panel.styles, panel.templates, panel.brand, panel.fonts)
    assets = load_assets(
        static_files,
        templates,
        panel.mm_per_px,
        used.union(kinds),
        *own,
        has_alarms=panel.may_raise,
    )
    for page in panel.pages:
        assets.sheet([widget.kind for widget in (*page.widgets, *panel.frame.widgets)])
    return assets


def page_revision(panel: Panel, assets: Assets, dev: bool = False) -> str:
    """The revision of all that a page has loaded; in development each start has another one."""
    revision = f"{panel.revision}-{assets.revision}"
    return f"{revision}-{secrets.token_hex(4)}" if dev else revision


async def open_state(
    fleet: Fleet,
    assets: Assets,
    oplog: OperatorLog | NullLog,
    limits: PressLimits,
    doctor: DoctorProcess,
    access: Access,
    wall: "Wall | None" = None,
) -> AppState:
    """What requests need of a running fleet, with the users as they are now. Who opened `access` closes
    it."""
    panel = fleet.panel
    metrics = Metrics(
        fleet if wall is None else None,
        lambda: oplog.left_out,
        lambda: limits.refused,
        lambda: oplog.uncopied,
        wall,
    )
    templates = PageTemplates(shipped_path("templates"), page_parts(panel), shipped_path(COMPILED))
    await access.reload()
    fleet.alarms.watch_sign_ins(access)
    state = AppState(fleet, assets, templates, metrics, oplog, limits, doctor, access, wall)
    follow_users(state)
    return state


async def load_pages(app: FastAPI, state: AppState, panel: Panel) -> None:
    """Loads what the pages use next, while the connection is set up."""
    await pages.compiled(state.templates.environment(panel.language))
    await load_used(app, panel)
