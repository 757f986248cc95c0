"""The words of the keypad and the keyboard on the screen, by their codes."""

from typing import Any, Final

from app.i18n import say
from app.i18n.values import number_like

ENTRY_WORDS: Final = (
    "keypad_now",
    "keypad_clear",
    "keypad_delete",
    "keypad_sign",
    "keypad_decimal",
    "keypad_decimal_name",
    "keypad_min",
    "keypad_max",
    "keypad_close",
    "keypad_enter",
    "keypad_too_low",
    "keypad_too_high",
    "keypad_off_step",
    "keypad_outside",
    "keypad_empty",
    "keypad_locks",
    "keyboard_locks",
    "keyboard_done",
    "keyboard_space",
    "keyboard_shift",
    "keyboard_signs",
    "keyboard_left",
    "keyboard_right",
)

# Why a typed text is not a number, at its input and in the keypad.
UNREADABLE: Final[dict[str, Any]] = {
    "keypad_no_number": say("keypad_no_number", example=number_like(whole=False)),
    "keypad_no_whole": say("keypad_no_whole", example=number_like(whole=True)),
}
