"""The protocol of a simulated robot that a Zenoh peer plays."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from app.interfaces.names import Qos
from app.simulator.goals import ActionServer
from app.simulator.values.known_types import Moment


@dataclass(frozen=True, slots=True)
class SimulatedTopic:
    """A topic that a robot publishes or subscribes to; `type_hash` is "" where it is not known."""

    type: str
    qos: Qos = field(default_factory=Qos)
    type_hash: str = ""


class SimulatedRobot(Protocol):
    """A robot without Zenoh: bytes and time in, bytes out. Names are without the namespace."""

    @property
    def step_s(self) -> float:
        """How often it is stepped, in seconds."""

    @property
    def publishes(self) -> Mapping[str, SimulatedTopic]: ...
    @property
    def subscribes(self) -> Mapping[str, SimulatedTopic]: ...
    @property
    def services(self) -> Mapping[str, str]:
        """Service → type."""

    @property
    def actions(self) -> Mapping[str, ActionServer]: ...
    def receive(self, topic: str, payload: bytes) -> None:
        """A message on a topic that it subscribes to."""

    def serve(self, service: str, payload: bytes) -> bytes | None:
        """The response to a request; None for what is no request."""

    def step(self, moment: Moment) -> Iterable[tuple[str, bytes]]:
        """The messages that it publishes now, as (topic, CDR)."""
