"""The sources of alarms: a robot's state, and what the server sees of itself. Pure functions."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any, Final, Literal, NamedTuple

from app.cell.alarms.published import AlarmEntry
from app.cell.alarms.states import PLAIN, AlarmLimit, AlarmRules, Definition, Delays
from app.cell.permission.conditions import fresh_since, permits
from app.cell.permission.interlocks import link_verdict
from app.cell.robot.state import RobotState
from app.cell.robot.topics import kept_s
from app.panel.alarm import Alarm, SourceKind
from app.panel.condition import Condition
from app.panel.numbers import shown_number
from app.panel.shared_keys import stale_at
from app.panel.widgets.parameter import GET
from app.system.clock import format_age, format_time
from app.system.printable import one_line
from app.system.texts import TextLike, number, say

# From a robot's state to what the source of an alarm says now. Pure functions.


class SourceReading(NamedTuple):
    """What a source says: `value` is that of a field, and `met` whether a condition without limits is.
    Both are None while it is unknown. `until` (monotonic seconds) is when time alone changes it."""

    value: float | None = None
    met: bool | None = None
    until: float = math.inf

    @property
    def is_known(self) -> bool:
        return self.value is not None or self.met is not None

    def exceeds(self, limit: AlarmLimit | None, before: bool) -> bool:
        """Whether it exceeds a limit, or its condition is met if there is no limit."""
        if limit is None or self.value is None:
            return self.met is True
        return limit.is_exceeded(self.value, before)


UNKNOWN: Final = SourceReading()
CONNECTS_WITHIN_S: Final = 10.0  # after the start of the server
CATCHING_UP: Final = "link_catching_up"  # for a moment, after the event loop stalled


def read_source(alarm: Alarm, robot: RobotState, now: float, began_at: float) -> SourceReading:
    """What the source of an alarm says at `now`; `began_at` is when the server began to listen. Both in
    monotonic seconds."""
    read = READERS.get(alarm.source) if alarm.source else None
    return read(alarm, robot, now, began_at) if read else UNKNOWN


def _read_field(alarm: Alarm, robot: RobotState, now: float, _: float) -> SourceReading:
    link = link_verdict(robot, now)
    if alarm.topic is None or not (link.permitted or link.code == CATCHING_UP):
        return SourceReading(until=link.until)
    reading = robot.reading(alarm.topic).of_field(alarm.field, kept_s(alarm.max_age_s))
    value = reading.value(alarm.field) if reading.status in ("message", "reading") else None
    if not isinstance(value, int | float):
        return UNKNOWN
    until = stale_at(reading.at, alarm.max_age_s)
    if now >= until:
        return UNKNOWN
    return SourceReading(value=shown_number(alarm, value), until=until)


def _read_node(alarm: Alarm, robot: RobotState, now: float, _: float) -> SourceReading:
    link = link_verdict(robot, now)
    if alarm.node is None or not (link.permitted or link.code == CATCHING_UP):
        return SourceReading(until=link.until)
    return SourceReading(met=not has_node(robot, alarm.node))


def has_node(robot: RobotState, node: str) -> bool:
    """Whether a node is there: its parameter services are."""
    return robot.graph.server_type("SS", robot.key(f"{node}/{GET[0]}")) is not None


def _read_condition(alarm: Alarm, robot: RobotState, now: float, _: float) -> SourceReading:
    return UNKNOWN if alarm.when is None else read_condition(alarm.when, robot, now)


def read_condition(condition: Condition, robot: RobotState, now: float) -> SourceReading:
    """Whether a condition is met; unknown while its value is not known, or too old. A value that may
    have been replayed can raise an alarm, but not say that there is none."""
    link = link_verdict(robot, now)
    if not (link.permitted or link.code == CATCHING_UP):
        return SourceReading(until=link.until)
    reading = robot.reading(condition.topic).of_field(condition.field, kept_s(condition.max_age_s))
    value = reading.value(condition.field) if reading.status in ("message", "reading") else None
    if value is None or value != value:
        return UNKNOWN
    until = stale_at(reading.at, condition.max_age_s)
    met, key = permits(condition, value), robot.key(condition.topic)
    is_aged = condition.max_age_s is not None and reading.at < fresh_since(robot, key)
    is_doubtful = is_aged or robot.silent_publishers.has_silent(key, robot.peers_of(key))
    if now >= until or (not met and is_doubtful):
        return UNKNOWN
    return SourceReading(met=met, until=until)


def read_suppression(alarm: Alarm, robot: RobotState | None, now: float) -> SourceReading:
    """Whether the condition of `while` is met; unknown without one."""
    if alarm.suppressed_while is None or robot is None:
        return UNKNOWN
    return read_condition(alarm.suppressed_while, robot, now)


def _read_age(alarm: Alarm, robot: RobotState, now: float, began_at: float) -> SourceReading:
    if alarm.topic is None or alarm.stale_s is None:
        return UNKNOWN
    until = stale_at(max(robot.reading(alarm.topic).at, began_at), alarm.stale_s)
    return SourceReading(met=True) if now >= until else SourceReading(met=False, until=until)


def _read_loss(alarm: Alarm, robot: RobotState, now: float, began_at: float) -> SourceReading:
    """Whether the link is lost; unknown while the server connects after its start."""
    lost = not robot.link_up
    if alarm.lost == "robot":
        lost = lost or not robot.graph.peers or robot.graph.has_silent_peer or not robot.is_responding
    if lost and now < began_at + CONNECTS_WITHIN_S:
        return SourceReading(until=began_at + CONNECTS_WITHIN_S)
    return SourceReading(met=lost)


READERS: Final[Mapping[SourceKind, Callable[[Alarm, RobotState, float, float], SourceReading]]] = {
    "limits": _read_field,
    "condition": _read_condition,
    "stale": _read_age,
    "node": _read_node,
    "lost": _read_loss,
}


def link_state(robot: RobotState, now: float, nodes: Iterable[str] = ()) -> tuple[Any, ...]:
    """What the readings of all alarms of a robot depend on, with the `nodes` whose loss is an alarm: if
    it differs, each may have changed."""
    graph = robot.graph
    link = link_verdict(robot, now).code
    is_permitted = link in ("permitted", CATCHING_UP)
    return (
        robot.link_up,
        robot.is_responding,
        graph.has_silent_peer,
        frozenset(graph.peers),
        "" if is_permitted else link,
        *(has_node(robot, node) for node in nodes),
    )


# The panel's own alarms, of the operator's log, the disk, the clock, certificates, the broker of
# MQTT, the central database, the users' file, tried sign-ins and the alarms themselves. Pure: from
# what the server sees to entries.

OwnAlarm = Literal[
    "panel_log",
    "panel_disk",
    "panel_clock",
    "panel_certificate",
    "panel_mqtt",
    "panel_forward",
    "panel_site",
    "panel_users",
    "panel_sign_in",
    "panel_alarms_lost",
    "panel_alarms_full",
]
PRIORITIES: Final[dict[OwnAlarm, int]] = {
    "panel_log": 2,
    "panel_disk": 3,
    "panel_clock": 3,
    "panel_certificate": 2,
    "panel_mqtt": 3,
    "panel_forward": 3,
    "panel_site": 3,
    "panel_users": 2,
    "panel_sign_in": 2,
    "panel_alarms_lost": 2,
    "panel_alarms_full": 2,
}
UNKEPT: Final = frozenset({"panel_log", "panel_disk"})
JUMP_S: Final = 5.0  # a smaller step of the clock is not raised
CERTIFICATE_DAYS: Final = 30  # before its end, a certificate raises the alarm
ROUTER_WITHIN_S: Final = 30.0  # without a router for the cell's summary, the alarm is raised
SHOWN_TWIN: Final = 200  # characters
BROKER_WITHIN_S: Final = 30.0  # without a connection to the broker, the alarm is raised
FORWARDS_WITHIN_S: Final = 300.0  # without a connection to the central database, the alarm is raised
SHOWN_ADDRESSES: Final = 3
NAMED: Final = 10  # ids in a sentence
ENOUGH: Final = 1.1  # of the free space below which the alarm is raised, until it returns


def own_definitions() -> Iterator[tuple[OwnAlarm, Definition]]:
    """The panel's own alarms, which are of no robot."""
    for name, priority in PRIORITIES.items():
        alarm = Alarm.model_construct(
            id=name, priority=priority
        )  # a panel without alarms has no schema
        rules = AlarmRules(PLAIN, (priority,))
        yield name, Definition(name, "", alarm, rules, Delays(), (None,))


