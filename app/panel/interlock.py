"""The description of an interlock: a condition that permits commands."""

from typing import ClassVar, Literal

from app.i18n import PanelText, TextLike
from app.panel.base import Label
from app.panel.condition import NamedCondition


class Interlock(NamedCondition):
    """A condition that permits the commands which name it, and locks them while it is not met.
    `locked` is its own sentence then."""

    noun: ClassVar[str] = "an interlock"

    require_publisher: bool = False
    publishers: Literal["any", "one"] = "any"
    locked: Label | None = None

    @property
    def own_sentence(self) -> str | PanelText | None:
        return self.locked

    @property
    def name(self) -> TextLike:
        return self.label or self.id
