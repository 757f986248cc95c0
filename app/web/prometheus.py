"""The counts in Prometheus's text format, gathered when it asks."""

import time
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from itertools import product
from typing import TYPE_CHECKING, Final

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import (
    CounterMetricFamily,
    GaugeMetricFamily,
    InfoMetricFamily,
    Metric,
    SummaryMetricFamily,
)
from prometheus_client.registry import Collector

from app.cell.alarms.shown import LISTED_STATES, PRIORITIES
from app.cell.permission.robot_options import options_now
from app.cell.session.alarm_mqtt import AlarmMqtt
from app.cell.session.alarms import Alarms
from app.cell.session.fleet import Fleet
from app.cell.stops.oee import NOT_ANSWERED, SHORT, ShiftFigures
from app.cell.view.machine_status import Machine
from app.panel.rules import OeeRules
from app.ros.zenoh.answers import callback_errors
from app.system.texts import render
from app.web.metrics import Metrics

if TYPE_CHECKING:
    from app.cell.forward.status import ForwardStatus
    from app.cell.site.wall import Wall

SHIFT_FIGURES: Final = {
    "availability": "Availability of the shift",
    "performance": "Performance of the shift",
    "quality": "Quality of the shift",
    "oee": "Overall equipment effectiveness of the shift",
}


def exposition(metrics: Metrics) -> tuple[bytes, str]:
    """The exposition and its media type."""
    registry = CollectorRegistry()
    registry.register(_Of(metrics))
    return generate_latest(registry), CONTENT_TYPE_LATEST


class _Of(Collector):
    def __init__(self, metrics: Metrics) -> None:
        self._metrics = metrics

    def collect(self) -> Iterator[Metric]:
        metrics = self._metrics
        about = "Refused presses that the operator's log only counts"
        yield CounterMetricFamily("kiosk_refusals_left_out", about, value=metrics.left_out())
        about = "Presses, holds and cancels over their limit, answered 429"
        yield CounterMetricFamily("kiosk_presses_limited", about, value=metrics.limited())
        about = "Callbacks of Zenoh's that failed: each has lost a message or an answer"
        yield CounterMetricFamily("kiosk_zenoh_callback_errors", about, value=callback_errors.count)
        about = "Entries of the operator's log that a copy of it lacks"
        uncopied = GaugeMetricFamily("kiosk_log_uncopied", about, labels=["copy"])
        for place, entries in metrics.uncopied().items():
            uncopied.add_metric([place], entries)
        yield uncopied
        presses = CounterMetricFamily("kiosk_presses", "Presses by outcome", labels=["outcome"])
        for outcome, count in metrics.presses.items():
            presses.add_metric([outcome], count.value, created=count.since)
        yield presses
        yield GaugeMetricFamily("kiosk_streams", "Open event streams", value=metrics.streams.count)
        if metrics.fleet is not None:
            yield from _of_fleet(metrics.fleet)
            yield from _of_alarms(metrics.fleet.alarms)
            if metrics.fleet.machine is not None:
                yield from _of_machine(metrics.fleet.machine.now)
            if metrics.fleet.alarms.mqtt.address:
                yield from _of_mqtt(metrics.fleet.alarms.mqtt)
            if (rules := metrics.fleet.panel.oee) is not None:
                yield from _of_shift(metrics.shift, rules)
            if metrics.fleet.forward is not None:
                yield from _of_forward(metrics.fleet.forward.status)
        if metrics.wall is not None:
            yield from _of_wall(metrics.wall)


def _of_wall(wall: "Wall") -> Iterator[Metric]:
    """Of all cells together, so that a thousand cells are as many lines as one."""
    from app.cell.site.cells import TILE_KINDS

    about = "1 while the wall is connected to a router"
    yield GaugeMetricFamily("kiosk_wall_connected", about, value=wall.is_connected)
    cells = GaugeMetricFamily("kiosk_wall_cells", "Cells by state", labels=["state"])
    counts = wall.table.counts()
    for kind in TILE_KINDS:
        cells.add_metric([kind], counts[kind])
    yield cells
    alarms = GaugeMetricFamily(
        "kiosk_wall_alarms", "Alarms of the cells", labels=["priority", "acknowledged"]
    )
    for priority, (acknowledged, unacknowledged) in wall.table.alarms_by_priority.items():
        alarms.add_metric([priority, "yes"], acknowledged)
        alarms.add_metric([priority, "no"], unacknowledged)
    yield alarms
    about = "The age of the oldest summary of a cell that has contact"
    oldest = wall.table.oldest_s(time.monotonic())
    yield GaugeMetricFamily("kiosk_wall_oldest_seconds", about, value=oldest)
    about = "Cells that found no room on the wall, or have a name that is none"
    yield CounterMetricFamily("kiosk_wall_left_out", about, value=wall.table.left_out)


def _of_alarms(alarms: Alarms) -> Iterator[Metric]:
    listed = GaugeMetricFamily(
        "kiosk_alarms", "Alarms that are not normal, or shelved", labels=["priority", "state"]
    )
    counts = Counter((row["priority"], row["state"]) for row in alarms.rows())
    for priority, state in product(PRIORITIES, LISTED_STATES):
        listed.add_metric([str(priority), state], counts[priority, state])
    yield listed
    raised = CounterMetricFamily(
        "kiosk_alarms_raised", "How often alarms were raised", labels=["priority"]
    )
    acknowledged = SummaryMetricFamily(
        "kiosk_alarm_acknowledge_seconds",
        "From the raise of an alarm to its acknowledgement",
        labels=["priority"],
    )
    for priority in PRIORITIES:
        raised.add_metric([str(priority)], alarms.counts.raised[priority])
        count, seconds = alarms.counts.acknowledged[priority], alarms.counts.acknowledge_s[priority]
        acknowledged.add_metric([str(priority)], count, seconds)
    yield raised
    yield acknowledged


