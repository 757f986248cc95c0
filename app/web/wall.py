"""Opens the parts of a wall: its cells, and a fleet without robots for the frame of its pages."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from app.cell.session.doctor_process import DoctorProcess
from app.cell.session.fleet import Fleet
from app.cell.site.wall import Wall
from app.panel import Panel
from app.records import NullLog, OperatorLog
from app.ros.zenoh.config import config_from, config_to
from app.ros.zenoh.session import Unconnected
from app.system.settings import Settings

log = logging.getLogger("kiosk.wall")


@asynccontextmanager
async def open_wall(
    settings: Settings,
    panel: Panel,
    revision: str,
    oplog: OperatorLog | NullLog,
    doctor: DoctorProcess,
) -> AsyncIterator[tuple[Fleet, Wall]]:
    """The fleet is never started: a wall sends nothing to a robot, and subscribes to none."""
    fleet = Fleet(
        panel,
        lambda _: config_to("tcp/127.0.0.1:0"),
        revision,
        oplog,
        root_path=settings.root_path,
        doctor=doctor,
        link=Unconnected,
    )
    fleet.show_as(None)
    wall = Wall(config_from(settings.zenoh), settings.wall or ())
    wall.start()
    sites = ", ".join(wall.sites) or "all sites"
    log.info("a wall of the cells of %s, by %s", sites, settings.zenoh)
    try:
        yield fleet, wall
    finally:
        fleet.close()
        await wall.stop()
