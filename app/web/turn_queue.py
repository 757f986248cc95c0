"""Whose request is next: those that may move something first, then what the kiosk's own machine reads,
then what others read, and within each of these the clients in turn."""

from collections import OrderedDict, deque
from enum import IntEnum
from typing import Final, Generic, TypeVar

from app.permission.client_places import KIOSK

Item = TypeVar("Item")


PASSED_MOST: Final = 4


class Lane(IntEnum):
    """A lane goes before those after it, but not more than `PASSED_MOST` times in a row."""

    COMMAND = 0
    KIOSK = 1
    READ = 2


def lane_of(client: str, command: bool) -> Lane:
    """The lane of a request; `command`: it may move something."""
    if command:
        return Lane.COMMAND
    return Lane.KIOSK if client in KIOSK else Lane.READ


class TurnQueue(Generic[Item]):
    """Waiting requests."""

    def __init__(self, client_most: int, kiosk_most: int) -> None:
        """At most so many requests of a client, and of the kiosk's own machine, wait in each lane."""
        self._client_most = client_most
        self._kiosk_most = kiosk_most
        self._lanes: dict[Lane, OrderedDict[str, deque[Item]]] = {lane: OrderedDict() for lane in Lane}
        self._passed = dict.fromkeys(Lane, 0)  # how often in a row a lane had to wait for one before it

    def __bool__(self) -> bool:
        """Whether a request waits."""
        return any(self._lanes.values())

    def has_room(self, client: str, lane: Lane) -> bool:
        """Whether one more request of the client may wait."""
        most = self._kiosk_most if client in KIOSK else self._client_most
        return len(self._lanes[lane].get(client, ())) < most

    def add(self, client: str, lane: Lane, item: Item) -> None:
        self._lanes[lane].setdefault(client, deque()).append(item)

    def next_lane(self, reads: bool) -> Lane | None:
        """The lane of the next request; None if none waits. `reads`: whether `READ` may be next."""
        waiting = [lane for lane in Lane if self._lanes[lane] and (reads or lane is not Lane.READ)]
        late = (lane for lane in waiting if self._passed[lane] >= PASSED_MOST)
        return next(late, waiting[0] if waiting else None)

    def take(self, lane: Lane) -> Item:
        """Removes and returns the next request of a lane. Its client comes after the others then."""
        for other in Lane:
            self._passed[other] = self._passed[other] + 1 if other > lane and self._lanes[other] else 0
        clients = self._lanes[lane]
        client, items = next(iter(clients.items()))
        item = items.popleft()
        if items:
            clients.move_to_end(client)
        else:
            del clients[client]
        return item
