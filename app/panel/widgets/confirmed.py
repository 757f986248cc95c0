"""The keys of commands about the question before a press, and who answers it."""

from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator

from app.interfaces.validation import format_value
from app.panel.base import Description, Label

Confirmation = Literal["", "pin", "two_persons"]
CONFIRMATIONS: Final = ("pin", "two_persons")


def _check_confirm(value: Any) -> Any:
    if not isinstance(value, bool) and value not in CONFIRMATIONS:
        raise ValueError(f'must be true, false, "pin" or "two_persons", not {format_value(value)}')
    return value


ConfirmPress = Annotated[bool | Literal["pin", "two_persons"], BeforeValidator(_check_confirm)]


class Confirmed(Description):
    """With `confirm_press = true` the page asks before a press, and says `consequence`; with "pin" the
    user enters the PIN again, with "two_persons" a second user does."""

    confirm_press: ConfirmPress = False
    consequence: Label | None = None

    @property
    def confirmation(self) -> Confirmation:
        """By whom a press is confirmed with a PIN, password or badge; "" for nobody."""
        return "" if isinstance(self.confirm_press, bool) else self.confirm_press

    @property
    def asks(self) -> bool:
        """Whether the page asks without a PIN."""
        return self.confirm_press is True


def confirmation_of(command: object) -> Confirmation:
    """By whom a press of a command is confirmed; "" for nobody."""
    return command.confirmation if isinstance(command, Confirmed) else ""
