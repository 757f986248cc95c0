"""`uvicorn app.main:app`: the only wiring."""

from app.process.collector import resume

# isort: split
import asyncio
import logging
import secrets
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager
from functools import partial
from typing import TYPE_CHECKING

from fastapi import Depends, FastAPI
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from starlette.middleware.gzip import GZipMiddleware
from uvicorn import Config as ServerConfig

from app import hot_reload, ros_logging
from app.audit import Limits, OperatorLog, Unlogged
from app.commands.press_limits import PressLimits
from app.errors import KioskError, PanelError
from app.panel import Panel, load_panel
from app.panel.model import RobotEntry
from app.process import heap, listen_sockets
from app.process.sd_notify import Manager
from app.process.shutdown import in_order
from app.process.watchdog import Watchdog
from app.runtime.fleet import Fleet
from app.settings import Settings, shipped
from app.simulator import zenoh_peer
from app.transport.zenoh_session import Config, config_from, config_to
from app.web.app_state import Site, named_robot
from app.web.asgi import Application, InWords
from app.web.assets import Assets, load_assets
from app.web.described import errors
from app.web.error_pages import HANDLERS
from app.web.metrics import Metrics
from app.web.proxies import Proxies
from app.web.request_body import LONGEST
from app.web.routes import audit_log as log_routes
from app.web.routes import (
    control,
    events,
    health,
    hold_socket,
    pages,
    parameters,
    press_socket,
    presses,
    static,
)
from app.web.security import Doors
from app.web.serving import check_port, urls

if TYPE_CHECKING:
    from app.recording import Recordings

log = logging.getLogger("kiosk")

READ_WITHIN_S = 1.0  # by a browser, when the server ends
ANSWERED_WITHIN_S = 2.0  # by the robot, when the server ends; then it is not known what came of a press


def create_app(settings: Settings | None = None) -> FastAPI:
    """The application; raises KioskError where its settings or its panel are unusable."""
    settings = settings or Settings.from_environment()
    ros_logging.configure(settings.log_level)
    panel, fault = _first_panel(settings)
    if (settings.mode or panel.mode) == "live":
        for entry in panel.robots or (None,):  # what can't be used is told before anything starts
            config_from(settings.zenoh, entry.connect if entry else ())

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        async with _logging(settings, panel) as oplog, AsyncExitStack() as opened:
            check_port(app.state.server)
            running = partial(_running, oplog)
            fleet, assets = await opened.enter_async_context(running(settings, panel, fault))
            limits = PressLimits(partial(oplog.leave_out, limited=True))
            metrics = Metrics(lambda: oplog.left_out, lambda: limits.refused)
            site = Site(fleet, assets, _templates(settings.dev), metrics, settings.dev, oplog, limits)
            site.metrics.follow(fleet)
            app.state.site = site
            loop = asyncio.get_running_loop()

            async def ending() -> None:
                watchdog.end()
                try:
                    site.fleet.close()
                    oplog.close()
                    await site.owed.told(ANSWERED_WITHIN_S)
                finally:
                    site.fleet.give_up()
                    await site.owed.told(READ_WITHIN_S)
                    loop.call_later(READ_WITHIN_S, listen_sockets.hang_up, ports)

            ports: set[int] = set()
            watchdog = _watchdog(site)
            with in_order(loop, ending):
                if settings.dev:
                    await opened.enter_async_context(
                        hot_reload.reloading(site, settings, running, opened.pop_all())
                    )
                works = (
                    watchdog.run(),
                    _listening(app.state.server, ports, settings.hosts),
                    _made_ready(site.templates),
                )
                tasks = [asyncio.create_task(work) for work in works]
                try:
                    yield
                finally:
                    for task in tasks:
                        task.cancel()
                    await asyncio.gather(*tasks, return_exceptions=True)
                    watchdog.end()

    app = Application(
        title="Operator panel",
        summary="The HTTP interface of a robot cell's touch panel.",
        lifespan=lifespan,
        docs_url=None,  # they load scripts from elsewhere
        redoc_url=None,
        max_body_size=LONGEST,
        exception_handlers=HANDLERS,
    )
    if settings.dev:
        app.add_exception_handler(Exception, hot_reload.on_error)
    app.add_middleware(GZipMiddleware, minimum_size=500)
    app.add_middleware(Doors, hosts=settings.hosts)
    if settings.proxies:
        app.add_middleware(Proxies, named=settings.proxies)
    app.add_middleware(InWords)
    for routes in (pages, events, presses, press_socket, control, hold_socket, parameters):
        app.include_router(routes.router)
        app.include_router(routes.router, prefix="/robots/{robot}", dependencies=[Depends(named_robot)])
    for common in (static, health):
        app.include_router(common.router)
    app.include_router(log_routes.router, responses=errors(403, 404, 422, 503))
    return app


