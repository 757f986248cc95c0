"""Recordings of topics: MCAP files, rosbag2's SQLite files, and folders with a metadata.yaml."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Final, Protocol

from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary
from rosbags.interfaces import Connection, QosDurability, QosReliability
from rosbags.interfaces import Qos as OfferedQos
from rosbags.rosbag2 import Reader
from rosbags.rosbag2.metadata import parse_qos

from app.errors import RecordingError
from app.interfaces.names import MESSAGE_TYPE, TOPIC, Qos
from app.simulator.simulated import Topic

RIGHT: Final = "it must be an .mcap or a .db3 file, or a folder of rosbag2 with a metadata.yaml"
FORMAT: Final = "cdr"
NS_PER_S: Final = 10**9

Recorded = tuple[int, str, bytes]  # ns since the epoch, topic, payload


@dataclass(frozen=True, slots=True)
class Message:
    """`at_s` is in seconds since the first message; `payload` is CDR, as recorded."""

    at_s: float
    topic: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class RecordedTopic:
    """A topic of a file. `format` is how its messages are serialized, `hash` that of its type or ""."""

    topic: str
    type: str
    format: str
    qos: Qos
    hash: str
    count: int


class _File(Protocol):
    """What reads one format."""

    start_ns: int
    end_ns: int
    topics: Sequence[RecordedTopic]

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]: ...
    def close(self) -> None: ...


class Recording:
    """A recording, open until `close`. RecordingError if it can't be read. `notes` are sentences about
    topics that are left out."""

    def __init__(self, path: Path) -> None:
        self._path = path
        opener = _opener(path)
        try:
            self._file: _File = opener(path)
        except RecordingError:
            raise
        except Exception as error:  # of a damaged file: of SQLite, of YAML, of struct
            raise RecordingError(f"{path} can't be read: {error}") from error
        self.notes: list[str] = []
        self.topics: dict[str, Topic] = {}
        for one in self._file.topics:
            self._add(one)
        if not any(one.count for one in self._file.topics if one.topic in self.topics):
            self.close()
            raise RecordingError(f"{path} has no message of a ROS 2 topic in CDR")

    def close(self) -> None:
        self._file.close()

    @property
    def duration_s(self) -> float:
        """From the first message to the last."""
        return (self._file.end_ns - self._file.start_ns) / NS_PER_S

    def messages(self) -> Iterator[Message]:
        """The messages in the order in which they were recorded."""
        try:
            for at_ns, topic, payload in self._file.messages(self.topics):
                yield Message((at_ns - self._file.start_ns) / NS_PER_S, topic, payload)
        except Exception as error:
            raise RecordingError(f"{self._path} is damaged: {error}") from error

    def _add(self, one: RecordedTopic) -> None:
        """Adds a topic as ROS 2 has them; another one is noted."""
        known = self.topics.get(one.topic)
        if one.format != FORMAT:
            self.notes.append(f"{one.topic} is left out: it is recorded as {one.format}, not as CDR")
        elif not TOPIC.fullmatch(one.topic) or not MESSAGE_TYPE.fullmatch(one.type):
            self.notes.append(f"{one.topic} ({one.type}) is left out: it is no ROS 2 topic")
        elif known is None:
            self.topics[one.topic] = Topic(one.type, one.qos, one.hash)
        elif known.type != one.type:
            what = f"{one.topic} is {known.type} and {one.type} in the recording"
            self.notes.append(f"{what}: messages of both are replayed as the first")


def _opener(path: Path) -> type["_Mcap"] | type["_Rosbag"]:
    if not path.exists():
        raise RecordingError(f"{path} does not exist: {RIGHT}")
    if path.is_dir():
        if not (path / "metadata.yaml").is_file():
            raise RecordingError(f"{path} has no metadata.yaml: {RIGHT}")
        return _Rosbag
    if path.suffix not in (".mcap", ".db3"):
        raise RecordingError(f"{path} is not a recording: {RIGHT}")
    return _Mcap if path.suffix == ".mcap" else _Rosbag


class _Mcap:
    """An MCAP file, with whatever channels it has (mcap.dev)."""

    def __init__(self, path: Path) -> None:
        self._stream: IO[bytes] = path.open("rb")
        try:
            self._reader = make_reader(self._stream, validate_crcs=True)
            summary = self._reader.get_summary()
            if summary is None or summary.statistics is None:
                raise RecordingError(f"{path} was not finished: `mcap recover` mends it")
            statistics = summary.statistics
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
            self.topics: Sequence[RecordedTopic] = [
                _of_channel(one, summary) for one in summary.channels.values()
            ]
        except BaseException:
            self.close()
            raise

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        for _, channel, message in self._reader.iter_messages(topics=list(topics)):
            if channel.message_encoding == FORMAT:
                yield message.log_time, channel.topic, message.data

    def close(self) -> None:
        self._stream.close()


def _of_channel(channel: Channel, summary: Summary) -> RecordedTopic:
    schema: Schema | None = summary.schemas.get(channel.schema_id)
    counts: Mapping[int, int] = summary.statistics.channel_message_counts if summary.statistics else {}
    return RecordedTopic(
        channel.topic,
        "" if schema is None else schema.name,
        channel.message_encoding,
        _qos(parse_qos(channel.metadata.get("offered_qos_profiles", ""))),
        channel.metadata.get("topic_type_hash", ""),
        counts.get(channel.id, 0),
    )


class _Rosbag:
    """A folder of rosbag2, or one of its SQLite files."""

    def __init__(self, path: Path) -> None:
        self._reader = Reader(path)
        self._reader.open()
        self.start_ns = self._reader.start_time
        last_ns = self._reader.end_time - 1  # the library has the time after the last message
        self.end_ns = max(last_ns, self.start_ns)
        self.topics: Sequence[RecordedTopic] = [_of_connection(one) for one in self._reader.connections]

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        used = [one for one in self._reader.connections if one.topic in topics]
        with closing(self._reader.messages(used)) as messages:
            for connection, at_ns, payload in messages:
                yield at_ns, connection.topic, bytes(payload)

    def close(self) -> None:
        self._reader.close()


def _of_connection(one: Connection) -> RecordedTopic:
    encoding: str = getattr(one.ext, "serialization_format", FORMAT)
    offered: list[OfferedQos] = getattr(one.ext, "offered_qos_profiles", [])
    return RecordedTopic(one.topic, one.msgtype, encoding, _qos(offered), one.digest, one.msgcount)


def _qos(offered: Sequence[Any]) -> Qos:
    """As the first publisher offered it; reliable and volatile if the file does not have it."""
    if not offered:
        return Qos()
    one: OfferedQos = offered[0]
    return Qos(
        one.reliability is not QosReliability.BEST_EFFORT,
        one.durability is QosDurability.TRANSIENT_LOCAL,
        max(one.depth, 1),
    )
