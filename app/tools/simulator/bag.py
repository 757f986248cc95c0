"""Recordings that are replayed instead of a simulated robot: MCAP files and rosbag2's SQLite files."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, Protocol

import zstandard
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary

from app.panel.model import Panel
from app.ros.messages.names import MESSAGE_TYPE, TOPIC, Qos
from app.system.errors import RecordingError
from app.tools.simulator.known_types import Moment
from app.tools.simulator.robot import ActionServer, SimulatedTopic

if TYPE_CHECKING:
    from rosbags.rosbag2.reader import ReaderProtocol


# The files of recordings: MCAP files, rosbag2's SQLite files, and folders with a metadata.yaml.

try:
    from rosbags.interfaces import Connection, QosDurability, QosReliability
    from rosbags.interfaces import Qos as OfferedQos
    from rosbags.rosbag2.metadata import ReaderMetadata, parse_qos
    from rosbags.rosbag2.reader import DirectoryReader
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
except ModuleNotFoundError as error:
    helps = '`pip install "operator-panel[replay]"`, in a checkout `make .venv/test`'
    raise RecordingError(f"replaying needs rosbags: {helps}") from error


RIGHT: Final = "it must be an .mcap or a .db3 file, or a folder of rosbag2 with a metadata.yaml"
FORMAT: Final = "cdr"
MCAP_MAGIC: Final = b"\x89MCAP0\r\n"  # at the beginning and at the end of a file
# What saves the messages of a damaged file, by its suffix.
RESCUE: Final[Mapping[str, str]] = {
    ".mcap": "`mcap recover {path} -o recovered.mcap` saves the messages that are whole",
    ".db3": '`sqlite3 {path} ".recover" | sqlite3 recovered.db3` saves the messages that are whole',
}

Recorded = tuple[int, str, bytes]  # ns since the epoch, topic, payload


@dataclass(frozen=True, slots=True)
class RecordedTopic:
    """A topic of a file. `format` is how its messages are serialized, `hash` that of its type or ""."""

    topic: str
    type: str
    format: str
    qos: Qos
    hash: str
    count: int


class RecordedFile(Protocol):
    """What reads one format."""

    start_ns: int
    end_ns: int
    topics: Sequence[RecordedTopic]
    notes: Sequence[str]  # what is not as it should be

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]: ...
    def close(self) -> None: ...


def rescue(path: Path) -> str:
    """What helps, as the end of a sentence; "" for a folder, whose error names a file."""
    return f"; {RESCUE[path.suffix].format(path=path)}" if path.suffix in RESCUE else ""


def opener(path: Path) -> type["_Mcap"] | type["_Sqlite"] | type["_Folder"]:
    if not path.exists():
        raise RecordingError(f"{path} does not exist: {RIGHT}")
    if path.is_dir():
        if not (path / "metadata.yaml").is_file():
            helps = f"`ros2 bag reindex {path}` writes one for a bag whose recording was cut off"
            raise RecordingError(f"{path} has no metadata.yaml: {RIGHT}; {helps}")
        return _Folder
    if path.suffix == ".zstd":
        helps = f"play its folder, or unpack it: `zstd -d {path}`"
        raise RecordingError(f"{path} is a compressed file of a bag: {helps}")
    if path.suffix not in (".mcap", ".db3"):
        raise RecordingError(f"{path} is not a recording: {RIGHT}")
    return _Mcap if path.suffix == ".mcap" else _Sqlite


def _check_mcap_ends(path: Path) -> None:
    """RecordingError for a file that is not MCAP, or has no end: the library's errors are of the bytes
    where it looked for one."""
    with path.open("rb") as stream:
        begins = stream.read(len(MCAP_MAGIC))
        stream.seek(max(path.stat().st_size - len(MCAP_MAGIC), len(begins)))
        ends = stream.read()
    if begins != MCAP_MAGIC:
        raise RecordingError(f"{path} can't be read: it is not an MCAP file")
    if ends != MCAP_MAGIC:
        raise RecordingError(f"{path} was not finished, or is cut off{rescue(path)}")


class _Mcap:
    """An MCAP file, with whatever channels it has (mcap.dev)."""

    notes: Sequence[str] = ()

    def __init__(self, path: Path) -> None:
        _check_mcap_ends(path)
        self._stream: IO[bytes] = path.open("rb")
        try:
            self._reader = make_reader(self._stream, validate_crcs=True)
            summary = self._reader.get_summary()
            if summary is None or summary.statistics is None:
                raise RecordingError(f"{path} was not finished{rescue(path)}")
            statistics = summary.statistics
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
            self.topics: Sequence[RecordedTopic] = [
                _of_channel(channel, summary) for channel in summary.channels.values()
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


class _Sqlite:
    """One of rosbag2's SQLite files."""

    notes: Sequence[str] = ()

    def __init__(self, path: Path) -> None:
        self._reader = Sqlite3Reader(path)
        self._reader.open()
        self.start_ns, self.end_ns = _ends(self._reader.metadata)
        self.topics: Sequence[RecordedTopic] = [
            _of_connection(connection) for connection in self._reader.connections
        ]

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        yield from _stored(self._reader, topics)

    def close(self) -> None:
        self._reader.close()


