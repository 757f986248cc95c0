"""Commands that call a service or send an action's goal."""

import re
from abc import abstractmethod
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from app.dialect.endpoint import Role, ServerRole
from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.base import ActionType, FieldPath, Seconds, ServiceType, Span, Topic
from app.panel.template import PLACE
from app.panel.widgets.families import Checking
from app.panel.widgets.templated import Templated

NUMBER: Final = r"u?int(8|16|32|64)|float(32|64)|byte|char"
WORDS: Final = {NUMBER: "a number"}
OF_ACTIONS: Final = ("action_msgs/msg/GoalStatusArray", "action_msgs/srv/CancelGoal_Request")


class Served(Templated):
    """A command that a server on the robot answers within `timeout_s`."""

    type: str
    timeout_s: Seconds = 5.0

    role: ClassVar[ServerRole]

    @property
    @abstractmethod
    def server(self) -> str:
        """The name of the service or the action."""

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        yield self.role, self.server


class Call(Served):
    """A service call; `success` and `message` are fields of the response, found by themselves
    where it has a bool and a string of these names; `answer` is shown with `{field}` filled in."""

    kind: Literal["call"]
    service: Topic
    type: ServiceType
    request: dict[str, Any] = Field(default_factory=dict)
    success: FieldPath | None = None
    message: FieldPath | None = None
    answer: str = ""
    span: Span = 4

    part: ClassVar[str] = "request"
    role: ClassVar[ServerRole] = "SS"

    @property
    def template(self) -> dict[str, Any]:
        return self.request

    @property
    def server(self) -> str:
        return self.service

    @property
    def does(self) -> str:
        return f"calls {self.service} ({self.type})"

    def sent_type(self, interfaces: Interfaces) -> str:
        return interfaces.service(self.type)[0]

    def answer_faults(self, place: str, checking: Checking) -> Iterator[Fault]:
        _, response = checking.interfaces.service(self.type)
        for key, path, kind in (("success", self.success, "bool"), ("message", self.message, "string")):
            if path is not None:
                yield from _path(f"{place}.{key}", response, path, kind, checking.interfaces)
        yield from _shown(f"{place}.answer", response, self.answer, checking.interfaces)


class Action(Served):
    """An action's goal with a cancel button; `progress` is a field of the feedback that goes from
    0 to `progress_max`; `feedback` and `result` are shown with `{field}` filled in."""

    kind: Literal["action"]
    action: Topic
    type: ActionType
    goal: dict[str, Any] = Field(default_factory=dict)
    progress: FieldPath | None = None
    progress_max: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 100.0
    feedback: str = ""
    result: str = ""
    span: Span = 6

    part: ClassVar[str] = "goal"
    role: ClassVar[ServerRole] = "AS"
    own_types: ClassVar[tuple[str, ...]] = OF_ACTIONS

    @property
    def template(self) -> dict[str, Any]:
        return self.goal

    @property
    def server(self) -> str:
        return self.action

    @property
    def does(self) -> str:
        return f"sends a goal to {self.action} ({self.type})"

    def sent_type(self, interfaces: Interfaces) -> str:
        return interfaces.action(self.type).goal

    def answer_faults(self, place: str, checking: Checking) -> Iterator[Fault]:
        interfaces = checking.interfaces
        types = interfaces.action(self.type)
        if self.progress is not None:
            yield from _path(f"{place}.progress", types.feedback, self.progress, NUMBER, interfaces)
        yield from _shown(f"{place}.feedback", types.feedback, self.feedback, interfaces)
        yield from _shown(f"{place}.result", types.result, self.result, interfaces)


def _shown(place: str, type_name: str, template: str, interfaces: Interfaces) -> Iterator[Fault]:
    for path in PLACE.findall(template):
        yield from _path(place, type_name, path, ".*", interfaces)


def _path(place: str, type_name: str, path: str, kind: str, interfaces: Interfaces) -> Iterator[Fault]:
    """A fault if there is no such field, or not of this kind (a regular expression)."""
    try:
        found = interfaces.field_type(type_name, path)
    except InterfaceError as error:
        yield Fault(place, str(error))
        return
    if not re.fullmatch(kind, found):
        yield Fault(place, f'"{path}" is {found}: it must be {WORDS.get(kind, kind)}')
