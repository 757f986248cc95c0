"""What handles the samples of a topic besides the robot's state: a table by the topic's key. Goals,
confirmations and parameters register in it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from app.ros.dialects.dialect import Endpoint
from app.ros.zenoh.sample import Sample

Take = Callable[[Sample], None]
IsAwaited = Callable[[str], bool]


@dataclass(frozen=True, slots=True)
class SampleHandler:
    """`take` is called with each sample; `is_stored`: the robot's state takes it after that.
    `is_immediate`: a sample of the topic does not wait for the next frame."""

    take: Take
    is_stored: bool = False
    is_immediate: bool = False


class SampleHandlers:
    """The handlers of one robot's samples, and of lost endpoints."""

    def __init__(self) -> None:
        self._by_key: dict[str, SampleHandler] = {}
        self._awaited: dict[str, IsAwaited] = {}
        self._endpoint_lost: list[Callable[[Endpoint], None]] = []

    def add(self, key: str, handler: SampleHandler) -> None:
        self._by_key[key] = handler

    def await_readings(self, key: str, is_awaited: IsAwaited) -> None:
        """Messages of the topic confirm commands while `is_awaited` (called with the key) is true."""
        self._awaited[key] = is_awaited

    def on_endpoint_lost(self, receiver: Callable[[Endpoint], None]) -> None:
        """Calls it with each endpoint that is lost, possibly for a moment."""
        self._endpoint_lost.append(receiver)

    def __contains__(self, key: str) -> bool:
        return key in self._by_key

    @property
    def immediate(self) -> Iterator[str]:
        """The keys of topics of which a sample does not wait for the next frame."""
        return (key for key, handler in self._by_key.items() if handler.is_immediate)

    def take(self, key: str, sample: Sample) -> bool:
        """Calls the topic's handler, if it has one; returns whether the robot's state takes the
        sample."""
        handler = self._by_key.get(key)
        if handler is None:
            return True
        handler.take(sample)
        return handler.is_stored

    def is_awaited(self, key: str) -> bool:
        """Whether the topic's next message may confirm a command."""
        is_awaited = self._awaited.get(key)
        return is_awaited is not None and is_awaited(key)

    def endpoint_lost(self, endpoint: Endpoint) -> None:
        for receiver in self._endpoint_lost:
            receiver(endpoint)
