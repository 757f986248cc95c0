"""Opens and closes the parts of a server in order: operator's log, recordings, robots."""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractContextManager, ExitStack, asynccontextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Final

from app.cell.alarms.report import NAME as STATES
from app.cell.people.access_log import read_rights
from app.cell.session.doctor_process import DoctorProcess
from app.cell.session.fleet import Fleet
from app.cell.session.state_recorder import StateRecorder
from app.panel import Panel
from app.panel.model import RobotEntry
from app.panel.widgets.trend import trends_of
from app.records import Limits, NullLog, OperatorLog
from app.records.starts import KeptFiles, StartRecord, read_start_files
from app.ros.zenoh.config import Config, config_from, config_to, tls_files
from app.system.concurrency import end_tasks, keep_running, spawn_logged
from app.system.settings import Mode, Settings
from app.system.used_certificates import ServedCertificate, UsedCertificates

if TYPE_CHECKING:
    from app.cell.history.recording import Recordings
    from app.cell.history.trends import TrendWriter
    from app.cell.session.forward_process import ForwardProcess
    from app.cell.session.site import SiteSummary

log = logging.getLogger("kiosk")

MACHINE_AFTER_S: Final = 2.0
STOPS_AFTER_S: Final = 1.0

# (panel, which of its robots) → a simulated robot that runs while it is entered, by its endpoint.
SimulatedRobot = Callable[[Panel, RobotEntry | None], AbstractContextManager[str]]


def mode_of(settings: Settings, panel: Panel) -> Mode:
    """`KIOSK_MODE`, else what the panel file says."""
    return settings.mode or panel.mode


def data_folder(settings: Settings, panel: Panel) -> Path:
    """The data folder of a server with this panel."""
    return settings.data_folder(mode_of(settings, panel))


def check_zenoh(settings: Settings, panel: Panel) -> None:
    """KioskError if the Zenoh configuration can't be used."""
    if mode_of(settings, panel) == "live":
        for entry in panel.robots or (None,):
            config_from(settings.zenoh, entry.connect if entry else ())
        for fault in tls_files(settings.zenoh).faults():
            log.error("no link to a robot: %s (%s)", fault, settings.zenoh)


@asynccontextmanager
async def open_log(settings: Settings, panel: Panel) -> AsyncIterator[OperatorLog | NullLog]:
    """The operator's log; FolderInUse if another server has its folder."""
    mode, rules = mode_of(settings, panel), panel.log
    folder = data_folder(settings, panel)
    oplog: OperatorLog | NullLog = NullLog(folder)
    if rules.enabled:
        limits = Limits(days=rules.days, size_mb=rules.size_mb, required=rules.required)
        users = partial(read_rights, folder)
        read = partial(read_start_files, settings, panel, mode, users)
        record = StartRecord(KeptFiles(folder), read, panel.revision)
        oplog = OperatorLog(folder, limits, mode, record, signs=True)
    await oplog.start()
    if isinstance(oplog, OperatorLog):
        oplog.start_copies(settings)
    try:
        yield oplog
    finally:
        await oplog.stop()


@asynccontextmanager
async def open_fleet(
    settings: Settings,
    panel: Panel,
    revision: str,
    oplog: OperatorLog | NullLog,
    simulated_robot: SimulatedRobot,
    doctor: DoctorProcess | None = None,
    certificate: ServedCertificate | None = None,
) -> AsyncIterator[Fleet]:
    """The robots of the panel, real or simulated. `revision` is that of the page's files, `certificate`
    the server's own."""
    demo = mode_of(settings, panel) == "demo"
    files = [] if demo else tls_files(settings.zenoh).certificates
    certificates = UsedCertificates(files, certificate)
    with ExitStack() as stack:

        def config_of(entry: RobotEntry | None) -> Config:
            if not demo:
                return config_from(settings.zenoh, entry.connect if entry else ())
            return config_to(stack.enter_context(simulated_robot(panel, entry)))

        recordings = _recordings(settings, panel)
        fleet = Fleet(
            panel,
            config_of,
            revision,
            oplog,
            recordings=recordings,
            simulated=demo,
            root_path=settings.root_path,
            doctor=doctor,
        )
        trends = _trend_disk(settings, panel, fleet)
        fleet.states = settings.data_folder(mode_of(settings, panel)) / STATES
        site = _site_summary(settings, panel, fleet)
        states = _state_recorder(fleet, oplog, fleet.states, panel)
        fleet.forward = _forward(settings, panel)
        machine = keep_running(
            partial(_watch_machine, fleet, oplog, settings), log, "the machine is not watched"
        )
        keeping = spawn_logged(_keep_stops(fleet, settings), log, "what is shown at stops is not kept")
        try:
            if recordings is not None:
                recordings.start()
            if trends is not None:
                await trends.start()
            folder = settings.data_folder(mode_of(settings, panel))
            await fleet.alarms.start(folder, oplog, certificates, fleet.forward)
            await fleet.recipes.start(folder, oplog)
            if fleet.place_file is not None:
                await fleet.place_file.start(folder)
            await fleet.start()
            if states is not None:
                states.start()
            if fleet.journal is not None:
                fleet.journal.start(fleet.states)
            if fleet.forward is not None:
                fleet.forward.start()
            if site is not None:
                site.start()
                fleet.alarms.watch_site(site)
            by = "simulated" if demo else f"live by {settings.zenoh}"
            folder = settings.data_folder(mode_of(settings, panel))
            log.info('panel "%s" (%s), robot %s, data in %s', panel.title, settings.panel, by, folder)
            yield fleet
        finally:
            await end_tasks([machine, keeping])
            if fleet.forward is not None:
                await fleet.forward.stop()
            if site is not None:
                await site.stop()
            if states is not None:
                await states.stop()
            await fleet.stop()
            if fleet.stop_views is not None:
                await fleet.stop_views.stop()
            if fleet.journal is not None:
                await fleet.journal.stop()
            await fleet.alarms.stop()
            await fleet.recipes.stop()
            if fleet.place_file is not None:
                await fleet.place_file.stop()
            if trends is not None:
                await trends.stop()
            if recordings is not None:
                await asyncio.to_thread(recordings.stop)


