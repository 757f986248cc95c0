"""A press, as it travels from the request to its receipt."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Generic, Self, TypeVar

from app.cell.permission.roles import ConfirmedBy
from app.panel.template import needed_inputs
from app.panel.widgets.families import Command
from app.records import Origin
from app.records.entry import FinalCheck, OnCorrection, no_check
from app.records.press_record import LoggedPress, PressAction, origin_of
from app.records.principal import Principal

EVENT_ID: Final = r"^[0-9a-f]{1,32}-[0-9]{1,18}$"  # <instance_id>-<version>
MAX_ID_LENGTH: Final = 64
PRESS_ID: Final = rf"^[A-Za-z0-9_.:-]{{1,{MAX_ID_LENGTH}}}$"
_sorted: Final = json.JSONEncoder(sort_keys=True).encode

Widget = TypeVar("Widget", bound=Command, covariant=True)


@dataclass(frozen=True, slots=True)
class Press(Generic[Widget]):
    """A press or a hold of a widget by a client. A cancel has no id and no inputs.

    `inputs` are JSON values by input id. `seen` is the id of the last event that the operator saw, ""
    if unknown. `at` is the time of the press in the server's time, None if unknown. `confirmed` is who
    confirmed it with a PIN, None for no one.
    """

    id: str
    widget: Widget
    inputs: Mapping[str, Any]
    principal: Principal
    seen: str = ""
    at: float | None = None
    confirmed: ConfirmedBy | None = None

    @property
    def origin(self) -> Origin:
        """The origin, as in the operator's log."""
        return origin_of(self.principal, self.seen)

    @property
    def needed_inputs(self) -> dict[str, Any]:
        """The inputs that the widget uses."""
        return needed_inputs(self.widget, self.inputs)

    @property
    def fingerprint(self) -> str:
        """A hash of all inputs."""
        return fingerprint(self.inputs)

    def with_needed_inputs(self) -> Self:
        """The press without the inputs that the widget does not use."""
        return replace(self, inputs=self.needed_inputs)

    def logged(self, action: PressAction = "press") -> LoggedPress:
        """The press as it is logged and recorded."""
        return LoggedPress(self.id, self.widget.id, self.needed_inputs, self.origin, action)


@dataclass(frozen=True, slots=True)
class PressHandle:
    """A press that is being sent, for the client or tracker that sends it.

    `correct` is called with an outcome that is known after the receipt. `final_check` is called right
    before sending; it raises PressRefused if the press may no longer be sent. `entry` is the hash of
    the press's entry in the operator's log, "" without an entry.
    """

    press_id: str
    correct: OnCorrection
    final_check: FinalCheck = no_check
    entry: str = ""


def fingerprint(inputs: Mapping[str, Any]) -> str:
    """A hash of the inputs, which are JSON values."""
    return hashlib.sha256(_sorted(inputs).encode()).hexdigest()
