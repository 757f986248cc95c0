"""The descriptions of alarms: `[[alarm]]`, `[alarms]` and `[alarms.mqtt]` of a panel file."""

import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from app.panel.base import (
    Description,
    File,
    FiniteNumber,
    Id,
    MessageField,
    NodeName,
    Seconds,
    SecretFile,
    SecretVariable,
    distinct,
    each_once,
    panel_text,
)
from app.panel.condition import Condition
from app.panel.shared_keys import (
    AgeKey,
    FieldKey,
    NeedsKey,
    NumberKeys,
    OptionalTopicKeys,
    Priorities,
    Priority,
    RobotKey,
)
from app.panel.widgets.displays import PictureName, StateValue
from app.panel.widgets.families import TopicSource
from app.panel.widgets.table import READ_BY_DEFAULT, EntriesRead, ListPath
from app.ros.messages.validation import format_value
from app.system.texts import PanelText

# `[alarms.mqtt]`: where alarms are published by MQTT.

PORT, TLS_PORT = 1883, 8883
PREFIX: Final = re.compile(r"[^/+#$\s\0][^+#\s\0]*")


def _check_prefix(prefix: str) -> str:
    if not PREFIX.fullmatch(prefix) or prefix.endswith("/"):
        raise ValueError(f'{format_value(prefix)} is not a topic of MQTT, like "plant1/cell2/alarms"')
    return prefix


class MqttRules(Description):
    """The broker at `host`, and what the topics begin with. The password of `username` is in an
    environment variable of the server, or else in a file there, never in the panel file."""

    host: Annotated[str, Field(min_length=1, max_length=253)]
    prefix: Annotated[str, Field(max_length=200), AfterValidator(_check_prefix)]
    port: Annotated[int, Field(ge=1, le=65_535)] | None = None
    tls: bool = False
    ca: File | None = None
    username: Annotated[str, Field(min_length=1, max_length=100)] | None = None
    password_env: SecretVariable | None = None
    password_file: SecretFile | None = None
    client_id: Annotated[str, Field(min_length=1, max_length=23)] | None = None

    @model_validator(mode="after")
    def _check_together(self) -> Self:
        if self.username is None and (self.password_env or self.password_file):
            raise ValueError("has a password without a username")
        if self.ca is not None and not self.tls:
            raise ValueError("has a ca, which is for tls = true")
        return self

    @property
    def used_port(self) -> int:
        return self.port or (TLS_PORT if self.tls else PORT)


# The controls that an alarm locks, also those of other robots: `inhibits` of `[[alarm]]`.

EVERY_ROBOT: Final = "*"
NAME: Final = re.compile(r"(?:(?P<robot>\*|[a-z][a-z0-9_]{0,63})/)?(?P<control>[a-z][a-z0-9_]{0,63})")


class InhibitedName(NamedTuple):
    """A name of `inhibits`. `robot` is "" where none is written, and "*" for each."""

    robot: str
    control: str


def _check_name(name: str) -> str:
    if not NAME.fullmatch(name):
        example = 'write "start", or with a robot\'s id "right/start" or "*/start"'
        raise ValueError(f"{format_value(name)} is not the id of a control: {example}")
    return name


Name = Annotated[str, AfterValidator(_check_name)]
InhibitedNames = Annotated[tuple[Name, ...], Field(strict=False), AfterValidator(each_once)]


def inhibited_name(name: str) -> InhibitedName:
    match = NAME.fullmatch(name)
    assert match is not None  # the file is checked
    return InhibitedName(match["robot"] or "", match["control"])


def inhibited_controls(
    names: tuple[str, ...], robot: str, robots: tuple[str, ...], widget_robots: Mapping[str, str]
) -> Iterator[tuple[str, str]]:
    """(robot, control) of what an alarm of `robot` ("" for the only one) locks by these names, among
    `robots`. A control that is of one robot is of it for the alarms of every robot."""
    for name in names:
        named, control = inhibited_name(name)
        own = widget_robots.get(control)
        if named == EVERY_ROBOT and own is None:
            yield from ((each, control) for each in robots or ("",))
        else:
            yield own or named or robot, control


Delay = Annotated[float, Field(ge=0, le=86_400, allow_inf_nan=False)]
SourceKind = Literal["limits", "condition", "stale", "node", "lost", "diagnostics", "list"]

LIMIT_KEYS: Final = ("low_low", "low", "high", "high_high")
# The keys that decide from what an alarm is raised, and the source that they stand for.
SOURCE_KEYS: Final[Mapping[str, SourceKind]] = {
    **dict.fromkeys(LIMIT_KEYS, "limits"),
    "when": "condition",
    "stale_s": "stale",
    "node": "node",
    "lost": "lost",
    "diagnostics": "diagnostics",
    "list": "list",
}
DIAGNOSTICS: Final = "/diagnostics"
DIAGNOSTIC_ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
DIAGNOSTICS_AGE_S: Final = 30.0
STOPPING_PRIORITY: Final = 2  # of alarms: this one and a higher one are a stop, which has a story
SHIFT_S: Final = 8 * 3600.0