class _Folder:
    """A folder of rosbag2. Its metadata.yaml names the files; their messages are those of the files'
    own topics, since the two differ: a publisher that appears later is in one of them only."""

    def __init__(self, path: Path) -> None:
        for file in sorted(path.glob("*.mcap")):
            _check_mcap_ends(file)
        self._reader = DirectoryReader(path)
        self._reader.open()
        self.start_ns, self.end_ns = _ends(self._reader.metadata)
        stored = [
            _of_connection(connection)
            for file in self._reader.storages
            for connection in file.connections
        ]
        # QoS and type as the folder has them, where it has the topic.
        named = [
            replace(_of_connection(connection), count=0) for connection in self._reader.connections
        ]
        self.topics: Sequence[RecordedTopic] = [*named, *stored]
        there, said = sum(topic.count for topic in stored), self._reader.metadata.message_count
        missing = f"{path}: its files have {there} messages, its metadata.yaml names {said}"
        self.notes: Sequence[str] = [missing] if there < said else []

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        for file in self._reader.storages:
            yield from _stored(file, topics)

    def close(self) -> None:
        self._reader.close()


def _ends(about: ReaderMetadata) -> tuple[int, int]:
    """The times of the first message and of the last: the library has the time after that."""
    return about.start_time, max(about.end_time - 1, about.start_time)


def _stored(file: "ReaderProtocol", topics: Collection[str]) -> Iterator[Recorded]:
    used = [connection for connection in file.connections if connection.topic in topics]
    with closing(file.messages(used)) as messages:
        for connection, at_ns, payload in messages:
            yield at_ns, connection.topic, bytes(payload)


def _of_connection(connection: Connection) -> RecordedTopic:
    encoding: str = getattr(connection.ext, "serialization_format", FORMAT)
    offered: list[OfferedQos] = getattr(connection.ext, "offered_qos_profiles", [])
    return RecordedTopic(
        connection.topic,
        connection.msgtype,
        encoding,
        _qos(offered),
        connection.digest,
        connection.msgcount,
    )


def _qos(offered: Sequence[Any]) -> Qos:
    """As the first publisher offered it; reliable and volatile if the file does not have it."""
    if not offered:
        return Qos()
    offer: OfferedQos = offered[0]
    return Qos(
        offer.reliability is not QosReliability.BEST_EFFORT,
        offer.durability is QosDurability.TRANSIENT_LOCAL,
        max(offer.depth, 1),
    )


# Recordings of topics, opened and read: the messages of ROS 2 topics in CDR.

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
        self._recorded: list[str] = []  # the names of these topics in the file
        for topic in self._file.topics:
            self._add(topic)
        self.notes = list(dict.fromkeys(self.notes))  # a folder's files each have its topics
        self._count = sum(
            topic.count
            for topic in self._file.topics
            if absolute(topic.topic) in self.topics and topic.format == FORMAT
        )
        if not self._count:
            self.close()
            why = f": {self.notes[0]}" if self.notes else ""
            raise RecordingError(f"{path} has no message of a ROS 2 topic in CDR{why}")

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
            for at_ns, recorded, payload in self._file.messages(self._recorded):
                number += 1
                topic = absolute(recorded)
                yield Message((at_ns - self._file.start_ns) / NS_PER_S, topic, _cdr(topic, payload))
        except Exception as error:
            raise RecordingError(f"{self._path} is damaged: {error}{rescue(self._path)}") from error
        if number < self._count:
            why = f"it has {number} of {self._count} messages"
            raise RecordingError(f"{self._path} is damaged: {why}{rescue(self._path)}")

    def _add(self, topic: RecordedTopic) -> None:
        """Adds a topic as ROS 2 has them; another one is noted."""
        name = absolute(topic.topic)
        known = self.topics.get(name)
        if topic.format != FORMAT:
            self.notes.append(
                f"{topic.topic} is left out: it is recorded as {topic.format}, not as CDR"
            )
        elif not TOPIC.fullmatch(name) or not MESSAGE_TYPE.fullmatch(topic.type):
            self.notes.append(f"{topic.topic} ({topic.type}) is left out: it is no ROS 2 topic")
        elif known is None:
            self._recorded.append(topic.topic)
            self.topics[name] = SimulatedTopic(topic.type, topic.qos, topic.hash)
        elif known.type != topic.type:
            conflict = f"{topic.topic} is {known.type} and {topic.type} in the recording"
            self.notes.append(f"{conflict}: messages of both are replayed as the first")


def absolute(topic: str) -> str:
    """A topic's name from the root: some programs record names without the first slash."""
    return topic if topic.startswith("/") else f"/{topic}"


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


# A robot that publishes what was recorded: pure, stepped with time. It has topics only.

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
