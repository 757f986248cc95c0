"""The panel's own alarms, of the operator's log, the disk, the clock, certificates and the broker of
MQTT. Pure: from what the server sees to entries."""

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final, Literal, NamedTuple

from app.alarms.delays import Delays
from app.alarms.entries import AlarmEntry
from app.alarms.instance import Definition
from app.alarms.states import PLAIN
from app.alarms.status import AlarmRules
from app.clock import format_age, format_time
from app.i18n import TextLike, number, say
from app.panel.alarm import Alarm

OwnAlarm = Literal["panel_log", "panel_disk", "panel_clock", "panel_certificate", "panel_mqtt"]
PRIORITIES: Final[dict[OwnAlarm, int]] = {
    "panel_log": 2,
    "panel_disk": 3,
    "panel_clock": 3,
    "panel_certificate": 2,
    "panel_mqtt": 3,
}
UNKEPT: Final = frozenset({"panel_log", "panel_disk"})
JUMP_S: Final = 5.0  # a smaller step of the clock is not raised
CERTIFICATE_DAYS: Final = 30  # before its end, a certificate raises the alarm
BROKER_WITHIN_S: Final = 30.0  # without a connection to the broker, the alarm is raised
ENOUGH: Final = 1.1  # of the free space below which the alarm is raised, until it returns


def own_definitions() -> Iterator[tuple[OwnAlarm, Definition]]:
    """The panel's own alarms, which are of no robot."""
    for name, priority in PRIORITIES.items():
        alarm = Alarm.model_validate({"id": name, "priority": priority})
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
