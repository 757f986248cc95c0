"""The pages of a panel as files, rendered from what was kept of them at a stop: by the templates of the
server, with a fleet that reaches no robot."""

import asyncio
from collections.abc import Iterator
from functools import partial
from typing import Any, Final, NamedTuple

from app.cell.commands.judge import PressLimits
from app.cell.people.access import Access
from app.cell.people.users_file import UsersFile
from app.cell.permission.roles import unmet
from app.cell.session.doctor_process import DoctorProcess
from app.cell.session.fleet import Fleet
from app.cell.stops.shown import ROWS, ShownFault, ShownView
from app.cell.view.trend import Plot
from app.panel import Panel
from app.panel.checks.look import page_parts
from app.panel.roles import ENGINEER
from app.panel.rules import AccessRules
from app.panel.widgets.displays import LogView
from app.panel.widgets.trend import Trend
from app.records import NullLog
from app.records.principal import Principal, anonymous
from app.ros.zenoh.config import config_to
from app.ros.zenoh.session import Unconnected
from app.system.clock import format_datetime, format_day, format_time, iso_time
from app.system.settings import Settings, shipped_path
from app.system.texts import render, say
from app.web.app_state import AppState
from app.web.application import page_assets
from app.web.metrics import Metrics
from app.web.pages.compiled_templates import COMPILED
from app.web.pages.context import Reader, page_context
from app.web.pages.display_choice import display_of
from app.web.pages.log_lines import lines_values, wanted_lines
from app.web.pages.page_templates import PageTemplates
from app.web.pages.standalone import stands_alone

LEFT_OUT: Final = say("stop_view_left_out")
EMPTY: Final = Plot((), (), (), (), ())


class Taker(NamedTuple):
    """The role and the groups of who takes a parcel: pages that these do not see are left out."""

    role: str = ENGINEER
    groups: frozenset[str] = frozenset()


class PageFile(NamedTuple):
    """A page as HTML; why there is none where that is ""."""

    page: str
    html: str
    why: str = ""


def page_files(
    settings: Settings, panel: Panel, shown: ShownView, taker: Taker, language: str, at_stop: bool
) -> list[PageFile]:
    """The pages of the robot whose view was kept, each as a file. ShownFault where the panel file is
    another one than that of the view."""
    if shown.revision != panel.revision:
        raise ShownFault("the panel file has been changed since")
    return asyncio.run(_rendered(settings, panel, shown, taker, language, at_stop))


async def _rendered(
    settings: Settings, panel: Panel, shown: ShownView, taker: Taker, language: str, at_stop: bool
) -> list[PageFile]:
    oplog, folder = NullLog(), settings.data_folder(settings.mode or panel.mode)
    doctor, limits = DoctorProcess(settings), PressLimits(partial(oplog.suppress, limited=True))
    fleet = Fleet(
        panel, lambda _: config_to("tcp/127.0.0.1:0"), panel.revision, oplog, doctor=doctor,
        link=Unconnected,
    )  # fmt: skip
    fleet.show_as(None)
    access = Access(UsersFile(folder), AccessRules(), oplog)  # whose users are not read
    try:
        templates = PageTemplates(shipped_path("templates"), page_parts(panel), shipped_path(COMPILED))
        metrics = Metrics(fleet, lambda: 0, lambda: 0, lambda: {})
        state = AppState(fleet, page_assets(panel), templates, metrics, oplog, limits, doctor, access)
        session = fleet.of_robot(shown.robot)
        who = Principal(anonymous(""), role=taker.role, groups=taker.groups)
        session.publisher.post(_view(panel, shown))
        reader = Reader(who, language, display_of({}, panel), as_shown=True)
        return [*_pages(state, shown, reader, at_stop)]
    finally:
        fleet.close()
        access.close()


def _view(panel: Panel, shown: ShownView) -> Any:
    """With a sentence in the place of each widget that was left out."""
    drawn = {*shown.plots, *shown.lines}
    curves = (widget for widget in panel.widgets() if isinstance(widget, Trend | LogView))
    lost = {*shown.left_out, *(str(widget.id) for widget in curves if widget.id not in drawn)} - {ROWS}
    failed = {"failed": LEFT_OUT, "enabled": False, "state": "unreadable"}
    return {**shown.view, "widgets": {**shown.view["widgets"], **dict.fromkeys(lost, failed)}}


def _pages(state: AppState, shown: ShownView, reader: Reader, at_stop: bool) -> Iterator[PageFile]:
    panel, session = state.fleet.panel, state.fleet.of_robot(shown.robot)
    own = [page for page in panel.pages if page.robot in (None, session.robot.id)]
    lacks = unmet(panel.needs.named, reader.who)
    hidden = panel.needs.hidden_pages(lacks)
    files = {str(page.id) for page in own if page.id not in hidden}
    time = format_datetime(shown.at)
    mark = render(say("stop_view_at" if at_stop else "stop_view_now", time=time), reader.language)
    no_picture = render(say("stop_view_no_picture"), reader.language)
    for page in own:
        name = str(page.id)
        if name not in files:
            yield PageFile(name, "", f"it needs the role or group {page.needs}")
            continue
        try:
            context: dict[str, Any] = {**page_context(state, session, page, reader, 0)}
            context |= {
                "clock": format_time(shown.at), "day": format_day(shown.at),
                "clock_at": iso_time(shown.at), "loaded": time,
            }  # fmt: skip
            context["words"] |= {
                "plot": lambda widget: shown.plots.get(str(widget.id), EMPTY),
                "lines": partial(_lines, panel, shown, reader.language),
            }
            html = state.templates.screen(page, reader.language, context)
        except Exception as error:  # the templates of another version need other values
            yield PageFile(name, "", f"what was kept of it can't be drawn: {error!r:.200}")
            continue
        yield PageFile(name, stands_alone(html, state.assets, files, session.base, mark, no_picture))


def _lines(panel: Panel, shown: ShownView, language: str, widget: LogView) -> list[dict[str, Any]]:
    wanted = wanted_lines(panel, widget, language)
    return lines_values(shown.lines.get(str(widget.id), ()), wanted, language)
