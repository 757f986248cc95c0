"""The families of widgets: base classes of the kinds, which add keys and checks.

A family's methods are the interface to the rest of the panel: faults, required endpoints, messages to
send. Tables of other rooms say how a kind is shown, permitted and sent.
"""

from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

from pydantic import Field

from app.panel.base import (
    Icon,
    Id,
    Interlocks,
    Label,
    Note,
    Rows,
    Span,
    TopicQos,
)
from app.panel.checks.types import value_faults
from app.panel.file.wording import no_such
from app.panel.shared_keys import AgeKey, FieldKeys, NeedsKey, RobotKey, TopicKeys
from app.panel.widgets.key_parts import (
    COLOURS,
    ICONS,
    OWN_COLOURS,
    SIGNS,
    ConfirmationKeys,
    KeyColour,
    KeyRole,
)
from app.ros.dialects.dialect import Role
from app.ros.messages import Interfaces
from app.ros.messages.names import ROSOUT_TOPIC
from app.ros.messages.validation import format_value
from app.system.errors import Fault

# What a command sends, as previews and checks see it.


class SentMessage(NamedTuple):
    """A message that a command sends: when, its type ("" if the panel file names none), and its fields
    with input ids; `comments` are by field (".seq")."""

    when: str
    type_name: str = ""
    fields: Mapping[str, Any] = {}
    comments: Mapping[str, str] = {}


@dataclass(frozen=True, slots=True)
class CheckContext:
    """What a widget's check needs: `inputs` of its page, the ids of all others, topic → type. Whether
    `conditions`, interlocks and `alarms` have an action. Widgets in `faulty` have faults already."""

    interfaces: Interfaces
    inputs: Mapping[str, "Input"]
    all_inputs: Collection[str]
    interlocks: Collection[str]
    conditions: Mapping[str, bool]
    types: Mapping[str, str]
    alarms: Mapping[str, bool]
    alarm_groups: Collection[str]
    faulty: Collection[str] = ()
    pages: Collection[str] = ()
    pictures: Collection[str] = ()


class TopicSource(NamedTuple):
    """A topic that a widget listens to, with the paths of the `fields` that it reads; `place` is the
    table with the topic's keys, below the widget's ("pen[0]"; "" for the widget's own). `on_demand`:
    the topic is subscribed to only while a browser shows it."""

    topic: str
    type: str
    qos: TopicQos
    fields: tuple[str, ...]
    place: str = ""
    on_demand: bool = False


class BaseWidget(RobotKey):
    """The keys of every widget: `span` and `rows` are its size in the grid of its group; with `grow`
    its row takes the height that is left. Without `show_label` its label is only read aloud."""

    id: Id
    label: Label
    show_label: bool = True
    span: Span = 12
    rows: Rows = 1
    grow: bool = False
    kind: str
    why_needed: ClassVar[Mapping[str, str]] = {}  # why a key is required, if that is not obvious
    required_types: ClassVar[tuple[str, ...]] = ()  # that the server needs for this kind
    allowed_in_frame: ClassVar[bool] = False  # whether the frame around the pages may have it
    on_phone: ClassVar[bool] = False  # whether a phone has it, which only shows

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        """Faults of a widget whose keys and types are valid; `place` is its place in the panel file."""
        yield from ()

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        """The endpoints that the robot must have, as (role, ROS name)."""
        yield from ()

    def with_constants(self, interfaces: Interfaces) -> Self:
        """The widget with values in place of constants' names; call it on a checked widget."""
        return self


class EntryWidget(BaseWidget):
    """A widget in which a value is entered; a press has it under the widget's id."""

    @property
    def is_whole(self) -> bool:
        """Whether only whole numbers are entered."""
        return False

    @property
    def default_value(self) -> Any:
        """The default of the panel file, as in a press; None without one."""
        return None

    def parse_text(self, text: str, language: str) -> Any:
        """A form's text, in the page's language, as a value of this type; else the text itself."""
        return text


class Input(EntryWidget):
    """A value that messages use by the input's id."""

    parts: ClassVar[tuple[str, ...]] = ()  # names of what messages use of it, as in "{goal.x}"

    @property
    @abstractmethod
    def value_description(self) -> str:
        """The kind of its values, for a fault's message: "whole numbers"."""

    @property
    @abstractmethod
    def comment(self) -> str:
        """Its values and its initial value, as a comment in a preview."""

    @abstractmethod
    def examples(self) -> list[Any]:
        """Values to try a template with: limits, every option, true and false."""

    @abstractmethod
    def check_value(self, value: Any) -> Any:
        """The value as it is entered and logged; InputError names label and limits."""

    def sent_value(self, value: Any) -> Any:
        """The value that a message gets in place of a checked one."""
        return value

    def describe_value(self, value: Any, *, narrow: bool) -> str:
        """The text for a `value` that does not fit its field; `narrow`: only its range does not fit."""
        return format_value(value) if narrow else self.value_description


