"""Alarms on a page: a list of some of them, or the line of the most urgent one."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

from app.panel.file.wording import list_names
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource
from app.ros.messages.validation import format_value
from app.system.errors import Fault

MOST_LINES: Final = 50


def _parse_groups(value: Any) -> tuple[str, ...]:
    """The groups, from one or a list of them."""
    groups = [value] if isinstance(value, str) else value
    if not isinstance(groups, list | tuple) or not all(isinstance(g, str) and g for g in groups):
        raise ValueError(f"must be a group of alarms, or a list of groups, not {format_value(value)}")
    return _unique(tuple(groups))


def _unique(values: tuple[Any, ...]) -> tuple[Any, ...]:
    if not values:
        raise ValueError("is empty: leave the key out for all")
    for i, value in enumerate(values):
        if value in values[:i]:
            raise ValueError(f"has {format_value(value)} twice")
    return values


Groups = Annotated[
    tuple[str, ...],
    BeforeValidator(_parse_groups),
    WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "array", "items": {"type": "string"}}]}),
]
Priorities = Annotated[
    tuple[Annotated[int, Field(ge=1, le=4)], ...], Field(strict=False), AfterValidator(_unique)
]


class AlarmView(DisplayWidget):
    """Shows the alarms of some `group`s and `priorities`; without these keys of all. `robots`: those of
    the robot whose page it is on, or of all robots."""

    shows_alarms: ClassVar[bool] = True

    group: Groups = ()
    priorities: Priorities = ()
    robots: Literal["this", "all"] = "this"

    def sources(self) -> Iterator[TopicSource]:
        yield from ()  # alarms listen to their topics

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for i, group in enumerate(self.group):
            if group not in checking.alarm_groups:
                at = f"{place}.group[{i}]" if len(self.group) > 1 else f"{place}.group"
                message = f'no alarm is of the group "{group}"; there is'
                yield Fault(
                    at, f"{message} {list_names(checking.alarm_groups)}", cause=f"group {group}"
                )


class AlarmListView(AlarmView):
    """A list of alarms, the most urgent first: at most `lines` of them, the others are counted."""

    kind: Literal["alarm_list"]
    lines: Annotated[int, Field(ge=1, le=MOST_LINES)] = 10
    rows: Annotated[int, Field(ge=1, le=8)] = 3


class AlarmLineView(AlarmView):
    """The newest unacknowledged alarm of the highest priority, as the line of the frame has it."""

    kind: Literal["alarm_line"]
