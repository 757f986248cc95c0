"""A session with one robot: opens, closes and renews what `wiring` has put together.

Data flow: the inbox wakes the event loop → `Turn` → robot, holds, confirmations, view → event streams.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from app.cell.alarms.engine import AlarmEngine
from app.cell.alarms.published import PublishedAlarms
from app.cell.commands.acts import ActContext, ActRunner
from app.cell.commands.alarm_acts import ALARM_ACTS, lock_of_alarm, needs_of_alarm
from app.cell.commands.control_acts import CONTROL_ACTS, log_hand_over
from app.cell.commands.diagnostic_acts import DIAGNOSTIC_ACTS, Doctor, NoDoctor
from app.cell.commands.dispatch import Dispatcher
from app.cell.commands.holds import HoldController
from app.cell.commands.judge import PressGuard
from app.cell.commands.presses import Presses
from app.cell.commands.recipe_acts import RECIPE_ACTS, RecipeBooks, lock_of_recipe
from app.cell.commands.shift_acts import SHIFT_ACTS, needs_of_reason
from app.cell.link.declarations import declarations
from app.cell.link.peer import Peer, RobotAccess, RobotContext, RobotSignals
from app.cell.link.rosout import Rosout
from app.cell.permission.control import ControlAuthority
from app.cell.permission.interlocks import link_verdict
from app.cell.permission.roles import UNKNOWN_USERS, ConfirmLocks
from app.cell.permission.verdict import Verdict, locked
from app.cell.robot.log_lines import LogListener
from app.cell.robot.state import RobotState
from app.cell.robot.topics import Slices
from app.cell.session.alarms import Alarms
from app.cell.session.clock import ClockListener
from app.cell.session.frames import Frames
from app.cell.session.ingest import Ingest, SampleListener
from app.cell.session.looks import GraphSurvey, NodeRoundTrips, TopicPreviews
from app.cell.session.recipes import Recipes
from app.cell.session.turn import RobotAlarms, RobotCommands, Turn
from app.cell.view.publisher import ViewPublisher
from app.cell.view.refresh import NoOtherRobots, OtherRobots, ViewRefresher, ViewSources
from app.panel.frame_keys import needs_on_pages, shown_widgets, stops_of_several
from app.panel.model import Panel, RobotEntry
from app.panel.robot_panels import panel_of, widget_robots
from app.panel.rules import OeeRules
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.trend import trends_of
from app.records.press_record import Log, PressLog
from app.ros.dialects.dialect import Dialect, distribution_hashes
from app.ros.messages import Interfaces, load_interfaces
from app.ros.messages.names import ROSOUT_TOPIC
from app.ros.zenoh.config import Config
from app.ros.zenoh.declarations import Declarations
from app.ros.zenoh.session import ZenohSession
from app.system.errors import LinkError
from app.system.log import RobotLog
from app.system.texts import TextLike

if TYPE_CHECKING:
    from app.cell.commands.place_acts import RobotPlaces
    from app.cell.history.recording import Recorder, Recordings
    from app.cell.history.trends import TrendRecorder
    from app.cell.session.maps import MapListener
    from app.cell.session.place_file import SavedPlaceFile
    from app.cell.stops.changes import ChangeJournal, ChangeObserver


# Replaces a lost Zenoh session, with retries.

log = logging.getLogger("kiosk")

RENEW_AGAIN_S: Final = 1.0


class Renewal:
    """Renews one robot's Zenoh session. Used on the event loop only."""

    def __init__(self, link: ZenohSession, robot: RobotState) -> None:
        self._link = link
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._renewing: asyncio.Task[None] | None = None
        self._lost = False
        self._stopped = False

    def begin(self) -> None:
        """Opens a new session in a thread; another one afterwards if one is being opened already."""
        self._lost = True
        if self._renewing is None:
            self._renewing = asyncio.get_running_loop().create_task(self._renew())

    async def stop(self) -> None:
        """Waits for a session that is being opened."""
        self._stopped = True
        if self._renewing is not None:
            await asyncio.gather(self._renewing, return_exceptions=True)

    async def _renew(self) -> None:
        """Retries until a session is open that was not lost in the meantime."""
        while self._lost and not self._stopped:
            self._lost = False
            # Before the thread: a link that came up by now would be lost with the session, and the
            # new one be renewed for that again.
            self._link.forget()
            if self._robot.link_up:
                self._robot.mark_link_lost()
            try:
                await asyncio.to_thread(self._link.renew)
            except Exception as error:  # any error of Zenoh: without a session everything stays locked
                self._log.error("%s", error)
                self._lost = True
                await asyncio.sleep(RENEW_AGAIN_S)
        self._robot.graph.own_zid = self._link.zid
        self._renewing = None


