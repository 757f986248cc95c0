"""Off and on as one switch, which moves only when the robot reports it."""

import itertools
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any, ClassVar, Final, Literal, Self

from app.panel.base import (
    MessageOrServiceType,
    SaidLabel,
    Seconds,
    Span,
    TopicName,
    TopicQos,
    catalogue_default,
)
from app.panel.checks.types import value_faults, way_faults
from app.panel.constants import parent_type
from app.panel.values import same_value
from app.panel.widgets.displays import StateValue, resolve_state_value
from app.panel.widgets.families import (
    CheckContext,
    Command,
    EntryWidget,
    SentMessage,
    TopicField,
    TopicSource,
)
from app.panel.widgets.inputs import BOOL_TEXTS
from app.panel.widgets.parts import CompositeCommand
from app.panel.widgets.publish import Confirm, Publish, PublishPress, confirm_faults
from app.panel.widgets.service_action import Call
from app.ros.dialects.dialect import Role
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import Fault, InputError
from app.system.texts import say

Position = Literal["on", "off", ""]
# The keys that only one way to send has.
WAYS: Final[Mapping[str, str]] = {"topic": "message", "service": "request"}


class SwitchReport(TopicField):
    """The field by which the robot reports whether it is on."""


class Switch(EntryWidget, CompositeCommand):
    """Shows whether something is on, as the robot reports it, and switches it: by a message to `topic`,
    or by a call of `service`. A press waits for the report, at most `confirm_s`.

    It is an input too: a press has true or false under the widget's id.
    """

    why_needed: ClassVar[Mapping[str, str]] = {
        "reported": "the topic on which the robot says whether it is on, such as reported = "
        '{ topic = "/light", type = "std_msgs/msg/Bool" }',
    }
    kind: Literal["switch"]
    reported: SwitchReport
    on: SaidLabel = catalogue_default("on")
    off: SaidLabel = catalogue_default("off")
    on_value: StateValue = True
    off_value: StateValue = False
    topic: TopicName | None = None
    service: TopicName | None = None
    type: MessageOrServiceType
    qos: TopicQos = TopicQos()
    on_message: dict[str, Any] | None = None
    off_message: dict[str, Any] | None = None
    on_request: dict[str, Any] | None = None
    off_request: dict[str, Any] | None = None
    confirm_s: Seconds = 2.0
    timeout_s: Seconds = 5.0
    span: Span = 4

    @property
    def template(self) -> dict[str, Any]:
        """The new position, and what is sent for each."""
        sent = {name: self.command(on=on).template for name, on in (("on", True), ("off", False))}
        return {"value": f"{{{self.id}}}", **sent}

    @property
    def way(self) -> str:
        """The key that says how it is switched."""
        return "topic" if self.topic is not None else "service"

    @property
    def answer_s(self) -> float:
        """Within which a press has its receipt."""
        return self.confirm_s + (self.timeout_s if self.service is not None else 0.0)

    @cached_property
    def parts(self) -> tuple[Command, ...]:
        return (self.command(on=True), self.command(on=False))

    def command(self, *, on: bool) -> Publish | Call:
        """The command that switches it on or off."""
        keys: dict[str, Any] = {"id": self.id, "label": self.label, "type": self.type}
        if self.service is not None:
            request = self.on_request if on else self.off_request
            keys |= {"service": self.service, "timeout_s": self.timeout_s, "request": request or {}}
            return Call.model_construct(None, kind="call", **keys)
        message = self.on_message if on else self.off_message
        keys |= {"topic": self.topic, "qos": self.qos, "message": message or {}, "one_shot": True}
        return Publish.model_construct(None, kind="publish", confirm=self.confirm(on=on), **keys)

    def confirm(self, *, on: bool) -> Confirm:
        """What the robot reports when it is on or off."""
        return self.confirms[0 if on else 1]

    @cached_property
    def confirms(self) -> tuple[Confirm, Confirm]:
        """What the robot reports when it is on, and when it is off."""
        source = self.reported
        keys = {"topic": source.topic, "type": source.type, "field": source.field}
        on, off = (
            Confirm(**keys, equals=value, within_s=self.confirm_s)
            for value in (self.on_value, self.off_value)
        )
        return on, off

    def position(self, value: Any) -> Position:
        """The position for a reported value; "" for a value of neither."""
        if same_value(value, self.on_value):
            return "on"
        return "off" if same_value(value, self.off_value) else ""

    def sources(self) -> Iterator[TopicSource]:
        yield self.reported.source("reported")

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        yield "MP", self.reported.topic
        yield from self.parts[0].endpoints()

    def sent_messages(self, interfaces: Interfaces) -> Iterator[SentMessage]:
        for part, name in zip(self.parts, (self.on, self.off), strict=True):
            for sent in part.sent_messages(interfaces):
                yield sent._replace(when=f'for "{name}" {sent.when}')

    def parse_text(self, text: str, language: str) -> bool | str:
        return BOOL_TEXTS.get(text, text)

    def check_value(self, value: Any) -> bool:
        """The new position; InputError for anything but true and false."""
        if isinstance(value, bool):
            return value
        shown = format_value(value)
        raise InputError(
            say("input_not_a_boolean", label=self.label, on=self.on, off=self.off, given=shown)
        )

    def with_constants(self, interfaces: Interfaces) -> Self:
        kind = interfaces.field_type(self.reported.type, self.reported.field)
        constants = interfaces.constants(parent_type(self.reported, interfaces))
        values = {
            key: resolve_state_value(getattr(self, key), kind, constants)
            for key in ("on_value", "off_value")
        }
        return self.model_copy(update=values)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        if self.asks:
            reason = (
                "asks nothing of a switch, as a touch on the other position switches back: "
                '"pin" or "two_persons" do'
            )
            yield Fault(f"{place}.confirm_press", reason)
        if (self.topic is None) == (self.service is None):
            message = (
                "needs a topic to publish to, or a service to call"
                if self.topic is None
                else ("has no meaning beside topic: a switch is set by messages or by a service")
            )
            yield Fault(f"{place}.{'topic' if self.topic is None else 'service'}", message)
            return
        missing = list(self._missing_faults(place))
        missing += way_faults(place, self.type, of_service=self.service is not None)
        yield from missing
        source, at = self.reported, f"{place}.reported"
        faults = list(value_faults(at, source.type, source.field, "a report", checking.interfaces))
        yield from faults
        if missing or faults:
            return
        seen = set()
        for fault in (
            fault for on in (True, False) for fault in self._command_faults(place, on, checking)
        ):
            if (fault.place, fault.message) not in seen:
                yield fault
            seen.add((fault.place, fault.message))
        yield from self._same_sent_faults(place)
        if same_value(self.on_value, self.off_value):
            message = (
                f"{format_value(self.off_value)} is on_value too: the positions could not be told apart"
            )
            yield Fault(f"{place}.off_value", message)

    def _same_sent_faults(self, place: str) -> Iterator[Fault]:
        """A fault if the same is sent for both positions."""
        for on, off, key in (
            (self.on_message, self.off_message, "off_message"),
            (self.on_request, self.off_request, "off_request"),
        ):
            if on is not None and on == off:
                message = f"is the same as {key.replace('off', 'on')}: both positions would be the same"
                yield Fault(f"{place}.{key}", message)

    def _missing_faults(self, place: str) -> Iterator[Fault]:
        """Faults of what is sent: missing, or of the other way to send."""
        for name, (way, ending) in itertools.product(("on", "off"), WAYS.items()):
            key, cause = f"{name}_{ending}", f"sent {name} {place}"
            if way != self.way and getattr(self, key) is not None:
                message = f"is for a {way}; this switch has a {self.way}"
                yield Fault(f"{place}.{key}", message, cause=cause)
            elif way == self.way and getattr(self, key) is None:
                sent = "published" if way == "topic" else "requested"
                message = f"is missing: what is {sent} for this position"
                yield Fault(f"{place}.{key}", message, cause=cause)

    def _command_faults(self, place: str, on: bool, checking: CheckContext) -> Iterator[Fault]:
        """Faults of the command for a position, at the keys of the switch."""
        name, command = "on" if on else "off", self.command(on=on)
        faults = list(command.faults(place, checking))
        if isinstance(command, Call):
            faults += confirm_faults(f"{place}.confirm", self.confirm(on=on), checking)
        names = {"message": f"{name}_message", "request": f"{name}_request"}
        for fault in faults:
            key, dot, rest = fault.place.removeprefix(f"{place}.").partition(".")
            if key == "confirm":
                at = f"{name}_value" if rest == "equals" else f"reported.{rest}"
            else:
                at = names.get(key, key) + dot + rest
            yield Fault(f"{place}.{at}", fault.message, cause=fault.cause)


def confirms_of(command: Command) -> Iterator[Confirm]:
    """What the robot reports after a press of a command, if it is confirmed."""
    if isinstance(command, Switch):
        yield from command.confirms
    elif isinstance(command, PublishPress) and command.confirm is not None:
        yield command.confirm