def is_kept(definition: Definition) -> bool:
    """Whether an alarm is kept on the disk: not one that says that the disk can't be written."""
    return definition.id not in UNKEPT


def log_entry(fault: TextLike, is_required: bool) -> AlarmEntry:
    """Of the operator's log: why it can't be written, "" if it can. `is_required`: presses are locked
    as long."""
    consequence = say("own_log_locks") if is_required else say("own_log_missing")
    texts = OwnTexts(say("own_log"), fault, consequence, say("own_log_action"))
    return _entry("panel_log", bool(fault), texts)


def disk_entry(free_mb: float, least_mb: float, was_low: bool) -> AlarmEntry:
    """Of the disk with the panel's data."""
    cause = say("own_disk_free", free=_megabytes(free_mb), least=_megabytes(least_mb))
    texts = OwnTexts(say("own_disk"), cause, say("own_disk_not_written"), say("own_disk_action"))
    return _entry("panel_disk", free_mb < least_mb * (ENOUGH if was_low else 1.0), texts)


def clock_entry(by_s: float, before: float) -> AlarmEntry:
    """Of the clock, which was set by so many seconds, 0 for none; `before` is the time that it showed,
    in seconds since the epoch."""
    by, old, new = format_age(round(abs(by_s))), format_time(before), format_time(before + by_s)
    cause = say("own_clock_back", by=by, before=old, after=new)
    if by_s > 0:
        cause = say("own_clock_ahead", by=by, before=old, after=new)
    texts = OwnTexts(say("own_clock"), cause, say("own_clock_times"), say("own_clock_action"))
    return _entry("panel_clock", abs(by_s) >= JUMP_S, texts)