if TYPE_CHECKING:
    AlarmText = str | PanelText
else:
    AlarmText = panel_text(400)


def _parse_patterns(value: Any) -> tuple[str, ...]:
    """The patterns, from one or a list of them."""
    patterns = [value] if isinstance(value, str) else value
    if not isinstance(patterns, list | tuple) or not all(isinstance(p, str) and p for p in patterns):
        raise ValueError(
            f"must be a name, in which * stands for any text, or a list, not {format_value(value)}"
        )
    if not patterns:
        raise ValueError('is empty: write "*" for all names')
    return tuple(patterns)


def _check_levels(value: Mapping[str, int]) -> Mapping[str, int]:
    for level in value:
        if not LEVEL.fullmatch(level):
            raise ValueError(f"{format_value(level)} is not a level: a number, or a text in capitals")
    return value


TIME_OF_DAY: Final = re.compile(r"([01][0-9]|2[0-3]):[0-5][0-9]")
LEVEL: Final = re.compile(r"-?[0-9]{1,10}|[A-Z][A-Z0-9_]*")
Patterns = Annotated[tuple[str, ...], BeforeValidator(_parse_patterns)]


class AlarmList(Description):
    """Alarms that a robot publishes as a list: the `field` of the message that is the list, and the
    fields of each entry. Without `active` each entry is active. The `catalogue` has texts by `code`."""

    field: ListPath
    code: MessageField
    text: MessageField | None = None
    level: MessageField | None = None
    active: MessageField | None = None
    priorities: Annotated[Mapping[str, Priority], AfterValidator(_check_levels)] = Field(
        default_factory=dict
    )
    catalogue: File | None = None
    entries_read: EntriesRead = READ_BY_DEFAULT

    @property
    def own_fields(self) -> tuple[str, ...]:
        """The fields of an entry that are read."""
        named = (self.code, self.text, self.level, self.active)
        return tuple(dict.fromkeys(path for path in named if path is not None))


class RaisingCondition(Condition):
    """`[alarm.when]`: raises an alarm while it is met."""


class SuppressingCondition(Condition):
    """`[alarm.while]`: suppresses an alarm by design while it is met."""


