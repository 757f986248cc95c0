"""Limits of what robots and clients send: a bounded queue, a bounded dictionary, and rate limits."""

import time
from collections import OrderedDict, deque
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

# A queue that is bounded in number and in bytes: the oldest items leave it.

Item = TypeVar("Item")


class BoundedQueue(Generic[Item]):
    """Items in their order, each with its size in bytes."""

    __slots__ = ("_bytes", "_items", "_most", "_most_bytes", "_sizes")

    def __init__(self, most: int, most_bytes: int) -> None:
        self._most = most
        self._most_bytes = most_bytes
        self._items: deque[Item] = deque()
        self._sizes: deque[int] = deque()
        self._bytes = 0

    def add(self, item: Item, size: int) -> list[Item]:
        """Adds an item; returns those that left. The newest stays, however large."""
        self._items.append(item)
        self._sizes.append(size)
        self._bytes += size
        left = []
        while len(self) > self._most or (self._bytes > self._most_bytes and len(self) > 1):
            left.append(self.take())
        return left

    def take(self) -> Item:
        """Removes the oldest item; IndexError without one."""
        self._bytes -= self._sizes.popleft()
        return self._items.popleft()

    def clear(self) -> None:
        """Removes all items."""
        self._items.clear()
        self._sizes.clear()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._items)

    def __iter__(self) -> Iterator[Item]:
        return iter(self._items)

    def __getitem__(self, index: int) -> Item:
        return self._items[index]


Key = TypeVar("Key")


class BoundedDict(OrderedDict[Key, Item]):
    """The `most` entries that were set last."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def __setitem__(self, key: Key, item: Item) -> None:
        super().__setitem__(key, item)
        self.move_to_end(key)
        if len(self) > self._most:
            self.popitem(last=False)


# Rate limits: one token bucket for each client.

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
        self._buckets = BoundedDict[Hashable, _Bucket](MAX_BUCKETS)

    def has_token(self, key: Hashable) -> bool:
        """Whether the key has a token now."""
        bucket = self._buckets.get(key)
        return bucket is None or self._refill(bucket) >= 1

    def take_token(self, key: Hashable) -> None:
        """Takes a token. Without one the bucket owes it: it is refilled later."""
        bucket = self._buckets.get(key) or _Bucket(self._quota.burst, self._monotonic())
        self._buckets[key] = bucket
        bucket.tokens = self._refill(bucket) - 1

    def __len__(self) -> int:
        """The number of buckets that are kept."""
        return len(self._buckets)

    def _refill(self, bucket: _Bucket) -> float:
        now, quota = self._monotonic(), self._quota
        bucket.tokens = min(quota.burst, bucket.tokens + (now - bucket.updated_at) * quota.per_s)
        bucket.updated_at = now
        return bucket.tokens
