"""The controls that an alarm locks, also those of other robots: `inhibits` of `[[alarm]]`."""

import re
from collections.abc import Iterator, Mapping
from typing import Annotated, Final, NamedTuple

from pydantic import AfterValidator, Field

from app.interfaces.validation import format_value

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


def _check_unique(names: tuple[str, ...]) -> tuple[str, ...]:
    for i, name in enumerate(names):
        if name in names[:i]:
            raise ValueError(f"names {format_value(name)} twice")
    return names


Name = Annotated[str, AfterValidator(_check_name)]
InhibitedNames = Annotated[tuple[Name, ...], Field(strict=False), AfterValidator(_check_unique)]


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