class Alarm(NumberKeys, AgeKey, FieldKey, OptionalTopicKeys, NeedsKey, RobotKey):
    """An alarm after ISA-18.2, or with `diagnostics` or `list` one for each status that a robot
    publishes. `critical_priority` is that of `low_low` and `high_high`, and of an ERROR. Limits are for
    `value * scale + offset`, and `format` writes it. `state` is the machine's state while it is active.
    `ack_command` is the control that is pressed when it is acknowledged, with its name or code in
    `ack_input`. `needs`: the role or group that acts on it need; `confirm_act`: who confirms them with
    a PIN."""

    id: Id
    priority: Priority = 3
    critical_priority: Priority | None = None
    text: AlarmText | None = None
    cause: AlarmText | None = None
    consequence: AlarmText | None = None
    action: AlarmText | None = None
    picture: PictureName | None = None
    group: AlarmText | None = None
    latched: bool = False
    ack: Literal["required", "none"] = "required"
    inhibits: InhibitedNames = ()
    state: StateValue | None = None
    confirm_act: Literal["pin", "two_persons"] | None = None
    ack_command: Id | None = None
    ack_input: Id | None = None
    on_delay_s: Delay = 0.0
    off_delay_s: Delay = 0.0
    on_unknown: Literal["keep", "raise"] = "keep"
    max_shelf_s: Annotated[float, Field(gt=0, le=SHIFT_S, allow_inf_nan=False)] = SHIFT_S
    low_low: FiniteNumber | None = None
    low: FiniteNumber | None = None
    high: FiniteNumber | None = None
    high_high: FiniteNumber | None = None
    deadband: Annotated[float, Field(ge=0, allow_inf_nan=False)] = 0.0
    when: RaisingCondition | None = None
    suppressed_while: SuppressingCondition | None = Field(None, alias="while")
    inhibits_when_suppressed: bool = True
    stale_s: Seconds | None = None
    node: NodeName | None = None
    lost: Literal["link", "robot"] | None = None
    diagnostics: Patterns | None = None
    listed: AlarmList | None = Field(None, alias="list")

    @cached_property
    def source(self) -> SourceKind | None:
        """From what it is raised; None if no key says so."""
        return next((SOURCE_KEYS[key] for key in self.given_source_keys), None)

    @property
    def given_source_keys(self) -> tuple[str, ...]:
        """The given keys of `SOURCE_KEYS`."""
        names = {"list": "listed"}
        return tuple(key for key in SOURCE_KEYS if getattr(self, names.get(key, key)) is not None)

    @cached_property
    def limits(self) -> Mapping[str, float]:
        """Key → value of the given limits."""
        values = {key: getattr(self, key) for key in LIMIT_KEYS}
        return {key: value for key, value in values.items() if value is not None}

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """What it judges beside its own source."""
        return tuple(condition for condition in (self.when, self.suppressed_while) if condition)

    @property
    def has_action(self) -> bool:
        """Whether it may say what the operator does: by itself, or by a fault catalogue."""
        catalogue = self.listed.catalogue if self.listed else None
        return self.action is not None or catalogue is not None

    @property
    def limited_value(self) -> tuple[str, str] | None:
        """The topic and field of the number that its limits are for; None without limits."""
        return (self.topic, self.field) if self.source == "limits" and self.topic else None

    @cached_property
    def marked_values(self) -> tuple[tuple[str, str], ...]:
        """The topics and fields of the values that it is about: those of its limits and its
        condition."""
        limited = [self.limited_value] if self.limited_value else []
        return (*limited, *([(self.when.topic, self.when.field)] if self.when else []))

    @property
    def evaluated_topics(self) -> tuple[str, ...]:
        """The topics after whose messages it is evaluated."""
        own = (self.topic,) if self.topic is not None else ()
        return (*own, *(condition.topic for condition in self.conditions))

    @property
    def entry_max_age_s(self) -> float | None:
        """After which time an alarm that the robot publishes is not known: for diagnostics, which come
        again and again, also by default."""
        return self.max_age_s or (DIAGNOSTICS_AGE_S if self.diagnostics else None)

    @property
    def topic_name(self) -> str | None:
        """Its topic: /diagnostics where diagnostics name none."""
        return self.topic or (DIAGNOSTICS if self.diagnostics else None)

    @property
    def topic_type(self) -> str | None:
        return self.type or (DIAGNOSTIC_ARRAY if self.diagnostics else None)

    @property
    def priorities(self) -> tuple[int, int]:
        """Those of its two levels. By default the second is one step more urgent."""
        return self.priority, self.critical_priority or max(1, self.priority - 1)

    def is_for(self, robot: str | None) -> bool:
        """Whether it is an alarm of this robot; None is the robot without a name."""
        return self.robot in (None, robot)

    def sources(self) -> Iterator[TopicSource]:
        """The topic that it listens to."""
        topic, type_name = self.topic_name, self.topic_type
        if topic is not None and type_name is not None:
            fields = (self.field,) if self.source == "limits" else ()
            yield TopicSource(topic, type_name, self.qos, fields)


def _check_start(text: str) -> str:
    if not TIME_OF_DAY.fullmatch(text):
        raise ValueError(f'{format_value(text)} is not a time of day like "06:00"')
    return text


def _sorted(times: tuple[str, ...]) -> tuple[str, ...]:
    if not times:
        raise ValueError('is empty: leave the key out for shifts at "06:00", "14:00" and "22:00"')
    if list(times) != sorted(set(times)):
        raise ValueError("has times out of order: write the earliest first, each once")
    return times


ShiftStart = Annotated[str, AfterValidator(_check_start)]
Shifts = Annotated[tuple[ShiftStart, ...], Field(strict=False, max_length=12), AfterValidator(_sorted)]


Minutes = Annotated[int, Field(ge=1, le=480)]
SilenceTimes = Annotated[
    tuple[Minutes, ...], Field(strict=False, max_length=4), AfterValidator(distinct)
]


class AlarmRules(Description):
    """The table `[alarms]`. `panel`: the panel raises alarms of its own. `low_screens`: what shows
    alarms on pages of low screens. Alarms of a group that are raised within `first_out_s` of the first
    follow it. `shifts` are times of day at which shifts begin. The oldest entries of the history are
    removed after `days`, or when the file is larger than `size_mb` megabytes. With `sound` browsers
    sound alarms of `sound_priorities` that are not acknowledged, unless one is silenced for one of
    `silence_minutes`."""

    panel: bool = True
    disk_free_mb: Annotated[float, Field(ge=1, le=1_000_000, allow_inf_nan=False)] = 500.0
    low_screens: Literal["line", "badge"] = "line"
    first_out_s: Annotated[float, Field(ge=0, le=3600, allow_inf_nan=False)] = 2.0
    shifts: Shifts = ("06:00", "14:00", "22:00")
    days: Annotated[float, Field(gt=0, le=36_500, allow_inf_nan=False)] = 365.0
    size_mb: Annotated[float, Field(ge=1, le=100_000, allow_inf_nan=False)] = 64.0
    sound: bool = False
    sound_priorities: Priorities = (1, 2, 3)
    silence_minutes: SilenceTimes = (5, 15, 60)
    mqtt: MqttRules | None = None
