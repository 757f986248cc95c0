"""The description of an interlock: a condition that permits commands."""

from typing import TYPE_CHECKING, ClassVar, Literal

from app.i18n import PanelText, TextLike
from app.panel.base import Description, Label, panel_text
from app.panel.condition import NamedCondition

if TYPE_CHECKING:
    HelpText = str | PanelText
    Picture = str | PanelText
else:
    HelpText = panel_text(400)
    Picture = panel_text(255)


class Help(Description):
    """What to do while an interlock locks: `text` has a step a line, and `picture` is a file of the
    folder of pictures."""

    text: HelpText | None = None
    picture: Picture | None = None


class Interlock(NamedCondition):
    """A condition that permits the commands which name it, and locks them while it is not met.
    `locked` is its own sentence then."""

    noun: ClassVar[str] = "an interlock"

    require_publisher: bool = False
    publishers: Literal["any", "one"] = "any"
    locked: Label | None = None
    help: Help = Help()

    @property
    def own_sentence(self) -> str | PanelText | None:
        return self.locked

    @property
    def name(self) -> TextLike:
        return self.label or self.id

    @property
    def advice(self) -> TextLike:
        """What to do while it is not met, a step a line; "" if the panel file does not say."""
        return self.help.text or self.action or ""