def _state_recorder(
    fleet: Fleet, oplog: OperatorLog | NullLog, path: Path, panel: Panel
) -> StateRecorder | None:
    """What records the states of a panel that has them; with `[oee]` it asks for reasons."""
    if panel.state is None:
        return None
    if panel.oee is None:
        return StateRecorder(path, fleet.sessions)
    from app.cell.session.stops import ask_open_reasons, ask_reason

    asks_together = partial(ask_open_reasons, fleet, oplog) if panel.oee.reasons else None
    return StateRecorder(path, fleet.sessions, partial(ask_reason, fleet), asks_together)


async def _watch_machine(fleet: Fleet, oplog: OperatorLog | NullLog, settings: Settings) -> None:
    """Begins, and is imported, after the first page."""
    await asyncio.sleep(MACHINE_AFTER_S)
    await asyncio.to_thread(import_module, "app.cell.session.machine_watch")
    from app.cell.session.machine_watch import MachineReader, MachineWatch
    from app.system import minisign

    if fleet.machine is None:
        data = settings.data_folder(mode_of(settings, fleet.panel))
        keys = Path(minisign.PINNED)
        reader = MachineReader(settings.panel.parent, data, keys, fleet.panel.log)
        fleet.machine = MachineWatch(oplog, fleet.skews, reader)
    await fleet.machine.run()


async def _keep_stops(fleet: Fleet, settings: Settings) -> None:
    """Is imported after the first page."""
    await asyncio.sleep(STOPS_AFTER_S)
    await asyncio.to_thread(import_module, "app.cell.session.stop_views")
    from app.cell.session.stop_views import keep_stops

    fleet.stop_views = keep_stops(fleet, settings.data_folder(mode_of(settings, fleet.panel)))


def _recordings(settings: Settings, panel: Panel) -> "Recordings | None":
    """Imports the MCAP writer only if the panel records: it takes time and memory."""
    if panel.record is None:
        return None
    from app.cell.history.recording import FOLDER, Recordings

    folder = settings.data_folder(mode_of(settings, panel)) / FOLDER
    return Recordings(folder, panel.record.max_mb, len(panel.robots) or 1)


def _forward(settings: Settings, panel: Panel) -> "ForwardProcess | None":
    """The forwarder, if the settings name a central database; SettingsError if they can't be used."""
    if settings.forward is None:
        return None
    from app.cell.forward.config import read_forward
    from app.cell.session.forward_process import ForwardProcess

    config = read_forward(settings.forward)
    return ForwardProcess(settings.forward, data_folder(settings, panel), config.connection.address)


def _trend_disk(settings: Settings, panel: Panel, fleet: Fleet) -> "TrendWriter | None":
    """The histories on disk, if a trend of the panel is kept there."""
    if not any(trend.disk for trend in trends_of(panel)):
        return None
    from app.cell.history.trends import TrendWriter

    disk = TrendWriter(settings.data_folder(mode_of(settings, panel)), panel)
    for session in fleet.sessions:
        disk.add(session.entry.id if session.entry else "", session.robot, session.show)
    return disk


def _site_summary(settings: Settings, panel: Panel, fleet: Fleet) -> "SiteSummary | None":
    """What the cell publishes of itself, of a demo too: it says that it is one."""
    if panel.site is None:
        return None
    from app.cell.session.site import SiteSummary

    config = config_from(settings.zenoh, panel.site.connect)
    return SiteSummary(fleet, panel.site, config, mode_of(settings, panel) == "demo")
