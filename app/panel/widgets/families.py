"""The families of widgets, each with what its kinds share. A kind adds its keys and its checks.

A family's methods are what the rest of the panel needs to know of a kind: its faults, the endpoints of
the robot that it needs, what it sends. What a kind shows and how it is sent is in tables of the rooms
that do so (`app/view/kinds.py`, `app/permission/interlocks.py`, `app/commands/dispatch.py`).
"""

from abc import abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

from pydantic import Field

from app.dialect.endpoint import Role
from app.errors import Fault
from app.interfaces import Interfaces
from app.interfaces.validation import format_value
from app.panel.base import (
    Description,
    FieldPath,
    Id,
    Interlocks,
    Label,
    Seconds,
    Span,
    Topic,
    TopicQos,
    Type,
)
from app.panel.checks.types import field_faults
from app.panel.faults.wording import list_names


@dataclass(frozen=True, slots=True)
class CheckContext:
    """What a widget is checked against: the inputs of its page by their ids, the ids of all inputs
    (`anywhere`) and of all interlocks, the types of the topics that the panel listens to. Faults of
    the widgets in `faulty` are reported already: what depends on them is not checked."""

    interfaces: Interfaces
    inputs: Mapping[str, "Input"]
    all_inputs: Collection[str]
    interlocks: Collection[str]
    types: Mapping[str, str]
    faulty: Collection[str] = ()


class BaseWidget(Description):
    """What every widget has; `span` is its width in twelfths of the page."""

    id: Id
    label: Label
    span: Span = 12
    kind: str

    # Why a key that is missing is needed, where that is not plain.
    why_needed: ClassVar[Mapping[str, str]] = {}
    # The types that the server itself needs for this kind.
    required_types: ClassVar[tuple[str, ...]] = ()

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        """What is wrong though the shape is right; `place` is the widget's in the panel file."""
        yield from ()

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        """What has to be on the robot, as (role, ROS name)."""
        yield from ()

    def with_constants(self, interfaces: Interfaces) -> Self:
        """The same with values for the names of constants; of a checked widget."""
        return self


class EntryWidget(BaseWidget):
    """A widget in which a value is entered: it comes with a press under the widget's id."""

    @property
    def default_value(self) -> Any:
        """The default that the panel file gives, as a press gives it; None where it gives none."""
        return None

    def parse_text(self, text: str) -> Any:
        """A form's text as a value of this widget's type; the text itself where it is none."""
        return text


class Input(EntryWidget):
    """A value that messages take by the input's id."""

    @property
    @abstractmethod
    def value_description(self) -> str:
        """What kind of values it gives, for the sentence of a fault."""

    @property
    @abstractmethod
    def comment(self) -> str:
        """What it gives and what it starts with, for a comment in a preview."""

    @abstractmethod
    def examples(self) -> list[Any]:
        """The values at which a template would fail first: limits, every option, true and false."""

    @abstractmethod
    def check_value(self, given: Any) -> Any:
        """The value that a message takes; InputError with a sentence that names label and limits."""

    def describe_value(self, value: Any, *, narrow: bool) -> str:
        """What it gives where `value` does not fit; `narrow`: its type does, and only the value is
        out of a range."""
        return format_value(value) if narrow else self.value_description


class TopicWidget(BaseWidget):
    """A widget that publishes a topic, or shows it."""

    topic: Topic
    type: Type
    qos: TopicQos = TopicQos()


class Display(TopicWidget):
    """A field of a topic, shown; older than `max_age_s` it is shown as old."""

    field: FieldPath = "data"
    max_age_s: Seconds | None = None

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        yield "MP", self.topic

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        interfaces = checking.interfaces
        faults = list(field_faults(place, self.type, self.field, interfaces))
        yield from faults
        if faults:
            return
        field_type = interfaces.type_at(self.type, self.field)
        if field_type.is_nested or field_type.container != "one":
            who = f"an {self.kind}" if self.kind[0] in "aeiou" else f"a {self.kind}"
            what = f'"{self.field}" is {field_type}: {who} shows one value of it, not all'
            yield Fault(f"{place}.field", what)
        else:
            yield from self.value_faults(place, str(field_type), interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        """What is wrong for a field of this type, which is one value."""
        yield from ()


class SentMessage(NamedTuple):
    """A message that a command sends: when, its type ("" where it has none that the panel file names),
    and its fields with the ids of inputs in them; `comments` are by fields (".seq")."""

    when: str
    type_name: str = ""
    fields: Mapping[str, Any] = {}
    comments: Mapping[str, str] = {}


class Command(BaseWidget):
    """A widget that acts on the robot, where its interlocks permit."""

    interlocks: Interlocks = Field(default=(), alias="interlock")

    @abstractmethod
    def templates(self) -> list[Any]:
        """All that may name inputs."""

    @abstractmethod
    def sent_messages(self, interfaces: Interfaces) -> Iterator[SentMessage]:
        """What it sends, in its order; of a checked widget."""

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for i, name in enumerate(self.interlocks):
            if name not in checking.interlocks:
                at = f"[{i}]" if len(self.interlocks) > 1 else ""
                what = f'no interlock "{name}"; there is {list_names(checking.interlocks)}'
                yield Fault(f"{place}.interlock{at}", what, cause=f"interlock {name}")


class PressCommand(Command):
    """A command that is given by one press; with `confirm_press` the page asks first."""

    confirm_press: bool = False

    @property
    @abstractmethod
    def template(self) -> Mapping[str, Any]:
        """The fields of what is sent, with the ids of inputs in them."""

    def templates(self) -> list[Any]:
        return [self.template]


class PublishCommand(TopicWidget, Command):
    """A command that publishes."""

    @property
    def one_at_a_time(self) -> bool:
        """Whether it is locked while the effect of the last one is awaited."""
        return False

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        yield "MS", self.topic

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.topic == "/rosout":
            what = "/rosout is where the kiosk's own log goes: choose another"
            yield Fault(f"{place}.topic", what)
        yield from super().faults(place, checking)
