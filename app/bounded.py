"""A queue that is bounded in number and in bytes: the oldest items leave it."""

from collections import deque
from collections.abc import Iterator
from typing import Generic, TypeVar

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
