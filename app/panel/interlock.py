"""The description of an interlock: a condition that permits commands."""

from typing import ClassVar, Literal

from app.i18n import TextLike
from app.panel.condition import NamedCondition


class Interlock(NamedCondition):
    """A condition that permits the commands which name it, and locks them while it is not met."""

    noun: ClassVar[str] = "an interlock"

    require_publisher: bool = False
    publishers: Literal["any", "one"] = "any"

    @property
    def name(self) -> TextLike:
        return self.label or self.id
