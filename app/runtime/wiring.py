"""Wires a session with one robot: its signals first, then each part by its constructor."""

import asyncio
import logging
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Final

from app.alarms.published import PublishedAlarms
from app.audit.press_record import Log, PressLog
from app.commands.acts import ActContext, ActRunner
from app.commands.alarm_acts import ALARM_ACTS, lock_of_alarm, needs_of_alarm
from app.commands.control_acts import CONTROL_ACTS, log_hand_over
from app.commands.diagnostic_acts import DIAGNOSTIC_ACTS, Doctor, NoDoctor
from app.commands.press_guard import PressGuard
from app.commands.recipe_acts import RECIPE_ACTS, lock_of_recipe
from app.commands.shift_acts import SHIFT_ACTS
from app.dialect.type_hashes import distribution_hashes
from app.interfaces import load_interfaces
from app.interfaces.names import ROSOUT_TOPIC
from app.panel.model import Panel, RobotEntry
from app.panel.robot_panels import panel_of, widget_robots
from app.panel.widgets.trend import trends_of
from app.permission.confirmations import UNKNOWN_USERS, ConfirmLocks
from app.permission.control_authority import ControlAuthority
from app.robot.log_lines import LogListener
from app.robot.slices import Slices
from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.runtime.alarms import Alarms
from app.runtime.frames import Frames
from app.runtime.graph_survey import GraphSurvey
from app.runtime.ingest import Ingest
from app.runtime.live_look import LiveLooks
from app.runtime.node_round_trips import NodeRoundTrips
from app.runtime.recipes import Recipes
from app.runtime.renewal import Renewal
from app.runtime.robot_alarms import RobotAlarms
from app.runtime.robot_commands import RobotCommands
from app.runtime.robot_session import RobotSession, SessionRecorder
from app.runtime.turn import Turn
from app.transport.peer import RobotAccess, RobotContext
from app.transport.robot_signals import RobotSignals
from app.transport.rosout import Rosout
from app.transport.zenoh_config import Config
from app.transport.zenoh_session import ZenohSession
from app.view.refresh import NoOtherRobots, OtherRobots, ViewRefresher, ViewSources

if TYPE_CHECKING:
    from app.recording import Recorder, Recordings
    from app.trends.recorder import TrendRecorder

log = logging.getLogger("kiosk")

ALONE: Final = NoOtherRobots()


@dataclass(frozen=True, slots=True)
class ServerParts:
    """The parts that all sessions share; `revision` is that of the page's files, `root_path` that below
    which a proxy shows all pages."""

    panel: Panel
    revision: str
    operators_log: Log
    recordings: "Recordings | None" = None
    slices: Slices | None = None
    simulated: bool = False
    root_path: str = ""
    alarms: Alarms | None = None
    doctor: Doctor = field(default_factory=NoDoctor)
    recipes: Recipes | None = None
    confirm_locks: ConfirmLocks = UNKNOWN_USERS