def _of_machine(machine: Machine) -> Iterator[Metric]:
    about = "1 while the panel's own clock follows a time source; nothing if that is not known"
    synchronised = GaugeMetricFamily("kiosk_time_synchronised", about)
    if machine.time.synchronised is not None:
        synchronised.add_metric([], int(machine.time.synchronised))
    yield synchronised
    about = "How far the panel's own clock is from its time source at most"
    error = GaugeMetricFamily("kiosk_time_error_seconds", about)
    if machine.time.within_s is not None:
        error.add_metric([], machine.time.within_s)
    yield error
    if machine.weaknesses is not None and not machine.weaknesses.fault:
        about = "Known weaknesses that concern what is installed, by the VEX file"
        affected = len(machine.weaknesses.affected)
        yield GaugeMetricFamily("kiosk_weaknesses", about, value=affected)


def _of_mqtt(mqtt: AlarmMqtt) -> Iterator[Metric]:
    yield GaugeMetricFamily(
        "kiosk_alarms_mqtt_connected", "1 while the broker has a connection", value=mqtt.is_connected
    )
    yield CounterMetricFamily(
        "kiosk_alarms_mqtt_published", "Transitions that the broker has", value=mqtt.published
    )
    yield CounterMetricFamily(
        "kiosk_alarms_mqtt_dropped", "Transitions that found no room", value=mqtt.dropped
    )


def _of_shift(shift: Mapping[str, ShiftFigures], rules: OeeRules) -> Iterator[Metric]:
    """The figures of the shift up to now; what is not known is left out. Reasons that the panel file no
    longer has count as "?"."""
    figures = {
        name: GaugeMetricFamily(f"kiosk_shift_{name}", f"{about}, 0 to 1", labels=["robot"])
        for name, about in SHIFT_FIGURES.items()
    }
    about = 'Down time by reason; "" is not answered, "-" a short stop'
    stopped = GaugeMetricFamily("kiosk_shift_stop_seconds", about, labels=["robot", "reason"])
    known = {NOT_ANSWERED, SHORT, *(reason.id for reason in rules.reasons)}
    for robot, of_robot in shift.items():
        for name, family in figures.items():
            if (value := getattr(of_robot, name)) is not None:
                family.add_metric([robot], value)
        seconds: defaultdict[str, float] = defaultdict(float)
        for row in of_robot.reasons:
            seconds[row.reason if row.reason in known else "?"] += row.seconds
        for reason in sorted(known | seconds.keys()):
            stopped.add_metric([robot, reason], seconds[reason])
    yield from (*figures.values(), stopped)


def _of_forward(status: "ForwardStatus") -> Iterator[Metric]:
    yield GaugeMetricFamily(
        "kiosk_forward_connected", "1 while entries reach the central database", value=status.connected
    )
    unsent = GaugeMetricFamily(
        "kiosk_forward_unsent", "Rows that the central database lacks", labels=["stream"]
    )
    for stream, rows in status.unsent.items():
        unsent.add_metric([stream], rows)
    yield unsent
    about = "About how many bytes the rows have that the central database lacks"
    yield GaugeMetricFamily("kiosk_forward_unsent_bytes", about, value=status.size)
    about = "The age of the oldest row that the central database lacks"
    yield GaugeMetricFamily("kiosk_forward_lag_seconds", about, value=status.lag_s(time.time()))
    yield CounterMetricFamily(
        "kiosk_forward_sent", "Rows that were sent to the central database", value=status.sent
    )


def _of_fleet(fleet: Fleet) -> Iterator[Metric]:
    """`robot` is the id of a `[[robot]]`, "" where there is one without."""
    panel = fleet.panel
    robots = InfoMetricFamily("kiosk_robot", "The name of each [[robot]]", labels=["robot"])
    for robot_id, title in panel.robot_names.items():
        robots.add_metric([robot_id], {"name": render(title, panel.readers_languages[0])})
    yield robots
    up = GaugeMetricFamily("kiosk_link_up", "1 while Zenoh has a link", labels=["robot"])
    bridges = GaugeMetricFamily("kiosk_bridges", "ROS 2 bridges seen", labels=["robot"])
    ready = GaugeMetricFamily("kiosk_ready", "1 while commands can reach the robot", labels=["robot"])
    unreadable = CounterMetricFamily(
        "kiosk_undecodable", "Samples looked at that were not their type", labels=["robot", "key"]
    )
    listed = GaugeMetricFamily(
        "kiosk_options_known",
        "1 while the robot's list of options is known",
        labels=["robot", "select"],
    )
    skews = GaugeMetricFamily(
        "kiosk_clock_skew_seconds",
        "How far the robot's clock is ahead of the panel's",
        labels=["robot"],
    )
    simulated = GaugeMetricFamily(
        "kiosk_simulated_time", "1 while the robot runs on simulated time", labels=["robot"]
    )
    for session in fleet.sessions:
        robot, name = session.robot, session.entry.id if session.entry else ""
        up.add_metric([name], int(robot.link_up))
        bridges.add_metric([name], len(robot.graph.peers))
        ready.add_metric([name], int(session.link_verdict.permitted))
        simulated.add_metric([name], int(robot.clock.simulated is not None))
        if robot.clock.skew is not None:
            skews.add_metric([name], robot.clock.skew.seconds)
        for key, count in robot.traffic.undecodable.items():
            unreadable.add_metric([name, key], count)
        for select in session.panel.listed_selects:
            if select.options_from is not None:
                now = options_now(select, select.options_from, robot, time.monotonic())
                listed.add_metric([name, select.id], int(now.verdict.permitted))
    yield from (up, bridges, ready, skews, simulated, unreadable, listed)
