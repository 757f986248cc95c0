"""How often somebody may do something: token buckets, one for each who does it."""

import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Final

REMEMBERED: Final = 500


@dataclass(frozen=True, slots=True)
class Quota:
    """So many at once, and so many a second after these."""

    at_once: float
    per_s: float


@dataclass(slots=True)
class _Bucket:
    """What is left, at a time in monotonic seconds."""

    left: float
    at: float


class Buckets:
    """One quota for each key; those not used for the longest time are forgotten, and full again."""

    def __init__(self, quota: Quota, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._quota = quota
        self._monotonic = monotonic
        self._buckets: OrderedDict[Hashable, _Bucket] = OrderedDict()

    def has(self, key: Hashable) -> bool:
        """Whether there is one left now."""
        bucket = self._buckets.get(key)
        return bucket is None or self._now(bucket) >= 1

    def take(self, key: Hashable) -> None:
        """Takes one, which has to be there."""
        bucket = self._buckets.setdefault(key, _Bucket(self._quota.at_once, self._monotonic()))
        self._buckets.move_to_end(key)
        bucket.left = self._now(bucket) - 1
        while len(self._buckets) > REMEMBERED:
            self._buckets.popitem(last=False)

    def _now(self, bucket: _Bucket) -> float:
        now, quota = self._monotonic(), self._quota
        bucket.left = min(quota.at_once, bucket.left + (now - bucket.at) * quota.per_s)
        bucket.at = now
        return bucket.left