def wire_session(
    server: ServerParts,
    config: Config,
    access: RobotAccess,
    *,
    entry: RobotEntry | None = None,
    others: OtherRobots = ALONE,
) -> RobotSession:
    """A session that has not been started. `access` is how the robot is reached. If the panel has
    several robots, `entry` is this one and `others` gives access to all of them."""
    panel, operators_log = server.panel, server.operators_log
    robots = widget_robots(panel)
    pages, needs = panel.widgets_by_page, panel.needs
    panel = panel_of(panel, entry.id if entry else None)
    context = _context(server, panel, config, access, entry)
    robot, link, signals = context.robot, context.link, context.signals
    control = ControlAuthority(
        panel.control,
        robot.title,
        log_line=RobotLog(log, robot.name).info,
        on_hand_over=signals.handed_over.emit,
    )
    alarms = server.alarms or Alarms(server.panel)
    robot_alarms = alarms.add_robot(entry.id if entry else "", robot)
    recipes = server.recipes or Recipes(server.panel)
    recipes.add_listener(signals.changed.emit)
    sources = ViewSources(
        control,
        operators_log,
        others,
        server.recordings,
        server.simulated,
        alarms.view,
        robot_alarms.inhibited,
        recipes.revisions,
        pages,
        needs,
        server.confirm_locks,
    )
    refresher = ViewRefresher(panel, robot, server.revision, sources)
    publisher = refresher.publisher
    press_guard = PressGuard(
        publisher,
        control,
        operators_log,
        panel.press_expires_s,
        others.instance_ids,
        robot_alarms.inhibited,
        robots,
        others.publisher,
        needs.commands,
        server.confirm_locks,
    )
    press_log = PressLog(operators_log, robot.name, lambda: publisher.id)
    act_context = ActContext(press_guard, press_log, robot.name, signals.changed.emit)
    peer = access.peer(context)
    recorder = _recorder(server, context, entry)
    recorders: list[SessionRecorder] = [*([recorder] if recorder else []), *_trend_recorders(context)]
    commands = RobotCommands(context, peer, press_guard, press_log, recorder, recipes)
    published_alarms = PublishedAlarms(
        panel,
        entry.id if entry else "",
        context.interfaces,
        robot.possible_keys,
        robot.slices,
        robot_alarms.entries_received,
    )
    ingest = Ingest(
        panel,
        robot,
        commands.sample_handlers,
        [robot.table_entries, LogListener(robot.log_lines), published_alarms, *recorders],
    )
    own_line = partial(_show_own_line, robot, refresher)
    session = RobotSession(
        context=context,
        entry=entry,
        base=server.root_path + (f"/robots/{entry.id}" if entry else ""),
        operators_log=operators_log,
        control=control,
        control_acts=ActRunner("control", CONTROL_ACTS, control, act_context),
        alarm_acts=ActRunner(
            "alarm",
            ALARM_ACTS,
            alarms.engine,
            act_context,
            partial(needs_of_alarm, alarms.engine),
            partial(lock_of_alarm, alarms.engine, server.confirm_locks),
        ),
        recipe_acts=ActRunner(
            "recipe",
            RECIPE_ACTS,
            recipes,
            act_context,
            further_lock=partial(lock_of_recipe, recipes, server.confirm_locks),
        ),
        diagnostic_acts=ActRunner("diagnostics", DIAGNOSTIC_ACTS, server.doctor, act_context),
        shift_acts=ActRunner("alarm", SHIFT_ACTS, None, act_context),
        press_guard=press_guard,
        press_log=press_log,
        refresher=refresher,
        peer=peer,
        commands=commands,
        ingest=ingest,
        turn=Turn(context, peer, control, ingest, commands, refresher, robot_alarms),
        frames=Frames(context, partial(peer.on_graph_change, False)),
        survey=GraphSurvey(context, access.observe),
        node_trips=NodeRoundTrips(context),
        looks=LiveLooks(context),
        renewal=Renewal(link, robot),
        rosout=Rosout(robot, context.interfaces, link, asyncio.get_running_loop(), own_line),
        recorders=recorders,
    )
    _connect(signals, robot_alarms, session)
    return session


def _context(
    server: ServerParts, panel: Panel, config: Config, access: RobotAccess, entry: RobotEntry | None
) -> RobotContext:
    """The state of the robot and the link to it. `panel` is the robot's."""
    signals = RobotSignals()
    interfaces = load_interfaces(panel.distro, panel.interfaces)
    hashes = distribution_hashes(panel.distro, interfaces)
    dialect = access.dialect((entry or panel).domain, hashes)
    link = ZenohSession(config, signals.arrived.emit, dialect)
    robot = RobotState(
        panel,
        interfaces,
        dialect,
        access.traits,
        link.zid,
        entry,
        server.slices,
        endpoints=link.endpoints,
        on_late_reading=signals.late_reading.emit,
        on_entries_decoded=signals.entries_decoded.emit,
    )
    return RobotContext(panel, interfaces, robot, link, signals, config)


def _connect(signals: RobotSignals, robot_alarms: RobotAlarms, session: RobotSession) -> None:
    turn, refresher = session.turn, session.refresher
    signals.arrived.connect(turn.wake)
    signals.judging.connect(turn.run)
    signals.changed.connect(turn.changed)
    robot_alarms.shown.connect(refresher.refresh_alarms)
    robot_alarms.locks_changed.connect(turn.changed)
    robot_alarms.marks_changed.connect(refresher.refresh_values)
    signals.graph_read.connect(turn.on_graph_read)
    signals.late_reading.connect(turn.run_late_reading)
    signals.entries_decoded.connect(lambda key: refresher.refresh_values({key}))
    signals.handed_over.connect(partial(log_hand_over, session.press_log))
    signals.link_lost.connect(session.renew)
    signals.route_lost.connect(session.reopen)


def _recorder(
    server: ServerParts, context: RobotContext, entry: RobotEntry | None
) -> "Recorder | None":
    """The recorder, if the panel file has `[record]`."""
    panel, recordings = context.panel, server.recordings
    if recordings is None or panel.record is None:
        return None
    from app.recording import Recorder

    recordings.add_listener(context.signals.changed.emit)
    name = entry.id if entry else ""
    return Recorder(panel, panel.record, context.interfaces, context.robot, name, recordings)


def _trend_recorders(context: RobotContext) -> "Iterator[TrendRecorder]":
    """The recorder of what trends show and alarms have limits for, if the panel has any."""
    if trends_of(context.panel) or any(alarm.limited_value for alarm in context.panel.alarms):
        from app.trends.recorder import TrendRecorder

        yield TrendRecorder(context.panel, context.interfaces, context.robot)


def _show_own_line(robot: RobotState, refresher: ViewRefresher, payload: bytes) -> None:
    """The panel's own line in the robot's log: Zenoh does not bring it back."""
    key = robot.key(ROSOUT_TOPIC)
    if (lines := robot.log_lines.get(key)) is not None:
        lines.add(payload)
        refresher.refresh_values({key})