class TopicWidget(TopicKeys, BaseWidget):
    """A widget that publishes or shows a topic."""


class TopicField(AgeKey, FieldKeys):
    """A field of a topic that a widget reads beside or instead of its topic."""

    def source(self, place: str) -> TopicSource:
        """Its topic; `place` is its table below the widget's."""
        return TopicSource(self.topic, self.type, self.qos, (self.field,), place)


class DisplayWidget(BaseWidget):
    """A widget that shows what topics say, of one robot, or what to do about alarms."""

    on_phone: ClassVar[bool] = True
    shows_alarms: ClassVar[bool] = False

    @abstractmethod
    def sources(self) -> Iterator[TopicSource]:
        """The topics that it shows."""

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        for topic in dict.fromkeys(source.topic for source in self.sources()):
            yield "MP", topic

    @property
    def named_conditions(self) -> tuple[str, ...]:
        """The ids of the interlocks and conditions that it shows."""
        return ()


class Display(AgeKey, FieldKeys, TopicWidget, DisplayWidget):
    """A field of a topic that is shown; a value older than `max_age_s` is marked as old."""

    whole_types: ClassVar[Collection[str]] = ()  # of several fields, shown as one value

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, (self.field,))

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        who = f"{'an' if self.kind[0] in 'aeiou' else 'a'} {self.kind}"
        interfaces = checking.interfaces
        faults = list(value_faults(place, self.type, self.field, who, interfaces, self.whole_types))
        yield from faults
        if not faults:
            field_type = interfaces.field_type(self.type, self.field)
            yield from self.value_faults(place, field_type, interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults with a field of this type, which is a single value."""
        yield from ()


class Command(NeedsKey, BaseWidget):
    """A widget that sends commands to the robot while its interlocks permit. `needs`: the role or group
    of users that may press it."""

    interlocks: Interlocks = Field(default=(), alias="interlock")

    def sources(self) -> Iterator[TopicSource]:
        """The topics whose values it needs, beside its interlocks'."""
        yield from ()

    @abstractmethod
    def templates(self) -> list[Any]: ...  # which may contain input ids

    @abstractmethod
    def sent_messages(self, interfaces: Interfaces) -> Iterator[SentMessage]:
        """The messages that it sends, in order; call it on a checked widget."""

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for i, name in enumerate(self.interlocks):
            if name not in checking.interlocks:
                at = f"[{i}]" if len(self.interlocks) > 1 else ""
                message = no_such("interlock", name, checking.interlocks)
                yield Fault(f"{place}.interlock{at}", message, cause=f"interlock {name}")


class KeyCommand(Command):
    """A command with a key of its own; its colour is one that IEC 60204-1 has for its role."""

    allowed_in_frame: ClassVar[bool] = True

    role: KeyRole = "neutral"
    colour: KeyColour | None = None
    icon: Icon | None = None
    note: Note | None = None

    @property
    def shown_colour(self) -> str:
        """The colour of the panel file, or that of the role; "" where the theme decides."""
        return self.colour or OWN_COLOURS.get(self.role) or ""

    @property
    def shown_icon(self) -> str:
        """The icon of the file or the role; "" without one, and where the shown label is its sign."""
        icon = self.icon or ICONS.get(self.role, "")
        return "" if self.show_label and self.label in tuple(SIGNS.get(icon, "")) else icon

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.colour is not None and self.colour not in (allowed := COLOURS[self.role]):
            message = f"a {self.role} key is {' or '.join(allowed)} (IEC 60204-1), never {self.colour}"
            yield Fault(f"{place}.colour", message)
        yield from super().faults(place, checking)


class PressCommand(ConfirmationKeys, Command):
    """A command that one press sends."""

    @property
    @abstractmethod
    def template(self) -> Mapping[str, Any]:
        """The fields of the message, with input ids."""

    def templates(self) -> list[Any]:
        return [self.template]


class PublishCommand(TopicWidget, Command):
    """A command that publishes a topic."""

    @property
    def one_at_a_time(self) -> bool:  # locked until the effect of the last press is confirmed
        return False

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        yield "MS", self.topic

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.topic in (ROSOUT_TOPIC, f"/{ROSOUT_TOPIC}"):
            message = "/rosout is where the panel server's own log goes: choose another"
            yield Fault(f"{place}.topic", message)
        yield from super().faults(place, checking)
