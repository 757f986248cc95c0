"""Commands that call a service or send an action's goal."""

from typing import Annotated, Any, Literal

from pydantic import Field

from app.panel.base import ActionType, FieldPath, Interlocks, Placed, Seconds, ServiceType, Span, Topic


class Call(Placed):
    """A service call; `success` and `message` are fields of the response, found by themselves
    where it has a bool and a string of these names; `answer` is shown with `{field}` filled in."""

    kind: Literal["call"]
    service: Topic
    type: ServiceType
    request: dict[str, Any] = Field(default_factory=dict)
    interlocks: Interlocks = Field(default=(), alias="interlock")
    timeout_s: Seconds = 5.0
    success: FieldPath | None = None
    message: FieldPath | None = None
    answer: str = ""
    confirm_press: bool = False
    span: Span = 4

    @property
    def template(self) -> dict[str, Any]:
        return self.request


class Action(Placed):
    """An action's goal with a cancel button; `progress` is a field of the feedback that goes from
    0 to `progress_max`; `feedback` and `result` are shown with `{field}` filled in."""

    kind: Literal["action"]
    action: Topic
    type: ActionType
    goal: dict[str, Any] = Field(default_factory=dict)
    interlocks: Interlocks = Field(default=(), alias="interlock")
    timeout_s: Seconds = 5.0
    progress: FieldPath | None = None
    progress_max: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 100.0
    feedback: str = ""
    result: str = ""
    confirm_press: bool = False
    span: Span = 6

    @property
    def template(self) -> dict[str, Any]:
        return self.goal
