"""Keys that commands share: the role and colour of a button, and the confirmation of a press."""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator

from app.panel.base import Description, Label
from app.ros.messages.validation import format_value

# The keys of commands about the question before a press, and who answers it.

Confirmation = Literal["", "pin", "two_persons"]
CONFIRMATIONS: Final = ("pin", "two_persons")


def _check_confirm(value: Any) -> Any:
    if not isinstance(value, bool) and value not in CONFIRMATIONS:
        raise ValueError(f'must be true, false, "pin" or "two_persons", not {format_value(value)}')
    return value


ConfirmPress = Annotated[bool | Literal["pin", "two_persons"], BeforeValidator(_check_confirm)]


class ConfirmationKeys(Description):
    """With `confirm_press = true` the page asks before a press, and says `consequence`; with "pin" the
    user enters the PIN again, with "two_persons" a second user does."""

    confirm_press: ConfirmPress = False
    consequence: Label | None = None

    @property
    def confirmation(self) -> Confirmation:
        """By whom a press is confirmed with a PIN, password or badge; "" for no one."""
        return "" if isinstance(self.confirm_press, bool) else self.confirm_press

    @property
    def asks(self) -> bool:
        """Whether the page asks without a PIN."""
        return self.confirm_press is True


def confirmation_of(command: object) -> Confirmation:
    """By whom a press of a command is confirmed; "" for no one."""
    return command.confirmation if isinstance(command, ConfirmationKeys) else ""


# What a key is for, and the colours that IEC 60204-1 leaves for it.

KeyRole = Literal["start", "stop", "reset", "hold", "toggle", "neutral"]
KeyColour = Literal["white", "grey", "black", "blue", "red", "yellow", "green"]

# Red on yellow belongs to emergency stops, which no screen has. Green is left out everywhere: what is
# normal has no colour.
COLOURS: Final[Mapping[KeyRole, tuple[KeyColour, ...]]] = {
    "start": ("white", "grey"),
    "stop": ("black", "grey"),
    "reset": ("blue", "white", "grey", "black"),
    "hold": ("white", "grey", "black"),
    "toggle": ("white", "grey", "black"),
    "neutral": ("white", "grey", "black"),
}
# A key of another role has the colour of the theme's keys.
OWN_COLOURS: Final[Mapping[KeyRole, KeyColour]] = {"start": "white", "stop": "black", "reset": "blue"}
# Signs that look like an icon: a key with such a label has the sign alone.
SIGNS: Final[Mapping[str, str]] = {
    "minus": "-−–",
    "plus": "+",
    "arrow-left": "←",
    "arrow-right": "→",
    "arrow-up": "↑",
    "arrow-down": "↓",
    "x": "×✕",
}
ICONS: Final[Mapping[KeyRole, str]] = {"start": "play", "stop": "square", "reset": "rotate-ccw"}