def certificate_entry(file: str, until: datetime, now: datetime) -> AlarmEntry:
    """Of the certificate that ends first."""
    code = "own_certificate_ends" if until > now else "own_certificate_ended"
    cause = say(code, file=file, until=until.date().isoformat())
    texts = OwnTexts(
        say("own_certificate"), cause, say("own_certificate_shut"), say("own_certificate_action")
    )
    return _entry("panel_certificate", until - now < timedelta(days=CERTIFICATE_DAYS), texts)


def unused_certificate_entry(file: str) -> AlarmEntry:
    """Of the server's new certificate, which can't be used."""
    texts = OwnTexts(
        say("own_certificate_unused"),
        say("own_certificate_broken", file=file),
        say("own_certificate_old_stays"),
        say("own_certificate_repair"),
    )
    return _entry("panel_certificate", True, texts)


def broker_entry(address: str, why: str, lost_s: float) -> AlarmEntry:
    """Of the broker that alarms are published at, without a connection for `lost_s` seconds, 0 with
    one."""
    within = number(f"{BROKER_WITHIN_S:g}", "s")
    cause = say("own_mqtt_lost", address=address, within=within, why=why)
    texts = OwnTexts(say("own_mqtt"), cause, say("own_mqtt_unpublished"), say("own_mqtt_action"))
    return _entry("panel_mqtt", lost_s >= BROKER_WITHIN_S, texts)


def forward_entry(address: str, why: TextLike, lost_s: float) -> AlarmEntry:
    """Of the central database, to which nothing could be sent for `lost_s` seconds."""
    within = format_age(round(FORWARDS_WITHIN_S))
    cause = say("own_forward_lost", address=address, within=within, why=why)
    texts = OwnTexts(say("own_forward"), cause, say("own_forward_kept"), say("own_forward_action"))
    return _entry("panel_forward", lost_s >= FORWARDS_WITHIN_S, texts)


def site_entry(name: str, twin: str, lost_s: float) -> AlarmEntry:
    """Of the cell's summary: `twin` is another panel that publishes with its name, "" for none. No
    router was reached for `lost_s` seconds."""
    within = number(f"{ROUTER_WITHIN_S:g}", "s")
    cause = say("own_site_lost", within=within)
    title, action = say("own_site"), say("own_site_action")
    if twin:
        cause = say("own_site_twin", name=name, other=one_line(twin, SHOWN_TWIN))
        title, action = say("own_site_names"), say("own_site_rename")
    texts = OwnTexts(title, cause, say("own_site_unseen"), action)
    return _entry("panel_site", bool(twin) or lost_s >= ROUTER_WITHIN_S, texts)


def users_entry(fault: TextLike) -> AlarmEntry:
    """Of the users' file: why no one can sign in, "" if they can."""
    texts = OwnTexts(say("own_users"), fault, say("own_users_locked"), say("own_users_action"))
    return _entry("panel_users", bool(fault), texts)


def sign_in_entry(user: str, addresses: Sequence[str]) -> AlarmEntry:
    """Of secrets that are tried on other machines: those of a user, "" for several; without addresses
    no one tries."""
    newest = tuple(addresses[: -SHOWN_ADDRESSES - 1 : -1])
    code = "own_sign_in_of_user" if user else "own_sign_in_of_several"
    cause = say(code, user=user, addresses=newest, count=len(addresses))
    texts = OwnTexts(say("own_sign_in"), cause, say("own_sign_in_waits"), say("own_sign_in_action"))
    return _entry("panel_sign_in", bool(addresses), texts)


def lost_entry(cause: TextLike) -> AlarmEntry:
    """Of alarms that stood, or their history, which can't be read. It stands until it is
    acknowledged."""
    texts = OwnTexts(say("own_lost"), cause, say("own_lost_unknown"), say("own_lost_action"))
    return _entry("panel_alarms_lost", bool(cause), texts)


def unreadable_records(ids: Sequence[str]) -> TextLike:
    """Which records of alarms can't be read."""
    names = ", ".join(one_line(name) for name in ids[:NAMED])
    more = len(ids) - NAMED
    if more > 0:
        return say("own_lost_records_more", names=names, more=number(str(more)))
    return say("own_lost_records", names=names)


def full_entry(left_out: int) -> AlarmEntry:
    """Of alarms of the robots for which there is no room."""
    cause = say("own_full_left_out", count=number(str(left_out)))
    texts = OwnTexts(say("own_full"), cause, say("own_full_unseen"), say("own_full_action"))
    return _entry("panel_alarms_full", left_out > 0, texts)


class OwnTexts(NamedTuple):
    """What the operator reads."""

    text: TextLike
    cause: TextLike
    consequence: TextLike
    action: TextLike


def _entry(name: OwnAlarm, is_active: bool, texts: OwnTexts) -> AlarmEntry:
    return AlarmEntry(name, int(is_active), texts.text, (PRIORITIES[name],), *texts[1:])


def _megabytes(value: float) -> TextLike:
    return number(f"{value:.0f}", "MB")
