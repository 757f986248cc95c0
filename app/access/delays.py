"""Growing delays after failed sign-ins, for each user at each address.

A stranger at another address delays only that address: the panel at the cell, whose address is
loopback, has its own delays. Pure, with an injected clock.
"""

import math
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

FREE_TRIES: Final = 5
FIRST_DELAY_S: Final = 30.0
LONGEST_DELAY_S: Final = 900.0
FORGOTTEN_AFTER_S: Final = 3600.0
# An address that tries many users has a delay too, after more tries.
ADDRESS_TRIES: Final = 20
KEPT: Final = 5000
ANY_USER: Final = ""


@dataclass(slots=True)
class _Failures:
    count: int
    last_at: float


class SignInDelays:
    """Counts failures. `free` tries have no delay, then 30 s, doubled by each further failure up to
    900 s. They are forgotten by a success, or after an hour without a failure."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._monotonic = monotonic
        self._failures: OrderedDict[tuple[str, str], _Failures] = OrderedDict()

    def wait_s(self, user: str, address: str) -> int:
        """Whole seconds until the next try; 0 if it may be made now."""
        waits = (
            self._wait(self._key(user, address), FREE_TRIES),
            self._wait((ANY_USER, address), ADDRESS_TRIES),
        )
        return math.ceil(max(waits))

    def tries_left(self, user: str, address: str) -> int:
        """Tries before there is a delay; during and after delays 1."""
        failures = self._current(self._key(user, address))
        return max(1, FREE_TRIES - failures.count) if failures else FREE_TRIES

    def failed(self, user: str, address: str) -> None:
        """Counts a failure. It is counted before the secret is checked, so that tries that are made at
        the same time count too; `succeeded` takes it back."""
        for key in (self._key(user, address), (ANY_USER, address)):
            failures = self._current(key)
            count = failures.count + 1 if failures else 1
            self._failures[key] = _Failures(count, self._monotonic())
            self._failures.move_to_end(key)
        while len(self._failures) > KEPT:
            self._failures.popitem(last=False)

    def succeeded(self, user: str, address: str) -> None:
        """Forgets the failures of the user at this address, and the try that succeeded."""
        self._failures.pop(self._key(user, address), None)
        if (of_address := self._failures.get((ANY_USER, address))) is not None:
            of_address.count = max(0, of_address.count - 1)

    def _wait(self, key: tuple[str, str], free: int) -> float:
        failures = self._current(key)
        if failures is None or failures.count < free:
            return 0.0
        delay = min(LONGEST_DELAY_S, FIRST_DELAY_S * 2.0 ** min(failures.count - free, 10))
        return max(0.0, failures.last_at + delay - self._monotonic())

    def _current(self, key: tuple[str, str]) -> _Failures | None:
        failures = self._failures.get(key)
        if failures and self._monotonic() - failures.last_at > FORGOTTEN_AFTER_S:
            del self._failures[key]
            return None
        return failures

    @staticmethod
    def _key(user: str, address: str) -> tuple[str, str]:
        """A badge, which names no user, has a key of its own."""
        return user.casefold() or "\0badge", address
