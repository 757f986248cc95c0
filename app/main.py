"""The application: `uvicorn app.main:app`. Connects the rooms."""
# ruff: noqa: E402

import gc

gc.disable()  # until the application is made: collections while it is imported take half a second

import asyncio
import logging
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Final

from fastapi import APIRouter, FastAPI
from uvicorn import Config as ServerConfig

from app.cell.commands.judge import PressLimits
from app.cell.people.access import Access
from app.cell.people.users_file import UsersFile, users_configured
from app.cell.session.assembly import check_zenoh, data_folder, mode_of, open_fleet, open_log
from app.cell.session.doctor_process import DoctorProcess
from app.panel import Panel, load_panel
from app.panel.widgets.kinds import KINDS
from app.system import log as ros_logging
from app.system.concurrency import keep_running, spawn_logged
from app.system.errors import KioskError, PanelError, SettingsError
from app.system.log import RepeatedRecords
from app.system.process import listen_sockets
from app.system.process.service import ServiceManager, Watchdog
from app.system.process.shutdown import Restart, graceful_shutdown
from app.system.settings import PACKAGE, Settings, shipped_path
from app.tools.simulator.in_process import in_process
from app.web.app_state import AppState
from app.web.application import (
    load_pages,
    new_application,
    open_state,
    page_assets,
    page_revision,
)
from app.web.root_path import root_path_of
from app.web.server import (
    Connection,
    check_port,
    check_protected,
    count_repeated,
    limit_server_log,
    served_certificate,
    urls,
)

if TYPE_CHECKING:
    from app.cell.session.fleet import Fleet
    from app.cell.site.wall import Wall
    from app.records import NullLog, OperatorLog
    from app.records.sent_panel import SentPanels
    from app.system.used_certificates import ServedCertificate

log = logging.getLogger("kiosk")

READ_TIMEOUT_S: Final = 1.0  # for browsers to read their responses at shutdown
RESPONSE_TIMEOUT_S: Final = 2.0  # for the robot's at shutdown; then the result of a press is unknown


def create_app(settings: Settings | None = None) -> FastAPI:
    """The application; KioskError if its settings or its panel file are unusable."""
    settings = settings or Settings.from_environment()
    ros_logging.configure_logging(settings.log_level)
    repeated = limit_server_log(settings.log_level == "debug")
    sent = _sent_panels(settings) if settings.wall is None else None
    file = settings.panel if settings.wall is None else shipped_path("wall.toml")
    try:
        panel = load_panel(file)
        check_zenoh(settings, panel)
    except Exception as error:
        if sent is None or not sent.failed(str(error)):
            raise
        panel = load_panel(file)
        check_zenoh(settings, panel)
    lifespan = partial(_lifespan_of_sent, sent, settings, panel, repeated)
    app = new_application(settings, panel.embed, lifespan)
    if settings.dev:
        _add_gallery(app)
    return app


def _add_gallery(app: FastAPI) -> None:
    """The gallery is a part of the checkout only, not of the installed package."""
    if not (PACKAGE.parent / "tests/gallery").is_dir():
        log.info("/gallery is not in the installed package: `make dev` in a checkout has it")
        return
    router: APIRouter = import_module("tests.gallery.page").router
    app.include_router(router)
    app.state.path_methods.add(router.routes)


def _sent_panels(settings: Settings) -> "SentPanels | None":
    """The panels that were sent to this server, after a look at the last one; None where none
    are taken. Imported only there."""
    if not settings.take_panel:
        return None
    from app.records.sent_panel import SentPanels

    sent = SentPanels(settings.panel)
    try:
        sent.begin_start()
    except OSError as error:
        log.critical("the panel file that was sent is not taken back: %s", error)
    return sent


@asynccontextmanager
async def _lifespan_of_sent(
    sent: "SentPanels | None",
    settings: Settings,
    panel: Panel,
    repeated: RepeatedRecords,
    app: FastAPI,
) -> AsyncIterator[None]:
    """`_lifespan`, after which the server starts again if a panel file was sent, or without the file
    that it could not start with."""
    restart, has_started = Restart(ServiceManager().is_enabled), False
    try:
        async with _lifespan(settings, panel, repeated, restart, app):
            has_started = True
            yield
    except Exception as error:
        if has_started and not restart.is_due:
            raise
        if not has_started and (sent is None or not sent.failed(str(error))):
            raise
        log.exception("the server ended with an error around a panel file that was sent")
        restart.is_due = True
    if sent is not None:
        sent.ended_in_order()
    restart.finish()
    if not has_started:
        raise SettingsError("the panel file that was sent was taken back: start the server again")


