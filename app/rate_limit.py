"""How often somebody may do something: token buckets, one for each who does it."""

import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Final

MAX_BUCKETS: Final = 500


@dataclass(frozen=True, slots=True)
class Quota:
    """So many at once, and so many a second after these."""

    burst: float
    per_s: float


@dataclass(slots=True)
class _Bucket:
    """What is left, at a time in monotonic seconds."""

    tokens: float
    updated_at: float


class TokenBuckets:
    """One quota for each key; those not used for the longest time are forgotten, and full again."""

    def __init__(self, quota: Quota, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._quota = quota
        self._monotonic = monotonic
        self._buckets: OrderedDict[Hashable, _Bucket] = OrderedDict()

    def has_token(self, key: Hashable) -> bool:
        """Whether there is one left now."""
        bucket = self._buckets.get(key)
        return bucket is None or self._refill(bucket) >= 1

    def take_token(self, key: Hashable) -> None:
        """Takes one, which has to be there."""
        bucket = self._buckets.setdefault(key, _Bucket(self._quota.burst, self._monotonic()))
        self._buckets.move_to_end(key)
        bucket.tokens = self._refill(bucket) - 1
        while len(self._buckets) > MAX_BUCKETS:
            self._buckets.popitem(last=False)

    def _refill(self, bucket: _Bucket) -> float:
        now, quota = self._monotonic(), self._quota
        bucket.tokens = min(quota.burst, bucket.tokens + (now - bucket.updated_at) * quota.per_s)
        bucket.updated_at = now
        return bucket.tokens
