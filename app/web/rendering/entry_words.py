"""The words of the keypad and the keyboard on the screen, by their codes."""

from typing import Final

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
    "keypad_no_number",
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
