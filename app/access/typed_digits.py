"""The digits of a PIN that browsers without scripts have typed so far, one request for each."""

import time
from collections.abc import Callable
from typing import Final

DIGITS: Final = frozenset("0123456789")
MOST_DIGITS: Final = 12
KEPT_S: Final = 60.0
KEPT: Final = 100  # browsers


class TypedDigits:
    """Those of each browser, for one user or one question at a time, in memory only."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        self._typed: dict[str, tuple[str, str, float]] = {}  # client → (name, digits, time)

    def read(self, client: str, name: str) -> str:
        """The digits that a browser has typed for this user or question; "" after a minute."""
        typed_for, digits, at = self._typed.get(client, ("", "", 0.0))
        return digits if typed_for == name and self._monotonic() - at < KEPT_S else ""

    def press(self, client: str, name: str, digit: str) -> None:
        """A digit, "delete" or "clear"."""
        digits = self.read(client, name)
        self._typed.pop(client, None)
        if digit == "delete":
            digits = digits[:-1]
        elif digit in DIGITS:
            digits = (digits + digit)[:MOST_DIGITS]
        else:
            digits = ""
        if client and digits:
            self._typed[client] = (name, digits, self._monotonic())
        while len(self._typed) > KEPT:
            self._typed.pop(next(iter(self._typed)))