STARTING_S: Final = 3.0  # in which a robot is joined; until then its absence is not a fault


class SessionRecorder(SampleListener, Protocol):
    """A listener that keeps samples until it is stopped."""

    def stop(self) -> None: ...


class PlaceActs(NamedTuple):
    """The saved places of a robot, and what runs the acts on them."""

    places: "RobotPlaces"
    runner: "ActRunner[RobotPlaces]"


@dataclass(eq=False, kw_only=True)
class RobotSession:
    """The session with one robot, opened by `start`, closed by `stop`. Used on the event loop only.
    `entry` is the robot's if the panel has several robots, `base` the path of its pages."""

    context: RobotContext
    entry: RobotEntry | None
    base: str
    operators_log: Log
    control: ControlAuthority
    control_acts: ActRunner[ControlAuthority]
    alarm_acts: ActRunner[AlarmEngine]
    recipe_acts: ActRunner[RecipeBooks]
    place_acts: "PlaceActs | None"
    diagnostic_acts: ActRunner[Doctor]
    shift_acts: ActRunner[OeeRules | None]
    press_guard: PressGuard
    press_log: PressLog
    refresher: ViewRefresher
    peer: Peer
    commands: RobotCommands
    ingest: Ingest
    turn: Turn
    frames: Frames
    survey: GraphSurvey
    node_trips: NodeRoundTrips
    looks: TopicPreviews
    renewal: Renewal
    rosout: Rosout
    clock: ClockListener
    recorders: Sequence[SessionRecorder]
    _listeners: ExitStack = field(default_factory=ExitStack, init=False)

    @property
    def panel(self) -> Panel:
        return self.context.panel

    @property
    def interfaces(self) -> Interfaces:
        return self.context.interfaces

    @property
    def robot(self) -> RobotState:
        return self.context.robot

    @property
    def link(self) -> ZenohSession:
        return self.context.link

    @property
    def publisher(self) -> ViewPublisher:
        return self.refresher.publisher

    @property
    def dispatcher(self) -> Dispatcher:
        return self.commands.dispatcher

    @property
    def presses(self) -> Presses:
        return self.commands.presses

    @property
    def holds(self) -> HoldController:
        return self.commands.holds

    async def start(self) -> None:
        """Declares subscribers, publishers and queries. Does not wait for the robot."""
        await self.commands.start()
        self.robot.starting_until = time.monotonic() + STARTING_S
        self.interfaces.prepare_codecs(
            {*self.panel.subscriptions().values(), *self.panel.publications().values()}
        )
        self.link.start(self._declared())
        self.rosout.start()
        self.peer.start()
        self._listeners.enter_context(self.operators_log.notifying(self.show))
        self.show()

    def _declared(self) -> Declarations:
        declared = declarations(self.panel, self.interfaces, self.robot)
        return replace(
            declared,
            immediate=self.ingest.immediate,
            lossless=self.ingest.lossless,
            recorded=self.ingest.recorded,
            changing=self.ingest.changing,
        )

    async def stop(self) -> None:
        """Ends the streams, all tasks and the Zenoh session."""
        self.close()
        self.frames.close()
        self.turn.stop()
        self._listeners.close()
        self.rosout.stop()
        self.clock.stop()
        self.refresher.stop()
        self.press_guard.close()
        await self.looks.stop()
        await self.survey.stop()
        await self.node_trips.stop()
        await self.renewal.stop()
        await self.peer.stop()
        await self.commands.stop()
        for recorder in self.recorders:
            recorder.stop()
        try:
            await asyncio.to_thread(self.link.close)
        except LinkError as error:
            RobotLog(log, self.robot.name).warning("%s", error)

    def close(self) -> None:
        """Ends holds, while their stop messages can still be sent, presses and streams."""
        self.commands.close()
        self.publisher.close()

    def show(self) -> None:
        """Updates holds and the view. Call it after a change of a permission or of anything shown."""
        self.turn.changed()

    @property
    def link_verdict(self) -> Verdict:
        """Whether commands can reach the robot now."""
        if self.operators_log.lock:
            return Verdict(False, "log", self.operators_log.lock)
        return link_verdict(self.robot, time.monotonic())

    async def check_readiness(self) -> Verdict:
        """`link_verdict` after a query of its peer, which takes at most a second."""
        if not self.link_verdict.permitted or await self.peer.answers():
            return self.link_verdict
        verdict, silent = self.link_verdict, self.robot.traits.sentences.silent
        return locked(silent) if verdict.permitted else verdict

    def watch(self) -> None:
        """Call it when clients see other widgets of the robot than before."""
        shows_more = self.refresher.watch()
        self.turn.watch(self.ingest.only_shown(self.refresher.unseen_keys))
        if shows_more:
            self.refresher.refresh_seen()

    def read_again(self, widget_id: str) -> TextLike:
        """Queries the node of a parameter; returns why it can't be queried, else "". NotFound for other
        ids."""
        return self.commands.parameters.read_again(self.panel.widget(widget_id, Parameter))

    def reopen(self) -> None:
        """Replaces a working Zenoh session. The old one still sends the stop messages of holds."""
        self.holds.end_all(self.robot.traits.sentences.renewal)
        self.renew()

    def renew(self) -> None:
        """Replaces the Zenoh session. Until the new one has joined, no endpoint is known."""
        self.robot.mark_link_lost()
        self.turn.on_graph_change(peer_appeared=False)
        self.show()
        self.link.expect(self._declared())  # the dialect may be another one
        self.renewal.begin()


