"""All checks, in the order in which one would look: panel file, this machine, the way to each robot,
its graph."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from app.panel import Panel, load_panel
from app.panel.robot_panels import panel_of
from app.ros.graph.model import GraphSnapshot
from app.system.errors import PanelError
from app.system.settings import Settings
from app.system.texts import ENGLISH
from app.system.time_source import read_time_source
from app.tools.doctor.findings import Report
from app.tools.doctor.machine import (
    DRM,
    FreeBytes,
    HasBrowser,
    HasFont,
    ReadTime,
    check_data,
    check_fonts,
    check_log_room,
    check_port,
    check_screens,
    check_time,
    free_bytes,
    has_browser,
    has_font,
)
from app.tools.doctor.names import PanelRobot
from app.tools.doctor.robot import LISTEN_S, check_connection, check_robot

UNKNOWN_TYPE: Final = re.compile(
    r'" is not (an interface|a service|an action) of ROS 2|" is not there: '
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """The checks of this machine. Tests replace them."""

    has_font: HasFont = has_font
    has_browser: HasBrowser = has_browser
    screens: Path = DRM
    free_bytes: FreeBytes = free_bytes
    read_time: ReadTime = read_time_source


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """`host` and `port` are those of the server, `listen_s` is how long topics are observed."""

    host: str = "127.0.0.1"
    port: int = 8000
    listen_s: float = LISTEN_S
    machine: Machine = field(default_factory=Machine)


@dataclass(slots=True)
class Diagnosis:
    """The report of a diagnosis. `graphs` are the graphs of the robots that could be reached, by id."""

    report: Report = field(default_factory=Report)
    panel: Panel | None = None
    graphs: dict[str, GraphSnapshot] = field(default_factory=dict)


async def diagnose(settings: Settings, options: Options) -> Diagnosis:
    """PanelError for a panel file that can't be read at all; its faults are findings."""
    diagnosis = Diagnosis()
    report = diagnosis.report
    diagnosis.panel = panel = _panel(report, settings)
    mode = settings.mode or (panel.mode if panel else "live")
    served = check_port(report, options.host, options.port)
    machine = options.machine
    check_data(report, settings.data_folder(mode), panel, served, machine.free_bytes)
    if panel is not None:
        check_log_room(report, settings.data_folder(mode), panel, machine.free_bytes)
    check_time(report, machine.read_time)
    languages = panel.readers_languages if panel else (ENGLISH,)
    check_fonts(report, languages, machine.has_font, machine.has_browser)
    if panel is not None:
        check_screens(report, panel, machine.screens)
    if mode == "demo":
        report.find("demo_mode", str(panel.title) if panel else "")
    elif panel is None:
        await check_connection(report, "", settings.zenoh, ())
    else:
        for entry in panel.robots or (None,):
            robot = PanelRobot(panel_of(panel, entry.id if entry else None), entry)
            graph = await check_robot(report, robot, settings.zenoh, options.listen_s)
            if graph is not None:
                diagnosis.graphs[robot.id] = graph
    return diagnosis


def _panel(report: Report, settings: Settings) -> Panel | None:
    """None for a panel file with faults: what does not need it is looked at all the same."""
    try:
        panel = load_panel(settings.panel)
    except PanelError as error:
        if error.unreadable:
            raise
        for fault in error.faults:
            code = "type_unknown" if UNKNOWN_TYPE.search(fault.message) else "panel_fault"
            report.find(code, fault.location, detail=fault.message)
        return None
    report.fact(f'the panel "{panel.title}" ({settings.panel}) has no faults')
    return panel
