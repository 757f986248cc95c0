"""Recordings of topics: MCAP files, rosbag2's SQLite files, and folders with a metadata.yaml."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rosbags.interfaces import Connection, QosDurability, QosReliability
from rosbags.rosbag2 import Reader

from app.errors import RecordingError
from app.interfaces.names import MESSAGE_TYPE, TOPIC, Qos
from app.simulator.simulated import Topic

SUFFIXES: Final = (".mcap", ".db3")
RIGHT: Final = "it must be an .mcap or a .db3 file, or a folder of rosbag2 with a metadata.yaml"
FORMAT: Final = "cdr"


@dataclass(frozen=True, slots=True)
class Message:
    """`at_s` is in seconds since the first message; `payload` is CDR, as recorded."""

    at_s: float
    topic: str
    payload: bytes


class Recording:
    """A recording, open until `close`. RecordingError says what is wrong with it."""

    def __init__(self, path: Path) -> None:
        self._path = path
        if not path.exists():
            raise RecordingError(f"{path} does not exist: {RIGHT}")
        if path.is_file() and path.suffix not in SUFFIXES:
            raise RecordingError(f"{path} is not a recording: {RIGHT}")
        if path.is_dir() and not (path / "metadata.yaml").is_file():
            raise RecordingError(f"{path} has no metadata.yaml: {RIGHT}")
        try:
            self._reader = Reader(path)
            self._reader.open()
        except Exception as error:  # of a damaged file: of SQLite, of YAML, of struct
            raise RecordingError(f"{path} can't be read: {error}") from error
        self.notes: list[str] = []
        self._connections = [one for one in self._reader.connections if self._is_usable(one)]
        if not any(one.msgcount for one in self._connections):
            self.close()
            raise RecordingError(f"{path} has no message of a ROS 2 topic in CDR")

    def close(self) -> None:
        self._reader.close()

    @property
    def duration_s(self) -> float:
        """From the first message to the last."""
        return self._reader.duration / 1e9

    @property
    def topics(self) -> Mapping[str, Topic]:
        """Topic → type and QoS, as the first publisher offered it."""
        found: dict[str, Topic] = {}
        for one in self._connections:
            known = found.setdefault(one.topic, Topic(one.msgtype, _qos(one), one.digest))
            if known.type != one.msgtype:
                self._note(f"{one.topic} is {known.type} and {one.msgtype}: the second is left out")
        return found

    def messages(self) -> Iterator[Message]:
        """The messages in the order in which they were recorded."""
        topics, start = self.topics, self._reader.start_time
        used = [one for one in self._connections if topics[one.topic].type == one.msgtype]
        try:
            for connection, at_ns, payload in self._reader.messages(used):
                yield Message((at_ns - start) / 1e9, connection.topic, bytes(payload))
        except Exception as error:
            raise RecordingError(f"{self._path} is damaged: {error}") from error

    def _is_usable(self, one: Connection) -> bool:
        """Whether it is a topic as ROS 2 has them; what is not is noted."""
        encoding = getattr(one.ext, "serialization_format", FORMAT)
        if encoding != FORMAT:
            self._note(f"{one.topic} is left out: it is recorded as {encoding}, not as CDR")
        elif not TOPIC.fullmatch(one.topic) or not MESSAGE_TYPE.fullmatch(one.msgtype):
            self._note(f"{one.topic} ({one.msgtype}) is left out: it is no ROS 2 topic")
        else:
            return True
        return False

    def _note(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)


def _qos(connection: Connection) -> Qos:
    """As it was offered; reliable and volatile where the file does not say."""
    offered: list[Any] = getattr(connection.ext, "offered_qos_profiles", [])
    if not offered:
        return Qos()
    one = offered[0]
    return Qos(
        one.reliability is not QosReliability.BEST_EFFORT,
        one.durability is QosDurability.TRANSIENT_LOCAL,
        max(one.depth, 1),
    )
