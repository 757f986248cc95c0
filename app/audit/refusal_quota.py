"""Limits how many refusals get their own entries in the operator's log; the others are summarised.

A client that floods the server with refused presses would otherwise push older entries out of the log,
whose size is limited. There is a quota per browser, per address (a browser may drop its cookie) and in
total. Presses that are sent do not count.
"""

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Final, Protocol

from app.audit.entry import Entry, Origin, new_entry
from app.clock import format_time
from app.i18n import render, say
from app.rate_limit import Quota, TokenBuckets

SUMMARY_INTERVAL_S: Final = 60.0  # from the first suppressed refusal to the summary entry
MAX_BROWSERS: Final = 5  # with their own summary entry per interval; the others share one
OF_BROWSER: Final = Quota(60, per_s=1 / 30)
OF_ADDRESS: Final = Quota(200, per_s=1 / 15)
OF_ALL: Final = Quota(600, per_s=1 / 10)


class HasOrigin(Protocol):
    """An origin, or an entry with its fields."""

    @property
    def address(self) -> str: ...
    @property
    def browser(self) -> str: ...


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
        self._wall = wall
        self._all = TokenBuckets(OF_ALL, monotonic)
        self._browsers = TokenBuckets(OF_BROWSER, monotonic)
        self._addresses = TokenBuckets(OF_ADDRESS, monotonic)
        self._suppressed: dict[tuple[str, str, bool], _Suppressed] = {}
        self.left_out = 0

    def allowed(self, origin: HasOrigin) -> bool:
        """Whether a refusal may have its own entry."""
        return all(buckets.has_token(key) for buckets, key in self._buckets(origin))

    def count(self, origin: HasOrigin) -> None:
        """Counts a refusal with its own entry."""
        for buckets, key in self._buckets(origin):
            buckets.take_token(key)

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
        return [_entry(refusals) for refusals in suppressed.values()]

    def _buckets(self, origin: HasOrigin) -> tuple[tuple[TokenBuckets, Hashable], ...]:
        return (
            (self._all, ""),
            (self._browsers, (origin.address, origin.browser)),
            (self._addresses, origin.address),
        )


def _entry(suppressed: _Suppressed) -> Entry:
    origin = suppressed.origin
    name = " ".join(filter(None, (origin.who, f"({origin.address})" if origin.address else "")))
    sentence = "log_more_limited" if suppressed.limited else "log_more_refused"
    reason = say(sentence, count=suppressed.count, name=name, since=format_time(suppressed.since))
    return new_entry("refused", origin, {"more": suppressed.count}, outcome="refused", reason=reason)