# Wires a session with one robot: its signals first, then each part by its constructor.

ALONE: Final = NoOtherRobots()


@dataclass(frozen=True, slots=True)
class ServerParts:
    """The parts that all sessions share; `revision` is that of the page's files, `root_path` that below
    which a proxy shows all pages, `link` makes the session with a robot's peer."""

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
    place_file: "SavedPlaceFile | None" = None
    journal: "ChangeJournal | None" = None
    link: Callable[[Config, Callable[[bool], None], Dialect], ZenohSession] = ZenohSession


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
    pages, needs = shown_widgets(panel, entry.id if entry else None), needs_on_pages(panel, entry)
    stops = stops_of_several(panel, entry.id) if entry else {}
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
        {name: str(key.widget.id) for name, key in stops.items()},
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
    if recorder is not None:
        signals.stopped.connect(recorder.record_stop)
    recorders: list[SessionRecorder] = [*([recorder] if recorder else []), *_trend_recorders(context)]
    commands = RobotCommands(context, peer, press_guard, press_log, recorder, recipes)
    published_alarms = PublishedAlarms(
        panel,
        entry.id if entry else "",
        context.interfaces,
        robot.possible_keys,
        robot.slices,
        robot_alarms.entries_received,
        robot_alarms.has_begun,
    )
    robot_alarms.evaluation_began.connect(published_alarms.resume)
    log_lines = LogListener(robot.log_lines, robot.namespace)
    map_listeners = [*_map_listeners(context)]
    for listener in map_listeners:
        listener.register(commands.sample_handlers)
    ingest = Ingest(
        panel,
        robot,
        commands.sample_handlers,
        [robot.table_entries, log_lines, published_alarms, *recorders, *map_listeners],
        _observers(server, context),
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
        place_acts=_place_acts(server, robot, signals, act_context),
        diagnostic_acts=ActRunner("diagnostics", DIAGNOSTIC_ACTS, server.doctor, act_context),
        shift_acts=ActRunner(
            "alarm",
            SHIFT_ACTS,
            context.panel.oee,
            act_context,
            partial(needs_of_reason, context.panel.oee),
        ),
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
        looks=TopicPreviews(context),
        renewal=Renewal(link, robot),
        rosout=Rosout(robot, context.interfaces, link, asyncio.get_running_loop(), own_line),
        clock=ClockListener(context, partial(peer.on_graph_change, False)),
        recorders=recorders,
    )
    _connect(signals, robot_alarms, session)
    return session


