"""A robot that publishes what was recorded: pure, stepped with time. It has topics only."""

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from app.panel.model import Panel
from app.simulator.bag.recording import Message, Recording
from app.simulator.goals import ActionServer
from app.simulator.simulated import SimulatedTopic
from app.simulator.values.known_types import Moment

STEP_S: Final = 0.01
PAUSE_S: Final = 1.0  # between the last message and the first one of the next round, or the end
EARLY_S: Final = 1e-6  # of floating-point numbers
MOST_AT_ONCE: Final = 5000  # messages of one step: more wait for the next one


class ReplayedRobot:
    """Publishes a recording at `rate` times its speed: a `SimulatedRobot`."""

    def __init__(
        self,
        recording: Recording,
        rate: float = 1.0,
        loop: bool = False,
        ended: Callable[[], None] = lambda: None,
    ) -> None:
        """`ended` is called a pause after the last message, unless it begins again."""
        self._recording = recording
        self._rate = rate
        self._loop = loop
        self._messages = recording.messages()
        self._next: Message | None = None
        self._began: float | None = None
        self._ends_at: float | None = None
        self._ended = ended
        self.step_s = STEP_S
        self.publishes: Mapping[str, SimulatedTopic] = recording.topics
        self.subscribes: Mapping[str, SimulatedTopic] = {}
        self.services: Mapping[str, str] = {}
        self.actions: Mapping[str, ActionServer] = {}

    def receive(self, topic: str, payload: bytes) -> None:
        """It subscribes to nothing."""

    def serve(self, service: str, payload: bytes) -> bytes | None:
        return None

    def step(self, moment: Moment) -> Iterator[tuple[str, bytes]]:
        if self._began is None:
            self._began = moment.t
        for _ in range(MOST_AT_ONCE):
            if self._next is None:
                self._next = next(self._messages, None)
            if self._next is None:
                self._end(moment)
                return
            if self._next.at_s > (moment.t - self._began) * self._rate + EARLY_S:
                return
            yield self._next.topic, self._next.payload
            self._next = None

    def _end(self, moment: Moment) -> None:
        """Begins again after a pause, or ends then."""
        if self._loop:
            self._messages = self._recording.messages()
            self._began = moment.t + PAUSE_S
        elif self._ends_at is None:
            self._ends_at = moment.t + PAUSE_S
        elif moment.t >= self._ends_at:
            self._ended()


def missing(panel: Panel, topics: Mapping[str, SimulatedTopic]) -> Iterator[str]:
    """What a panel needs and a recording does not have, a sentence each."""
    for topic, name in panel.listened().items():
        if topic not in topics:
            yield f"the recording has no {topic} ({name}), which the panel listens to"
        elif topics[topic].type != name:
            yield f"{topic} is {topics[topic].type} in the recording, but {name} in the panel"
    if panel.commands:
        yield (
            "a recording does not answer: no node receives what the panel publishes, and its calls, "
            "actions and parameters stay locked"
        )