def _first_panel(settings: Settings) -> tuple[Panel, str]:
    """The panel, or in development an empty one that shows what is wrong with the file."""
    try:
        return load_panel(settings.panel, lambda of: settings.data_folder(settings.mode or of.mode)), ""
    except PanelError as error:
        if not settings.dev:
            raise
        return hot_reload.EMPTY_PANEL, str(error)


@asynccontextmanager
async def _logging(settings: Settings, panel: Panel) -> AsyncIterator[OperatorLog | Unlogged]:
    """The operator's log, open; FolderInUse where another server has its folder."""
    mode, rules = settings.mode or panel.mode, panel.log
    folder = settings.data_folder(mode)
    oplog: OperatorLog | Unlogged = Unlogged(folder)
    if rules.enabled:
        limits = Limits(days=rules.days, size_mb=rules.size_mb, required=rules.required)
        oplog = OperatorLog(folder, limits, mode)
    await oplog.start()
    try:
        yield oplog
    finally:
        await oplog.stop()


@asynccontextmanager
async def _running(
    oplog: OperatorLog | Unlogged,
    settings: Settings,
    panel: Panel,
    fault: str = "",
) -> AsyncIterator[tuple[Fleet, Assets]]:
    """The robots that the panel is for: the real ones, or demo robots of its own."""
    demo = (settings.mode or panel.mode) == "demo"
    kinds: set[str] = {widget.kind for widget in panel.widgets()}
    if any(len(widget.interlocks) > 1 for widget in panel.commands):
        kinds.add("interlocks")
    assets = load_assets(shipped("static"), shipped("templates"), panel.mm_per_px, kinds)
    revision = f"{panel.revision}-{assets.revision}"
    if settings.dev:
        revision += f"-{secrets.token_hex(4)}"  # whatever was changed, pages load anew
    with ExitStack() as stack:

        def config_of(entry: RobotEntry | None) -> Config:
            if not demo:
                return config_from(settings.zenoh, entry.connect if entry else ())
            namespace = entry.namespace if entry else panel.namespace
            return config_to(stack.enter_context(zenoh_peer.in_process(namespace, panel.distro)))

        recordings = _recordings(settings, panel, demo)
        fleet = Fleet(
            panel,
            config_of,
            revision,
            oplog,
            recordings=recordings,
            simulated=demo,
            fault=fault,
        )
        try:
            if recordings is not None:
                recordings.start()
            await fleet.start()
            by = "simulated" if demo else f"live by {settings.zenoh}"
            folder = settings.data_folder("demo" if demo else "live")
            log.info('panel "%s" (%s), robot %s, data in %s', panel.title, settings.panel, by, folder)
            yield fleet, assets
        finally:
            await fleet.stop()
            if recordings is not None:
                await asyncio.to_thread(recordings.stop)


async def _listening(server: ServerConfig | None, ports: set[int], hosts: Sequence[str]) -> None:
    """Tells where browsers find the panel, as soon as they do."""
    listening = await listen_sockets.narrow(ports)
    if listening:
        log.info("the panel is at %s", ", ".join(urls(server, listening, hosts)))


async def _made_ready(templates: Environment) -> None:
    """What can wait until the port is open."""
    await pages.compiled(templates)
    heap.trim()  # a compiler leaves much behind


def _watchdog(site: Site) -> Watchdog:
    """What tells the service manager of the robots that the site has at the time."""
    return Watchdog(
        Manager(),
        lambda: [(kiosk.robot.name, kiosk.link) for kiosk in site.fleet.kiosks],
        lambda: site.fleet.state,
    )


def _recordings(settings: Settings, panel: Panel, demo: bool) -> "Recordings | None":
    """Where the panel asks for them: nobody else reads what writes them."""
    if panel.record is None:
        return None
    from app.recording import Recordings

    folder = settings.data_folder("demo" if demo else "live") / "recordings"
    return Recordings(folder, panel.record.max_mb, len(panel.robots) or 1)


def _templates(dev: bool) -> Environment:
    return Environment(
        loader=FileSystemLoader(shipped("templates")),
        autoescape=True,
        undefined=StrictUndefined,
        auto_reload=dev,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _app_or_exit() -> FastAPI:
    """The application for uvicorn; what is wrong is said in words, without a traceback."""
    try:
        return create_app()
    except KioskError as error:
        sys.exit(str(error))


app = _app_or_exit()
resume()
