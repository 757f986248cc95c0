"""Recordings of topics, opened and read: the messages of ROS 2 topics in CDR."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import zstandard

from app.errors import RecordingError
from app.interfaces.names import MESSAGE_TYPE, TOPIC
from app.simulator.bag.files import FORMAT, RecordedFile, RecordedTopic, opener, rescue
from app.simulator.simulated import SimulatedTopic

ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"  # no CDR begins so: its first byte is 0
NS_PER_S: Final = 10**9


@dataclass(frozen=True, slots=True)
class Message:
    """`at_s` is in seconds since the first message; `payload` is CDR, as recorded."""

    at_s: float
    topic: str
    payload: bytes


class Recording:
    """A recording, open until `close`. RecordingError if it can't be read. `notes` are sentences about
    topics that are left out, and messages that are not there."""

    def __init__(self, path: Path) -> None:
        self._path = path
        open_file = opener(path)
        try:
            self._file: RecordedFile = open_file(path)
        except RecordingError:
            raise
        except Exception as error:  # of a damaged file: of SQLite, of YAML, of struct
            raise RecordingError(f"{path} can't be read: {error}{rescue(path)}") from error
        self.notes: list[str] = list(self._file.notes)
        self.topics: dict[str, SimulatedTopic] = {}
        for topic in self._file.topics:
            self._add(topic)
        self.notes = list(dict.fromkeys(self.notes))  # a folder's files each have its topics
        self._count = sum(
            topic.count
            for topic in self._file.topics
            if topic.topic in self.topics and topic.format == FORMAT
        )
        if not self._count:
            self.close()
            raise RecordingError(f"{path} has no message of a ROS 2 topic in CDR")

    def close(self) -> None:
        self._file.close()

    @property
    def duration_s(self) -> float:
        """From the first message to the last."""
        return (self._file.end_ns - self._file.start_ns) / NS_PER_S

    def messages(self) -> Iterator[Message]:
        """The messages in the order in which they were recorded. RecordingError if some are missing."""
        number = 0
        try:
            for at_ns, topic, payload in self._file.messages(self.topics):
                number += 1
                yield Message((at_ns - self._file.start_ns) / NS_PER_S, topic, _cdr(topic, payload))
        except Exception as error:
            raise RecordingError(f"{self._path} is damaged: {error}{rescue(self._path)}") from error
        if number < self._count:
            why = f"it has {number} of {self._count} messages"
            raise RecordingError(f"{self._path} is damaged: {why}{rescue(self._path)}")

    def _add(self, topic: RecordedTopic) -> None:
        """Adds a topic as ROS 2 has them; another one is noted."""
        known = self.topics.get(topic.topic)
        if topic.format != FORMAT:
            self.notes.append(
                f"{topic.topic} is left out: it is recorded as {topic.format}, not as CDR"
            )
        elif not TOPIC.fullmatch(topic.topic) or not MESSAGE_TYPE.fullmatch(topic.type):
            self.notes.append(f"{topic.topic} ({topic.type}) is left out: it is no ROS 2 topic")
        elif known is None:
            self.topics[topic.topic] = SimulatedTopic(topic.type, topic.qos, topic.hash)
        elif known.type != topic.type:
            conflict = f"{topic.topic} is {known.type} and {topic.type} in the recording"
            self.notes.append(f"{conflict}: messages of both are replayed as the first")


def _cdr(topic: str, payload: bytes) -> bytes:
    """A message as CDR. rosbag2 can compress each message, which only the folder's metadata.yaml says.
    ValueError for what is neither."""
    if payload.startswith(ZSTD_MAGIC):
        frame = zstandard.ZstdDecompressor().decompressobj()
        payload = frame.decompress(payload)
        if not frame.eof:
            raise ValueError(f"a compressed message of {topic} is cut off")
    if not payload.startswith(b"\0"):
        raise ValueError(f"a message of {topic} is neither CDR nor compressed by zstd")
    return payload
