"""Limits how many refusals get their own entries in the operator's log; the others are summarised.

A client that floods the server with refused presses would otherwise push older entries out of the log,
origin size is limited. There is a quota per browser, per address (a browser may drop its cookie) and in
total. Presses that are sent do not count.
"""

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from app.audit.entry import Entry, Origin, new_entry
from app.clock import format_time
from app.i18n import render, say

SUMMARY_INTERVAL_S: Final = 60.0  # from the first suppressed refusal to the summary entry
MAX_BROWSERS: Final = 5  # with their own summary entry per interval; the others share one
MAX_QUOTAS: Final = 500  # browsers and addresses


@dataclass(frozen=True, slots=True)
class Allowance:
    """A quota: `burst` at once, then one more every `every_s` seconds."""

    burst: float
    every_s: float


OF_BROWSER: Final = Allowance(60, 30.0)
OF_ADDRESS: Final = Allowance(200, 15.0)
OF_ALL: Final = Allowance(600, 10.0)


class HasOrigin(Protocol):
    """An origin, or an entry with its fields."""

    @property
    def address(self) -> str: ...
    @property
    def browser(self) -> str: ...


class _Balance:
    """The rest of an allowance; may be negative. Times in monotonic seconds."""

    def __init__(self, of: Allowance, now: float) -> None:
        self._of = of
        self._left = of.burst
        self._at = now

    def refill(self, now: float) -> float:
        self._left = min(self._of.burst, self._left + (now - self._at) / self._of.every_s)
        self._at = now
        return self._left

    def take(self, now: float) -> None:
        self._left = self.refill(now) - 1


@dataclass(slots=True)
class _Suppressed:
    """Refusals of one browser without entries; `limited`: they were over the rate limit."""

    origin: Origin
    limited: bool
    since: float  # seconds since the epoch
    count: int = 0


class RefusalQuota:
    """The quotas of one log. Used on the event loop only."""

    def __init__(
        self,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self._monotonic = monotonic
        self._wall = wall
        self._all = _Balance(OF_ALL, monotonic())
        self._balances: OrderedDict[tuple[str, ...], _Balance] = OrderedDict()
        self._suppressed: dict[tuple[str, str, bool], _Suppressed] = {}
        self.left_out = 0

    def allowed(self, origin: HasOrigin) -> bool:
        """Whether a refusal may have its own entry."""
        now = self._monotonic()
        known = (self._balances.get(key) for key in _keys(origin))
        return all(left is None or left.refill(now) >= 1 for left in (self._all, *known))

    def count(self, origin: HasOrigin) -> None:
        """Counts a refusal with its own entry."""
        now = self._monotonic()
        self._all.take(now)
        for key, of in zip(_keys(origin), (OF_BROWSER, OF_ADDRESS), strict=True):
            self._balances.setdefault(key, _Balance(of, now)).take(now)
            self._balances.move_to_end(key)
        while len(self._balances) > MAX_QUOTAS:
            self._balances.popitem(last=False)

    def suppress(self, origin: Origin, limited: bool = False) -> bool:
        """Counts a refusal without an entry; `limited`: it was over the rate limit. Returns whether it
        is the first since the last summary."""
        first = not self._suppressed
        key = (origin.address, origin.browser, limited)
        if key not in self._suppressed and len(self._suppressed) >= MAX_BROWSERS:
            key, origin = ("", "", limited), Origin(address="", who=render(say("others")))
        self._suppressed.setdefault(key, _Suppressed(origin, limited, self._wall())).count += 1
        self.left_out += not limited
        return first

    def summary_due(self) -> list[Entry]:
        """The summary entries, one per browser; the counts begin at zero again."""
        suppressed, self._suppressed = self._suppressed, {}
        return [_entry(one) for one in suppressed.values()]


def _keys(origin: HasOrigin) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return (origin.address, origin.browser), (origin.address,)


def _entry(suppressed: _Suppressed) -> Entry:
    origin = suppressed.origin
    name = " ".join(filter(None, (origin.who, f"({origin.address})" if origin.address else "")))
    sentence = "log_more_limited" if suppressed.limited else "log_more_refused"
    reason = say(sentence, count=suppressed.count, name=name, since=format_time(suppressed.since))
    return new_entry("refused", origin, {"more": suppressed.count}, outcome="refused", reason=reason)
