"""Rate limits: one token bucket for each client."""

import time
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Final

MAX_BUCKETS: Final = 500


@dataclass(frozen=True, slots=True)
class Quota:
    """`burst` actions at once, then `per_s` a second."""

    burst: float
    per_s: float


@dataclass(slots=True)
class _Bucket:
    """`tokens` left at `updated_at` (monotonic seconds)."""

    tokens: float
    updated_at: float


class TokenBuckets:
    """One bucket for each key. The least recently used buckets are dropped, which refills them."""

    def __init__(self, quota: Quota, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._quota = quota
        self._monotonic = monotonic
        self._buckets: OrderedDict[Hashable, _Bucket] = OrderedDict()

    def has_token(self, key: Hashable) -> bool:
        """Whether the key has a token now."""
        bucket = self._buckets.get(key)
        return bucket is None or self._refill(bucket) >= 1

    def take_token(self, key: Hashable) -> None:
        """Takes a token. Without one the bucket owes it: it is refilled later."""
        bucket = self._buckets.setdefault(key, _Bucket(self._quota.burst, self._monotonic()))
        self._buckets.move_to_end(key)
        bucket.tokens = self._refill(bucket) - 1
        while len(self._buckets) > MAX_BUCKETS:
            self._buckets.popitem(last=False)

    def __len__(self) -> int:
        """The number of buckets that are kept."""
        return len(self._buckets)

    def _refill(self, bucket: _Bucket) -> float:
        now, quota = self._monotonic(), self._quota
        bucket.tokens = min(quota.burst, bucket.tokens + (now - bucket.updated_at) * quota.per_s)
        bucket.updated_at = now
        return bucket.tokens