def _observers(server: ServerParts, context: RobotContext) -> "list[ChangeObserver]":
    """What records the changes from which a stop is explained; nothing on a panel without a journal."""
    if server.journal is None:
        return []
    from app.cell.stops.changes import ChangeObserver

    observer = ChangeObserver(context.panel, context.robot, server.journal)
    observer.on_stop = context.signals.stopped.emit
    context.signals.stepped.connect(observer.step)
    context.signals.ran.connect(observer.finish)
    return [observer]


def _place_acts(
    server: ServerParts, robot: RobotState, signals: RobotSignals, context: ActContext
) -> "PlaceActs | None":
    """The acts on the saved places of one robot, which its view shows from now on; None for a panel on
    which none can be saved, which does not import them."""
    file = server.place_file
    if file is None:
        return None
    from app.cell.commands.place_acts import PLACE_ACTS, RobotPlaces, needs_of_places

    def follow() -> None:
        robot.saved_places = file.saved.of_robot(robot.id)
        signals.changed.emit()

    file.add_listener(follow)
    places = RobotPlaces(server.panel, robot, file, time.monotonic)
    needs = partial(needs_of_places, server.panel)
    return PlaceActs(places, ActRunner("place", PLACE_ACTS, places, context, needs))


def _context(
    server: ServerParts, panel: Panel, config: Config, access: RobotAccess, entry: RobotEntry | None
) -> RobotContext:
    """The state of the robot and the link to it. `panel` is the robot's."""
    signals = RobotSignals()
    interfaces = load_interfaces(panel.distro, panel.interfaces)
    hashes = distribution_hashes(panel.distro, interfaces)
    dialect = access.dialect((entry or panel).domain, hashes)
    link = server.link(config, signals.arrived.emit, dialect)
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
    signals.ran.connect(session.clock.update)
    signals.changed.connect(turn.changed)
    signals.status_set.connect(turn.status_set)
    robot_alarms.stopped.connect(signals.stopped.emit)
    robot_alarms.rows_changed.connect(refresher.refresh_alarms)
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
    from app.cell.history.recording import Recorder

    recordings.add_listener(context.signals.changed.emit)
    name = entry.id if entry else ""
    return Recorder(panel, panel.record, context.interfaces, context.robot, name, recordings)


def _map_listeners(context: RobotContext) -> "Iterator[MapListener]":
    """What reads maps and transforms, if the panel shows a map."""
    if context.robot.maps:
        from app.cell.session.maps import MapListener

        yield MapListener(context, _map_listening(context))


def _map_listening(context: RobotContext) -> Callable[[str], None]:
    """Takes the key of a map or layer that was read: what it shows is shown, and what depends on a map
    with places is judged again."""
    robot, signals = context.robot, context.signals
    views = (robot.map_views[each.map] for each in context.panel.map_inputs)
    grids = ({level.topic for level in view.maps} | {m.topic for m in view.keep_out} for view in views)
    of_places = {robot.key(topic) for topics in grids for topic in topics}

    def changed(key: str) -> None:
        signals.entries_decoded.emit(key)
        if key in of_places:
            signals.changed.emit()

    return changed


def _trend_recorders(context: RobotContext) -> "Iterator[TrendRecorder]":
    """The recorder of what trends show and alarms have limits for, if the panel has any."""
    if trends_of(context.panel) or any(alarm.limited_value for alarm in context.panel.alarms):
        from app.cell.history.trends import TrendRecorder

        yield TrendRecorder(context.panel, context.interfaces, context.robot)


def _show_own_line(robot: RobotState, refresher: ViewRefresher, payload: bytes) -> None:
    """The panel's own line in the robot's log: Zenoh does not bring it back."""
    key = robot.key(ROSOUT_TOPIC)
    if (lines := robot.log_lines.get(key)) is not None:
        lines.add(payload)
        refresher.refresh_values({key})
