"""Commands that call a service or send a goal to an action."""

import re
from abc import abstractmethod
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from app.panel.base import ActionType, AnyText, MessageField, Seconds, ServiceType, Span, TopicName
from app.panel.response_text import response_fields
from app.panel.widgets.displays import LampCommand
from app.panel.widgets.families import CheckContext
from app.panel.widgets.templated import TemplateCommand
from app.ros.dialects.dialect import Role, ServerRole
from app.ros.messages import Interfaces
from app.system.errors import Fault, FieldError, InterfaceError
from app.system.texts import TextLike

NUMBER_TYPES: Final = r"u?int(8|16|32|64)|float(32|64)|byte|char"
TYPE_WORDS: Final = {NUMBER_TYPES: "a number"}
ACTION_SERVER_TYPES: Final = ("action_msgs/msg/GoalStatusArray", "action_msgs/srv/CancelGoal_Request")


class ServerCommand(TemplateCommand):
    """A command to a service or action server, which must respond within `timeout_s`."""

    type: str
    timeout_s: Seconds = 5.0

    server_role: ClassVar[ServerRole]

    @property
    @abstractmethod
    def server_name(self) -> str:
        """The name of the service or the action."""

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        yield self.server_role, self.server_name


class Call(ServerCommand, LampCommand):
    """A service call. `success` and `message` are fields of the response; by default a bool and a
    string of these names. `answer` is shown with `{field}` filled in."""

    kind: Literal["call"]
    service: TopicName
    type: ServiceType
    request: dict[str, Any] = Field(default_factory=dict)
    success: MessageField | None = None
    message: MessageField | None = None
    answer: AnyText = ""
    span: Span = 4

    template_key: ClassVar[str] = "request"
    server_role: ClassVar[ServerRole] = "SS"

    @property
    def template(self) -> dict[str, Any]:
        return self.request

    @property
    def server_name(self) -> str:
        return self.service

    @property
    def action_text(self) -> str:
        return f"calls {self.service} ({self.type})"

    def template_type(self, interfaces: Interfaces) -> str:
        return interfaces.service_types(self.type)[0]

    def response_faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        _, response = checking.interfaces.service_types(self.type)
        for key, path, kind in (("success", self.success, "bool"), ("message", self.message, "string")):
            if path is not None:
                yield from _path_faults(f"{place}.{key}", response, path, kind, checking.interfaces)
        yield from _text_faults(f"{place}.answer", response, self.answer, checking.interfaces)


class Action(ServerCommand):
    """A goal of an action, with a cancel button. `progress` is a field of the feedback, from 0 to
    `progress_max`. With `progress_falls` it falls to 0 from there, by default from its greatest value
    so far: a distance that remains. `feedback` and `result` are shown with `{field}` filled in."""

    kind: Literal["action"]
    action: TopicName
    type: ActionType
    goal: dict[str, Any] = Field(default_factory=dict)
    progress: MessageField | None = None
    progress_max: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 100.0
    progress_falls: bool = False
    feedback: AnyText = ""
    result: AnyText = ""
    span: Span = 6

    template_key: ClassVar[str] = "goal"
    server_role: ClassVar[ServerRole] = "AS"
    required_types: ClassVar[tuple[str, ...]] = ACTION_SERVER_TYPES
    allowed_in_frame: ClassVar[bool] = False

    @property
    def template(self) -> dict[str, Any]:
        return self.goal

    @property
    def server_name(self) -> str:
        return self.action

    @property
    def progress_ends(self) -> tuple[float, float]:
        """The progress at first and at last."""
        ends = (0.0, self.progress_max)
        return (ends[1], ends[0]) if self.progress_falls else ends

    @property
    def falls_from(self) -> float | None:
        """From where the progress falls, if the panel file says it."""
        return self.progress_max if "progress_max" in self.model_fields_set else None

    @property
    def action_text(self) -> str:
        return f"sends a goal to {self.action} ({self.type})"

    def template_type(self, interfaces: Interfaces) -> str:
        return interfaces.action_types(self.type).goal

    def response_faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        interfaces = checking.interfaces
        types = interfaces.action_types(self.type)
        if self.progress is not None:
            yield from _path_faults(
                f"{place}.progress", types.feedback, self.progress, NUMBER_TYPES, interfaces
            )
        yield from _text_faults(f"{place}.feedback", types.feedback, self.feedback, interfaces)
        yield from _text_faults(f"{place}.result", types.result, self.result, interfaces)


def _text_faults(
    place: str, type_name: str, template: TextLike, interfaces: Interfaces
) -> Iterator[Fault]:
    try:
        fields = response_fields(template)
    except FieldError as error:
        yield Fault(place, error.message)
        return
    for field in fields:
        faults = list(_path_faults(place, type_name, field.path, ".*", interfaces))
        if not faults and (fault := field.fault(interfaces.field_type(type_name, field.path))):
            faults = [Fault(place, fault)]
        yield from faults


def _path_faults(
    place: str, type_name: str, path: str, kind: str, interfaces: Interfaces
) -> Iterator[Fault]:
    """A fault if the field does not exist, or its type does not match `kind` (a regular expression)."""
    try:
        field_type = interfaces.field_type(type_name, path)
    except InterfaceError as error:
        yield Fault(place, str(error))
        return
    if not re.fullmatch(kind, field_type):
        yield Fault(place, f'"{path}" is {field_type}: it must be {TYPE_WORDS.get(kind, kind)}')
