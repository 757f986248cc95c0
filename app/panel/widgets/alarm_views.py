"""Alarms on a page: a list of some of them, or the line of the most urgent one."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from app.panel.base import Rows, distinct
from app.panel.file.wording import no_such
from app.panel.shared_keys import Priorities, RobotsKey
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource
from app.ros.messages.validation import format_value
from app.system.errors import Fault

MOST_LINES: Final = 50


def _parse_groups(value: Any) -> tuple[str, ...]:
    """The groups, from one or a list of them."""
    groups = [value] if isinstance(value, str) else value
    if not isinstance(groups, list | tuple) or not all(isinstance(g, str) and g for g in groups):
        raise ValueError(f"must be a group of alarms, or a list of groups, not {format_value(value)}")
    return distinct(tuple(groups))


Groups = Annotated[
    tuple[str, ...],
    BeforeValidator(_parse_groups),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
]


class AlarmView(RobotsKey, DisplayWidget):
    """Shows the alarms of some `group`s and `priorities`; without these keys of all. `robots`: those of
    the robot whose page it is on, or of all robots."""

    shows_alarms: ClassVar[bool] = True

    group: Groups = ()
    priorities: Priorities = ()

    def sources(self) -> Iterator[TopicSource]:
        yield from ()  # alarms listen to their topics

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for i, group in enumerate(self.group):
            if group not in checking.alarm_groups:
                at = f"{place}.group[{i}]" if len(self.group) > 1 else f"{place}.group"
                message = no_such("group of alarms", group, checking.alarm_groups)
                yield Fault(at, message, cause=f"group {group}")


class AlarmListView(AlarmView):
    """A list of alarms, the most urgent first: at most `lines` of them, the others are counted."""

    kind: Literal["alarm_list"]
    lines: Annotated[int, Field(ge=1, le=MOST_LINES)] = 10
    rows: Rows = 3


class AlarmLineView(AlarmView):
    """The newest unacknowledged alarm of the highest priority, as the line of the frame has it."""

    kind: Literal["alarm_line"]