@asynccontextmanager
async def _lifespan(
    settings: Settings, panel: Panel, repeated: RepeatedRecords, restart: Restart, app: FastAPI
) -> AsyncIterator[None]:
    """From the start of the server to its end."""
    async with _app_state(settings, panel, app.state.server, restart) as state:
        app.state.app_state = state
        ports: set[int] = set()
        watchdog = _watchdog(state)
        with graceful_shutdown(asyncio.get_running_loop(), partial(_end, state, watchdog, ports)):
            once = (
                _log_urls(app.state.server, ports, settings.hosts),
                load_pages(app, state, panel),
            )
            tasks = [
                *(spawn_logged(work, log, "a task of the start failed") for work in once),
                keep_running(partial(count_repeated, repeated), log, "counting records failed"),
                keep_running(watchdog.run, log, "the watchdog failed"),
                keep_running(state.access.watch, log, "watching the users' file failed"),
            ]
            if state.receiver is not None:
                trial = state.receiver.follow_trial(state.in_flight)
                tasks.append(spawn_logged(trial, log, "following a sent panel file failed"))
            gc.collect()
            gc.freeze()  # nor of the panel: with 10,000 alarms it would stop it for 70 to 240 ms
            try:
                yield
            finally:
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)
                watchdog.notify_stopping()


async def _end(state: AppState, watchdog: Watchdog, ports: set[int]) -> None:
    """Ends the sessions and the log, and waits for outstanding responses."""
    watchdog.notify_stopping()
    try:
        if state.wall is not None:
            state.wall.close()
        state.fleet.close()
        state.log.close()
        await state.in_flight.drained(RESPONSE_TIMEOUT_S)
    finally:
        state.fleet.cancel_all()
        await state.in_flight.drained(READ_TIMEOUT_S)
        asyncio.get_running_loop().call_later(READ_TIMEOUT_S, listen_sockets.abort_unsent, ports)


@asynccontextmanager
async def _app_state(
    settings: Settings, panel: Panel, server: ServerConfig | None, restart: Restart
) -> AsyncIterator[AppState]:
    """Opens everything that requests need, and closes it at the end."""
    settings = replace(settings, root_path=root_path_of(settings, server))
    Connection.proxies.name(settings.proxies)
    async with open_log(settings, panel) as oplog:
        check_port(server)
        _check_protected(settings, panel, server)
        # The gallery shows all kinds.
        assets = page_assets(panel, KINDS if settings.dev else ())
        revision = page_revision(panel, assets, settings.dev)
        limits = PressLimits(partial(oplog.suppress, limited=True))
        doctor = _doctor(settings, server)
        async with (
            served_certificate(server) as tls,
            _open_robots(settings, panel, revision, oplog, doctor, tls) as (fleet, wall),
        ):
            access = Access(UsersFile(data_folder(settings, panel)), panel.access, oplog)
            state = await open_state(fleet, assets, oplog, limits, doctor, access, wall)
            if settings.take_panel and wall is None:
                from app.cell.session.sent_panels import PanelReceiver

                receiver = PanelReceiver(
                    settings.panel, fleet, oplog, restart.begin, is_dev=settings.dev
                )
                state.receiver = receiver
            try:
                yield state
            finally:
                access.close()
                await doctor.stop()


@asynccontextmanager
async def _open_robots(
    settings: Settings,
    panel: Panel,
    revision: str,
    oplog: "OperatorLog | NullLog",
    doctor: DoctorProcess,
    certificate: "ServedCertificate | None",
) -> AsyncIterator[tuple["Fleet", "Wall | None"]]:
    """The robots of a panel; of a wall its cells, with a fleet that reaches no robot."""
    if settings.wall is None:
        async with open_fleet(
            settings, panel, revision, oplog, in_process, doctor, certificate
        ) as fleet:
            yield fleet, None
        return
    from app.web.wall import open_wall

    async with open_wall(settings, panel, revision, oplog, doctor) as opened:
        yield opened


def _check_protected(settings: Settings, panel: Panel, server: ServerConfig | None) -> None:
    """SettingsError if a live panel would be open to the network. A demo moves nothing."""
    if mode_of(settings, panel) == "live":
        has_users = panel.access.oidc is not None or users_configured(data_folder(settings, panel))
        check_protected(server, has_users, settings.without)


def _doctor(settings: Settings, server: ServerConfig | None) -> DoctorProcess:
    """The doctor, which asks this server where it listens."""
    return DoctorProcess(settings, *((server.host, server.port) if server else ()))


async def _log_urls(server: ServerConfig | None, ports: set[int], hosts: Sequence[str]) -> None:
    """Waits until the server listens, then logs its URLs."""
    listening = await listen_sockets.limit_send_buffer(ports)
    if listening:
        log.info("the panel is at %s", ", ".join(urls(server, listening, hosts)))


def _watchdog(state: AppState) -> Watchdog:
    """The watchdog of all robot sessions."""
    return Watchdog(
        ServiceManager(),
        lambda: [(s.robot.name, s.link) for s in state.fleet.sessions if state.wall is None],
        lambda: state.fleet.state if state.wall is None else state.wall.state,
    )


def _app_or_exit() -> FastAPI:
    """The application for uvicorn. Errors exit with a message and no traceback. In development a panel
    file with faults is served as a page that lists them."""
    try:
        settings = Settings.from_environment()
        try:
            return create_app(settings)
        except PanelError as error:
            if not settings.dev:
                raise
            from app.web.fault_page import fault_page

            return fault_page(str(error), settings.hosts)
    except KioskError as error:
        sys.exit(str(error))


app = _app_or_exit()
gc.enable()
gc.freeze()  # a collection of all modules would stop the event loop for 25 to 50 ms
