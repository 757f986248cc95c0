"""How many refusals are entries of the operator's log, and what is told of those that are not.

Who presses what is refused, as fast as a network takes it, would push older entries out of a log that
keeps so much. So there is an allowance for each browser, for each address (a browser may throw its
cookie away) and for all together. What is sent is not counted here.
"""

import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from app.audit.entry import Entry, Origin, new_entry
from app.clock import format_time
from app.i18n import render, say

SUMMARY_INTERVAL_S: Final = 60.0  # from the first that is left out to the entry that tells of it
MAX_BROWSERS: Final = 5  # browsers in that time; the rest is told together
MAX_QUOTAS: Final = 500  # browsers and addresses


@dataclass(frozen=True, slots=True)
class Allowance:
    """So many at once, and one more each `every_s` seconds."""

    burst: float
    every_s: float


OF_BROWSER: Final = Allowance(60, 30.0)
OF_ADDRESS: Final = Allowance(200, 15.0)
OF_ALL: Final = Allowance(600, 10.0)


class HasOrigin(Protocol):
    """An origin, or an entry of it."""

    @property
    def address(self) -> str: ...
    @property
    def browser(self) -> str: ...


class _Balance:
    """What is left of an allowance, at a time in monotonic seconds; less than nothing is a debt."""

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
    """Refusals of one browser that are no entries; `limited`: they were not even judged."""

    origin: Origin
    limited: bool
    since: float  # seconds since the epoch
    count: int = 0


class RefusalQuota:
    """Used on the event loop only."""

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

    def allowed(self, whose: HasOrigin) -> bool:
        """Whether a refusal may be an entry."""
        now = self._monotonic()
        known = (self._balances.get(key) for key in _keys(whose))
        return all(left is None or left.refill(now) >= 1 for left in (self._all, *known))

    def count(self, whose: HasOrigin) -> None:
        """A refusal became an entry."""
        now = self._monotonic()
        self._all.take(now)
        for key, of in zip(_keys(whose), (OF_BROWSER, OF_ADDRESS), strict=True):
            self._balances.setdefault(key, _Balance(of, now)).take(now)
            self._balances.move_to_end(key)
        while len(self._balances) > MAX_QUOTAS:
            self._balances.popitem(last=False)

    def suppress(self, origin: Origin, limited: bool = False) -> bool:
        """A refusal is only counted, `limited` where there were too many presses to judge it; whether
        it is the first since all were told."""
        first = not self._suppressed
        key = (origin.address, origin.browser, limited)
        if key not in self._suppressed and len(self._suppressed) >= MAX_BROWSERS:
            key, origin = ("", "", limited), Origin(address="", who=render(say("others")))
        self._suppressed.setdefault(key, _Suppressed(origin, limited, self._wall())).count += 1
        self.left_out += not limited
        return first

    def summary_due(self) -> list[Entry]:
        """An entry for each browser of which some were left out, and none of these any more."""
        more, self._suppressed = self._suppressed, {}
        return [_entry(one) for one in more.values()]


def _keys(whose: HasOrigin) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return (whose.address, whose.browser), (whose.address,)


def _entry(more: _Suppressed) -> Entry:
    origin = more.origin
    name = " ".join(filter(None, (origin.who, f"({origin.address})" if origin.address else "")))
    sentence = "log_more_limited" if more.limited else "log_more_refused"
    reason = say(sentence, count=more.count, name=name, since=format_time(more.since))
    return new_entry("refused", origin, {"more": more.count}, outcome="refused", reason=reason)
