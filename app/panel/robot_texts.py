"""The texts of a robot in the languages of its readers: `[texts]` of a panel file."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from app.panel.base import panel_text
from app.system.texts import PanelText, TextLike

if TYPE_CHECKING:
    RobotText = str | PanelText
else:
    RobotText = panel_text(500)

RobotTexts = Mapping[str, str | PanelText]
NO_TEXTS: Final[RobotTexts] = {}


def robot_text(texts: RobotTexts, said: Any, plain: TextLike) -> TextLike:
    """What an operator reads where a robot publishes the code or text `said`: the entry of the table,
    else `plain`. Spaces around it don't count."""
    return texts.get(said.strip(), plain) if texts and isinstance(said, str) else plain
