"""What an operator does about an alarm that stands."""

from typing import NamedTuple

from app.i18n import TextLike


class AlarmAction(NamedTuple):
    """`alarm` is the id in the panel file, `action` what to do, "" where nothing is said, `picture` a
    file of the panel's pictures, "" without one."""

    alarm: str
    action: TextLike
    picture: str
